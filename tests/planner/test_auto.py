"""The strategy `auto`: the better of what the others find."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given

from bbtc.ground.condition import Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.result import Plan, Refinement
from bbtc.planner.strategies import DEFAULT
from bbtc.tree.nodes import walk
from tests.domains.problems import PROBLEMS, Problem, task_of
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def plan(of: Task, strategy: str, target: str | None = None, steps: list[Refinement] | None = None) -> Plan:
    wanted = None if target is None else Fraction(target)
    told: list[Refinement] = []
    done = plan_task(of, wanted, strategy, Limits(states=5000, nodes=200), told.append)
    if steps is not None:
        steps.extend(told)
    return done


def size(of: Plan) -> int:
    return sum(1 for _ in walk(of.tree.root))


@examples(60)
@given(of=tasks())
def test_auto_is_no_worse_than_the_other_strategies(of: Task) -> None:
    auto = plan(of, "auto", "0.9")
    for other in (plan(of, strategy, "0.9") for strategy in ("refine", "search", "policy")):
        assert auto.tree.success_probability >= min(other.tree.success_probability, Fraction("0.9"))
        if other.tree.status == "target-reached":
            assert size(auto) <= size(other)


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_our_domains_are_solved_with_small_trees(problem: Problem) -> None:
    of = task_of(problem)
    done = plan(of, "auto")
    assert done.tree.status == "target-reached"
    assert size(done) <= min(70, size(plan(of, "search")))
    assert problem.domain == "service-robot" or size(done) <= min(40, size(plan(of, "refine")))


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_the_refinements_told_are_those_of_the_tree_that_is_kept(problem: Problem) -> None:
    steps: list[Refinement] = []
    done = plan(task_of(problem), "auto", None, steps)
    assert tuple(steps) == done.refinements
    if steps:
        assert steps[-1].success >= done.tree.target


def test_what_is_out_of_reach_is_said_with_the_best_tree() -> None:
    once = action("try", Is(1, T), ("0.5", {0: T, 1: F}), ("0.5", {1: F}))
    done = plan(task("goal available", {1: T}, Is(0, T), once), "auto", "0.9")
    assert (done.tree.status, done.tree.bounds) == ("out-of-reach", (Fraction(1, 2), Fraction(1, 2)))
    assert done.tree.success_probability == Fraction(1, 2)


def test_by_default_the_templates_of_a_domain_are_followed_if_that_reaches_the_target() -> None:
    """In the household; not in the doors, which have none, nor where only another tree is good enough."""
    soda, doors = (task_of(p) for p in PROBLEMS if str(p) in {"household/look-for-soda", "doors/to-the-lab"})
    if not soda.templates:
        soda, doors = doors, soda
    assert plan(soda, DEFAULT).tree.root == plan(soda, "refine").tree.root
    assert plan(soda, "auto").tree.root != plan(soda, "refine").tree.root
    assert plan(doors, DEFAULT).tree.root == plan(doors, "auto").tree.root
    sure = plan(soda, DEFAULT, "1")
    assert sure.tree.success_probability == plan(soda, "auto", "1").tree.success_probability
    assert sure.tree.success_probability > plan(soda, "refine", "1").tree.success_probability


def test_a_large_tree_is_worth_a_longer_second_opinion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the task is too large for a quick one, the search's tree stands, unless it is large itself."""
    (of,) = (task_of(p) for p in PROBLEMS if str(p) == "warehouse/blocked-aisle")
    found, small = size(plan(of, "search")), size(plan(of, "policy"))
    assert small < found
    monkeypatch.setattr("bbtc.planner.auto.STATES_AND_ACTIONS", 1)
    monkeypatch.setattr("bbtc.planner.auto.LARGE_TREE", found)
    assert size(plan(of, "auto")) == found
    monkeypatch.setattr("bbtc.planner.auto.LARGE_TREE", found - 1)
    assert size(plan(of, "auto")) == small
