"""The table of strategies says what each can do."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.belief.chain import explore
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.options import Options, Retries
from bbtc.planner.result import Plan
from bbtc.planner.strategies import STRATEGIES, others
from bbtc.rewrite.retry import longest_run
from bbtc.tree.nodes import retries_of
from tests.planner.test_refine import action, task

LAMP = task(
    "on", {}, Is(0, Truth.TRUE), action("press", Is(0, Truth.FALSE), ("1/2", {0: Truth.TRUE}), ("1/2", {}))
)
"""Every press turns it on one time in two."""


_RETRIES: tuple[Retries, ...] = ("least", "unbounded")


def plan(strategy: str, options: Options, target: str) -> Plan:
    return plan_task(LAMP, Fraction(target), strategy, Limits(), lambda _: None, options=options)


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_strategy_plans_within_a_number_of_actions_or_refuses_to(strategy: str) -> None:
    if not STRATEGIES[strategy].max_actions:
        with pytest.raises(BbtcError) as refused:
            plan(strategy, Options(max_actions=2), "1")
        assert [each.code for each in refused.value.diagnostics] == ["BBT0503"]
        return
    tree = plan(strategy, Options(max_actions=2), "1").tree
    assert tree.success_probability == Fraction(3, 4)
    assert longest_run(explore(LAMP, tree.root, Limits())) == 2


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_strategy_bounds_attempts_where_it_says_so(strategy: str) -> None:
    attempts = {
        retries: [most for _, most in retries_of(plan(strategy, Options(retries=retries), "3/4").tree.root)]
        for retries in _RETRIES
    }
    assert attempts == {"least": [2] if STRATEGIES[strategy].retries else [], "unbounded": []}


def test_help_names_the_other_strategies_and_those_that_know_an_option() -> None:
    assert others() == "refine, search, policy, strong-cyclic, advised"
    assert others(lambda entry: entry.retries) == "search, policy, advised"
