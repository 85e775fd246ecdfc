"""Planned trees beside trees written by hand, in worlds that others change; and what the latter are worth."""

from __future__ import annotations

from fractions import Fraction
from math import sqrt

import pytest

import bbtc
from bbtc.disturbance.perturbed import MOST_TICKS
from tests.domains.problems import DOMAINS, PROBLEMS, Problem, task_of
from tests.long_form import amount
from tests.perturbation.optimum import DisturbedTask
from tests.perturbation.rivals import CONTESTED, KINDS, Kind, recovery_of, runs_of, shortfalls, tree_of

TWENTIETH = Fraction(5, 100)
RUNS = amount(1_200, 100_000)
SEED = 11

OUT_OF_REACH = {Problem("kitting", "gift-set"), Problem("warehouse", "one-order")}
"""Where an item may be lost for good, or a pallet shuts the robot in: no tree that ends attains 99 %."""
ALMOST = {
    Problem("service-robot", "two-goals"): Fraction(97, 100),
    Problem("building", "letter-upstairs"): Fraction(90, 100),
}
"""Where the book is nowhere in 1 of 64 undisturbed runs, with too many states to find the optimum; and where
the battery may be emptied far from the charger."""


def test_there_is_a_tree_by_hand_for_each_domain() -> None:
    """But for those in which facts are hidden: nothing tells what the robot believes in other states."""
    hidden = {problem.domain for problem in PROBLEMS if task_of(problem).components}
    assert {problem.domain for problem in CONTESTED} == set(DOMAINS) - hidden


@pytest.mark.parametrize("problem", CONTESTED, ids=str)
def test_trees_by_hand_are_good_ones(problem: Problem) -> None:
    """They attain what is possible from every state that can be reached, and 99 % where something changes
    before one tick in twenty, if a tree can."""
    task = task_of(problem)
    assert float(bbtc.simulate(tree_of(problem, "by hand")).success) == pytest.approx(
        float(bbtc.bounds(task).lower), abs=1e-9
    )
    recovery = recovery_of(problem, "by hand")
    assert recovery.attained == recovery.hopeful
    found = runs_of(problem, "by hand", TWENTIETH, RUNS, SEED)
    assert found.unready == found.missed == 0
    if problem not in OUT_OF_REACH:
        assert found.success >= ALMOST.get(problem, Fraction(99, 100))


@pytest.mark.parametrize("problem", sorted(OUT_OF_REACH), ids=str)
def test_more_than_trees_by_hand_attain_is_out_of_reach(problem: Problem) -> None:
    """They attain as much as anything that ends where the goal is out of reach, and no more than there is."""
    disturbed = DisturbedTask(task_of(problem))
    ends = disturbed.best(TWENTIETH, MOST_TICKS, gives_up=True)
    waits = disturbed.best(TWENTIETH, MOST_TICKS, gives_up=False)
    assert ends < waits < 0.95
    found = float(runs_of(problem, "by hand", TWENTIETH, RUNS, SEED).success)
    error = 4 * sqrt(found * (1 - found) / RUNS)
    assert ends - error <= found <= waits + error


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("problem", CONTESTED, ids=str)
def test_planned_trees_are_as_good_as_those_by_hand(problem: Problem, kind: Kind) -> None:
    assert [text for found, text in shortfalls(problem, RUNS, SEED) if found == kind] == []
