"""The strategy `policy`: trees that attain the best probability, at the least cost."""

from __future__ import annotations

import time
from fractions import Fraction

import pytest
from hypothesis import HealthCheck, given, settings

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is, Or, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.plan.result import Plan
from bbtc.plan.space import explore_space
from bbtc.plan.value import reachability
from bbtc.plan.value_cost import least_cost
from bbtc.tree.nodes import ActionNode, walk
from bbtc.tree.validate import check_tree
from tests.plan.examples import Optimum, cases, corpus_optima
from tests.plan.test_refine import action, task
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def plan(of: Task, target: str | None = None, limits: Limits | None = None) -> Plan:
    wanted = None if target is None else Fraction(target)
    return plan_task(of, wanted, "policy", limits or Limits(), lambda _: None)


def size(of: Plan) -> int:
    return sum(1 for _ in walk(of.tree.root))


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_cases_are_solved_at_their_best(case: Optimum) -> None:
    done = plan(case.task())
    assert done.tree.status == "target-reached"
    assert float(done.tree.success_probability) == pytest.approx(case.best, abs=1e-9)
    assert size(done) <= 11


@pytest.mark.parametrize("problem", corpus_optima(), ids=lambda c: c.name)
def test_public_problems_are_solved_at_their_best(problem: Optimum) -> None:
    try:
        of = problem.task()
    except BbtcError as error:
        pytest.skip(f"does not load: {error.diagnostics[0].message}")
    start = time.monotonic()
    done = plan(of)
    assert time.monotonic() - start < 10
    assert float(done.tree.success_probability) == pytest.approx(problem.best, abs=1e-6)
    assert (done.tree.status == "target-reached") == (done.tree.success_probability >= of.goal_probability)
    assert size(done) < 150


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(of=tasks())
def test_random_tasks_are_solved_at_their_best_and_least_cost(of: Task) -> None:
    done = plan(of, "1")
    tree = done.tree
    check_tree(tree)
    chain = explore(of, tree.root, Limits())
    assert violations(of, chain) == []
    found = reachability(explore_space(of, Limits()), Limits())
    assert tree.success_probability == simulate(of, tree.root, Limits()).success == found.initial.exact
    assert tree.status == ("target-reached" if tree.success_probability == 1 else "out-of-reach")
    assert tree.bounds == (tree.success_probability, tree.success_probability)
    assert done.figures.endless == 0
    cheapest = least_cost(found, Limits())
    if cheapest is not None:
        assert done.figures.cost == cheapest.initial


def test_actions_that_cost_nothing_do_not_run_in_circles() -> None:
    import dataclasses

    there, back = action("a-there", Is(0, F), ("1", {0: T})), action("b-back", Is(0, T), ("1", {0: F}))
    win = action("c-win", Is(0, T), ("1", {1: T}))
    free = [dataclasses.replace(a, cost=Fraction(0)) for a in (there, back, win)]
    done = plan(task("room won", {}, Is(1, T), *free))
    assert (done.tree.status, done.figures.actions) == ("target-reached", 2)


def test_an_unknown_goal_is_looked_at_before_it_is_worked_on() -> None:
    look = action("look", Is(0, U), ("1/2", {0: T}), ("1/2", {0: F}))
    push = action("push", Is(0, F), ("9/10", {0: T}), ("1/10", {}))
    done = plan(task("door-open", {0: U}, Is(0, T), look, push))
    assert done.tree.success_probability == 1
    assert size(done) == 5


def test_an_unknown_part_of_a_goal_does_not_hide_a_false_one() -> None:
    """While `a` is unknown, `b` can be worked on; only then `a` can be looked at."""
    fix = action("fix", Is(1, F), ("1", {1: T}))
    look = action("look", conjunction([Is(0, U), Is(1, T)]), ("1/2", {0: T}), ("1/2", {0: F}))
    push = action("push", Is(0, F), ("1", {0: T}))
    done = plan(task("a b", {0: U}, conjunction([Is(0, T), Is(1, T)]), fix, look, push))
    assert done.tree.success_probability == 1


def test_a_hopeless_state_ends_the_run() -> None:
    """A disjunctive goal, and a trap: the tree fails there instead of running on."""
    risk = action("risk", Is(2, F), ("1/2", {0: T}), ("1/2", {2: T}))
    idle = action("idle", Is(2, T), ("1/2", {3: T}), ("1/2", {3: F}))
    done = plan(task("a b trap x", {}, Or((Is(0, T), Is(1, T))), risk, idle))
    assert (done.figures.success, done.figures.failure, done.figures.endless) == (
        Fraction(1, 2),
        Fraction(1, 2),
        0,
    )
    assert {node.action for node in walk(done.tree.root) if isinstance(node, ActionNode)} == {"risk()"}


def test_a_limit_leaves_the_best_that_was_found() -> None:
    switches = [action(f"on-{name}", Is(i, F), ("1", {i: T})) for i, name in enumerate("abcdefgh")]
    of = task("a b c d e f g h", {}, conjunction([Is(i, T) for i in range(8)]), *switches)
    done = plan(of, "1", Limits(states=30))
    assert (done.tree.status, done.tree.bounds) == ("limit-reached", (0, 1))
    assert done.stop is not None
    done = plan(of, "1", Limits(nodes=3))
    assert done.stop is not None
    assert "nodes" in done.stop.message
