"""What is very far is not taken for out of reach: additive heuristics double from step to step here."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.diagnostics import Report
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.mdp.bounded_search import search_bounds
from bbtc.source import SourceFile


def ladder(steps: int) -> Task:
    """Two sides of a ladder, each step of either needs both sides of the one before."""
    facts = " ".join(f"(left{at}) (right{at})" for at in range(steps + 1))
    actions = " ".join(
        f"(:action {side}{at}-up :precondition (and (left{at}) (right{at})) :effect ({side}{at + 1}))"
        for at in range(steps)
        for side in ("left", "right")
    )
    text = (
        f"(define (domain ladder) (:predicates {facts}) {actions})"
        f"(define (problem up) (:domain ladder) (:init (left0) (right0)) (:goal (left{steps})))"
    )
    return compile_sources([SourceFile("ladder.pddl", text)], Report(), Limits())


@pytest.mark.parametrize("strategy", ["strong-cyclic", "auto"])
def test_a_goal_behind_many_steps_is_planned_for(strategy: str) -> None:
    tree = plan_task(ladder(62), None, strategy, Limits(), lambda _: None).tree
    assert tree.success_probability == 1


def test_a_search_does_not_call_it_a_dead_end() -> None:
    found = search_bounds(ladder(140), Limits(), Fraction(1))
    assert found.bounds.lower == 1
