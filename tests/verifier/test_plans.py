"""Trees that were planned, by every strategy, on random tasks and on the shared cases, are verified."""

from __future__ import annotations

from fractions import Fraction
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.options import Options, Retries
from bbtc.planner.strategies import STRATEGIES
from bbtc.tree.nodes import Tree
from bbtc.verifier import storm, storm_worker
from bbtc.verifier.chain import chain_of
from bbtc.verifier.naming import numbered
from bbtc.verifier.prism import prism_text
from bbtc.verifier.verdict import verify
from tests.long_form import LONG, amount
from tests.planner.examples import Optimum, cases
from tests.profiles import examples
from tests.strategies import tasks
from tests.verifier.test_figures import disagreements

RETRIES: tuple[Retries, ...] = get_args(Retries)
WITH_STORM = storm.is_installed()


def check(tree: Tree) -> None:
    """Our own solver finds the claim exactly, and all figures of the simulator; so does Storm."""
    verdict = verify(tree, Limits(), "own")
    assert verdict.problems == ()
    assert verdict.own is not None
    assert disagreements(tree, verdict.own) == {}
    if WITH_STORM:
        program = chain_of(tree.task, tree.root)
        question = {"program": prism_text(program, numbered(program)), "properties": ['P=? [F "success"]']}
        answer = storm_worker.answer(question)
        low, high = map(Fraction, answer["values"][0])
        assert low <= tree.success_probability <= high
        assert (low == high) == answer["exact"]  # more states than that are solved in floats, with bounds


@examples(amount(40, 2000))
@given(
    task=tasks(),
    strategy=st.sampled_from(list(STRATEGIES)),
    retries=st.sampled_from(RETRIES),
    most=st.sampled_from([None, None, 0, 1, 4]),
)
def test_plans_for_random_tasks(task: Task, strategy: str, retries: Retries, most: int | None) -> None:
    budget = most if strategy in {"policy", "auto"} else None
    options = Options(max_actions=budget, retries=retries)
    limits = Limits(seconds=20, states=20_000, nodes=500)
    try:
        plan = plan_task(task, None, strategy, limits, lambda _: None, options=options)
    except LimitReached:
        return
    check(plan.tree)


HOW = [
    (case, strategy, retries)
    for row, case in enumerate(cases())
    for column, strategy in enumerate(STRATEGIES)
    for number, retries in enumerate(RETRIES)
    if LONG or (row + column) % 2 == number
]
"""Each case with each strategy; in the short form with retries without end, or with the fewest."""


@pytest.mark.parametrize(("case", "strategy", "retries"), HOW, ids=lambda each: getattr(each, "name", each))
def test_plans_for_the_shared_cases(case: Optimum, strategy: str, retries: Retries) -> None:
    limits = Limits(seconds=60)
    plan = plan_task(case.task(), None, strategy, limits, lambda _: None, options=Options(retries=retries))
    check(plan.tree)


@pytest.mark.parametrize("budget", [1, 3, 8])
@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_plans_within_a_budget(case: Optimum, budget: int) -> None:
    options = Options(max_actions=budget)
    plan = plan_task(case.task(), None, "policy", Limits(seconds=60), lambda _: None, options=options)
    check(plan.tree)
