"""The list of scenarios holds the runs that end, and does not wait for the others."""

from __future__ import annotations

from fractions import Fraction
from itertools import islice

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import sample, scenarios
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import TRUE, Is
from bbtc.ground.task import GroundAction, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node
from tests.planner.test_refine import action, task

T = Truth.TRUE


def probabilities(of: Task, root: Node) -> list[Fraction]:
    return [run.probability for run in scenarios(explore(of, root, Limits()), Limits())]


def two_facts(*actions: GroundAction) -> Task:
    return task("won lost", {}, Is(0, T), *actions)


def test_a_run_without_end_is_no_scenario() -> None:
    of = two_facts(action("wait", TRUE, ("1", {})))
    assert probabilities(of, ActionNode("n1", "wait()", latched=False)) == []


def test_runs_that_end_are_listed_where_others_go_on_for_ever() -> None:
    """Once lost, the robot waits without end."""
    toss = action("toss", TRUE, ("0.5", {0: T}), ("0.5", {1: T}))
    of = two_facts(toss, action("wait", TRUE, ("1", {})))
    waiting = ControlNode(
        "n2", "sequence", (ConditionNode("n3", Is(1, T)), ActionNode("n4", "wait()", latched=False))
    )
    root = ControlNode("n1", "fallback", (ConditionNode("n5", Is(0, T)), waiting, ActionNode("n6", "toss()")))
    assert probabilities(of, root) == [Fraction(1, 2)]


def test_listing_and_sampling_end_at_the_limit() -> None:
    of = two_facts(action("try", TRUE, ("1/4", {0: T}), ("3/4", {})))
    root = ControlNode(
        "n1", "fallback", (ConditionNode("n2", Is(0, T)), ActionNode("n3", "try()", latched=False))
    )
    chain = explore(of, root, Limits())
    runs = scenarios(chain, Limits(states=100))
    assert [len(run.steps) for run in islice(runs, 3)] == [1, 2, 3]
    with pytest.raises(LimitReached, match="the limit of 100 states ended the listing of runs"):
        list(runs)
    with pytest.raises(LimitReached, match="sampling"):
        sample(chain, 10**9, 0, Limits(seconds=0.2))


def test_sampled_runs_end_as_often_as_they_do() -> None:
    """A toss that is won, lost, or followed by waiting without end, which is cut off (within 4 sigma)."""
    toss = action("toss", TRUE, ("1/2", {0: T}), ("1/4", {}), ("1/4", {1: T}))
    of = two_facts(toss, action("wait", Is(1, T), ("1", {})))
    waiting = ControlNode(
        "n1", "sequence", (ConditionNode("n2", Is(1, T)), ActionNode("n3", "wait()", latched=False))
    )
    tossing = ControlNode("n4", "sequence", (ActionNode("n5", "toss()"), ConditionNode("n6", Is(0, T))))
    root = ControlNode("n7", "fallback", (ConditionNode("n8", Is(0, T)), waiting, tossing))
    found = sample(explore(of, root, Limits()), 1600, 0, Limits(), max_steps=50)
    assert found.samples == 1600
    assert abs(found.successes - 800) <= 80
    assert abs(found.cut - 400) <= 70
