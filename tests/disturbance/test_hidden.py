"""Disturbed worlds in which facts are hidden: what others change is seen, and beliefs stay right."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from math import sqrt

import pytest
from hypothesis import Phase, given, settings

import bbtc
from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.disturbance.perturbed import perturbed_runs
from bbtc.disturbance.recovery import recovery
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, simulate_tree
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from bbtc.tree.nodes import Node
from tests.disturbance.reference import Changes, Exact, State
from tests.ground.examples import task_of
from tests.hidden.texts import texts
from tests.long_form import amount
from tests.profiles import examples

RATE = Fraction(1, 6)
TICKS = 40
SHELF = """
(define (domain shelf)
  (:predicates (can ?p) (lamp) (near) (have))
  (:action switch :effect (probabilistic 0.9 (lamp)))
  (:action come :precondition (not (near)) :effect (near))
  (:action look :parameters (?p) :precondition (and (lamp) (near)) :observe (can ?p))
  (:action take :parameters (?p) :precondition (and (can ?p) (near)) :effect (have)))
(define (problem two)
  (:domain shelf) (:objects a b c) (:init (lamp) (oneof (can a) (can b) (can c))) (:goal (have)))
"""
TIGER = """
(define (domain tiger)
  (:predicates (behind-left) (opened) (safe) (lamp))
  (:action listen :precondition (and (lamp) (not (opened))) :observe (probabilistic 0.85 (behind-left)))
  (:action switch :effect (lamp))
  (:action left :precondition (not (opened))
    :effect (and (opened) (when (not (behind-left)) (safe))))
  (:action right :precondition (not (opened)) :effect (and (opened) (when (behind-left) (safe)))))
(define (problem doors) (:domain tiger) (:init (lamp) (unknown (behind-left))) (:goal (safe)))
"""
SPOTS = """
(define (domain spots)
  (:predicates (ill) (red) (tired) (well))
  (:action look :observe (red))
  (:action treat :precondition (not (tired)) :effect (and (tired) (when (ill) (well))))
  (:action leave :precondition (not (ill)) :effect (well)))
(define (problem patient)
  (:domain spots)
  (:init (probabilistic 0.5 (and (ill) (red)) 0.1 (red)))
  (:goal (well)))
"""


def lowered(text: str) -> Task:
    """The task without hidden facts that does the same, state by state."""
    return compile_sources([SourceFile("x.pddl", text)], Report(), Limits())


def of_what_is_seen(task: Task) -> Changes:
    """One of the seen facts changes, as :mod:`bbtc.planner.changing_facts` has it where none excludes
    others."""

    def changes(state: State) -> list[tuple[Fraction, State]]:
        found = []
        for at, variable in enumerate(task.variables):
            if not variable.hidden:
                found.append((*state[:at], 2 - state[at], *state[at + 1 :]))
        return [(Fraction(1, len(found)), each) for each in found]

    return changes


def compare(task: Task, root: Node, exact: Exact, runs: int) -> Counter[str]:
    """Each sampled share is as near to the exact one as so many runs must come (5 sigma)."""
    found = perturbed_runs(task, root, RATE, Limits(), runs=runs, seed=3, most_ticks=TICKS)
    chances = exact.chances(TICKS)
    counts = Counter(
        success=found.successes,
        missed=found.missed,
        failure=found.failures,
        blocked=found.blocked,
        cut=found.cut,
    )
    assert counts.total() == runs
    for kind, count in counts.items():
        p = min(1.0, chances[kind])
        assert abs(count / runs - p) <= 5 * sqrt(p * (1 - p) / runs) + 1e-9, kind
    assert abs(float(found.actions) - chances["starts"]) <= 5 * sqrt(chances["starts"] * TICKS / runs) + 1e-9
    return counts


def test_only_what_is_seen_changes_and_beliefs_stay_right() -> None:
    """The same tree for the task with hidden facts, and for one without, in an exact chain."""
    without, with_hidden = lowered(SHELF), task_of(SHELF)
    assert with_hidden.components
    assert not without.components
    tree = plan_task(without, None, "policy", Limits(), lambda _: None).tree
    exact = Exact(without, tree.root, float(RATE), of_what_is_seen(without))
    for task in (with_hidden, without):
        counts = compare(task, tree.root, exact, amount(3_000, 50_000))
        assert counts["success"] > 0
    found = perturbed_runs(with_hidden, tree.root, RATE, Limits(), runs=200)
    assert found.facts == 3, "lamp, near, have"


def test_recovery_is_that_of_the_task_without_hidden_facts() -> None:
    """State by state, on random texts whose beliefs are few."""
    many = amount(60, 2_000)
    done: Counter[str] = Counter()

    @settings(examples(many), phases=[Phase.generate])
    @given(texts())
    def look(text: str) -> None:
        try:
            without, with_hidden = lowered(text), task_of(text)
            if without.components or not with_hidden.components:
                return
            tree = plan_task(without, None, "policy", Limits(states=500), lambda _: None).tree
            one, other = (recovery(task, tree.root, Limits(states=2_000)) for task in (without, with_hidden))
        except (BbtcError, LimitReached):
            return
        for figure in ("states", "hopeless", "attained", "mean", "lost", "missed", "endless", "exact"):
            assert getattr(one, figure) == getattr(other, figure), (figure, text)
        done["all" if one.attained == one.hopeful else "some"] += 1

    look()
    assert done["all"] > many / 20
    assert done["some"] > 0


def test_a_tree_that_guesses_is_mistaken_as_often_where_nothing_changes() -> None:
    """Whether the goal is true at a stop is drawn, as probable as it is."""
    task = task_of(TIGER)
    options = Options(allow_guess=True)
    tree = plan_task(task, Fraction(9, 10), "policy", Limits(seconds=5), lambda _: None, options=options).tree
    figures, _ = simulate_tree(tree, Limits())
    assert 0 < figures.success < 1
    runs = amount(3_000, 50_000)
    found = perturbed_runs(tree.task, tree.root, Fraction(0), Limits(), runs=runs)
    p = float(figures.success)
    assert abs(found.successes / runs - p) <= 5 * sqrt(p * (1 - p) / runs)
    assert found.successes + found.missed == runs


def test_a_tree_that_guesses_has_no_recovery() -> None:
    """P* of the other states is that of who knows his goal."""
    tree = bbtc.plan(SourceFile("x.pddl", SPOTS), allow_guess=True, target="0.9").tree
    with pytest.raises(BbtcError) as refused:
        bbtc.recovery(tree)
    assert [each.code for each in refused.value.diagnostics] == ["BBT0506"]
