"""Honest answers: a plan that falls short says what any policy could have reached."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from bbtc import artefacts
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from tests.domains.problems import bbtc
from tests.planner.test_refine import action, task

T, F = Truth.TRUE, Truth.FALSE

ONESHOT = """
(define (domain oneshot)
  (:predicates (done) (left))
  (:action try :precondition (and (not (done)) (left))
    :effect (probabilistic 1/2 (and (done) (not (left))) 1/2 (not (left)))))
(define (problem once) (:domain oneshot) (:init (left)) (:goal (done)) (:goal-probability 0.9))
"""


def coins(count: int) -> str:
    """A text with coins to toss, each once; the goal takes heads three times out of four for each."""
    names = range(count)
    tosses = " ".join(
        f"(:action toss{i} :precondition (not (tossed{i}))"
        f" :effect (and (tossed{i}) (probabilistic 3/4 (heads{i}))))"
        for i in names
    )
    facts = " ".join(f"(tossed{i}) (heads{i})" for i in names)
    goal = " ".join(f"(heads{i})" for i in names)
    return (
        f"(define (domain coins) (:predicates {facts}) {tosses})"
        f"(define (problem all) (:domain coins) (:init) (:goal (and {goal})))"
    )


def one_shot() -> Task:
    once = action("try", Is(1, T), ("0.5", {0: T, 1: F}), ("0.5", {1: F}))
    return task("goal available", {1: T}, Is(0, T), once)


def plan(of: Task, target: str, **limits: Any) -> Plan:
    return plan_task(of, Fraction(target), "refine", Limits(**limits), lambda _: None)


def test_a_target_that_no_policy_reaches_is_said_to_be_out_of_reach() -> None:
    tree = plan(one_shot(), "0.9").tree
    assert (tree.status, tree.success_probability) == ("out-of-reach", Fraction(1, 2))
    assert tree.bounds == (Fraction(1, 2), Fraction(1, 2))


def test_a_target_that_only_the_strategy_misses_is_not_called_out_of_reach() -> None:
    """Greedy refinement jumps at once and may die; a ladder is safe."""
    ground, alive, ladder = 0, 1, 2
    jump = action("jump", Is(alive, T), ("0.6", {ground: T}), ("0.4", {ground: T, alive: F}))
    raise_ladder = action("raise", Is(alive, T), ("1", {ladder: T}))
    climb = action("climb", Is(ladder, T), ("1", {ground: T}))
    of = task("g a l", {alive: T}, conjunction([Is(ground, T), Is(alive, T)]), jump, raise_ladder, climb)
    tree = plan(of, "0.99").tree
    if tree.status != "target-reached":
        assert tree.status == "stuck"
        assert tree.bounds == (1, 1)


def test_bounds_stay_apart_at_a_limit() -> None:
    switches = [action(f"on-{name}", Is(i, F), ("1", {i: T})) for i, name in enumerate("abcdefgh")]
    of = task("a b c d e f g h", {}, conjunction([Is(0, T), Is(7, T)]), *switches)
    value = task_value(of, Limits(states=1))
    assert value.stop is not None
    assert (value.lower, value.upper) == (0, 1)
    value = task_value(of, Limits(states=9))
    assert (value.lower, value.upper) == (1, 1), "found in the part that was seen"
    assert value.expanded < value.states


def test_a_plan_at_a_limit_has_bounds() -> None:
    weak = action("try", Is(0, F), ("0.01", {0: T}), ("0.99", {}))
    tree = plan(task("goal", {}, Is(0, T), weak), "0.9", nodes=12).tree
    assert tree.status == "limit-reached"
    assert tree.bounds == (1, 1)


def test_bounds_are_written_and_read() -> None:
    tree = plan(one_shot(), "0.9").tree
    value = artefacts.tree_to_json(tree)
    assert value["bounds"] == {"lower": "1/2", "upper": "1/2"}
    assert artefacts.tree_from_json(value).bounds == tree.bounds
    value["bounds"] = {"lower": "1", "upper": "1/2"}
    with pytest.raises(BbtcError, match="lower bound"):
        artefacts.tree_from_json(value)


# --- the command -----------------------------------------------------------------------------


@pytest.fixture
def oneshot(tmp_path: Path) -> str:
    file = tmp_path / "oneshot.pddl"
    file.write_text(ONESHOT)
    return str(file)


def test_plan_reports_what_is_possible_and_exits_1(oneshot: str) -> None:
    done = bbtc("plan", oneshot)
    assert done.status == 1
    assert "out of reach" in done.err
    assert "the best that any policy can do is 1/2 (0.5)" in done.err
    assert json.loads(done.out)["bounds"] == {"lower": "1/2", "upper": "1/2"}


def test_bounds_alone(oneshot: str) -> None:
    done = bbtc("plan", oneshot, "--bounds")
    assert done.status == 1
    assert "best success probability: 1/2 (0.5)" in done.out.decode()
    assert "target 9/10 (0.9): out of reach" in done.out.decode()
    assert bbtc("plan", oneshot, "--bounds", "--target", "1/2").status == 0


def test_bounds_at_a_limit(tmp_path: Path) -> None:
    """Ten coins to toss, each once: the goal is far away, and no state of the way is lost."""
    file = tmp_path / "coins.pddl"
    file.write_text(coins(10))
    done = bbtc("plan", str(file), "--bounds", "--max-states", "5", "--target", "1/2")
    assert done.status == 3
    lines = done.out.decode().splitlines()
    assert lines[1] == "best success probability: between 0 and ≈ 0.75"
    assert lines[2] == "target 1/2 (0.5): undecided"
    assert lines[-1] == "the limit of 5 states ended exploration"
    assert "expanded" in lines[-2]


def test_bounds_as_json(oneshot: str) -> None:
    done = bbtc("plan", oneshot, "--bounds", "--json", "--max-actions", "0")
    value = json.loads(done.out)
    assert (value["lower"], value["upper"], value["target"], value["max_actions"]) == ("0", "0", "9/10", 0)


def test_json_needs_bounds(oneshot: str) -> None:
    assert bbtc("plan", oneshot, "--json").status == 2


def test_refine_does_not_plan_within_a_number_of_actions() -> None:
    with pytest.raises(BbtcError, match="number of actions"):
        plan_task(one_shot(), None, "refine", Limits(), lambda _: None, options=Options(max_actions=2))
