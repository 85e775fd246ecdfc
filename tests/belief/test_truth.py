"""What is true in a run where facts are hidden: it explains all that the robot is told."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import cache

import pytest

import bbtc
from bbtc.belief.hidden import belief_in
from bbtc.belief.stepper import Stepper
from bbtc.belief.tick import NodeStatus
from bbtc.tree.nodes import Tree
from tests.belief.hidden_tasks import search, tiger

ACCURACY = Fraction(17, 20)
HALF = Fraction(1, 2)


@cache
def searching() -> Tree:
    """A tree that looks for a thing in three places, and may fail to see it."""
    return bbtc.plan(search(3, HALF), target=Fraction(9, 10)).tree


def finished(stepper: Stepper) -> Stepper:
    stepper.start()
    while not stepper.finished:
        stepper.step()
    return stepper


@pytest.mark.parametrize("seed", range(5))
def test_a_thing_is_found_where_it_was_all_the_time(seed: int) -> None:
    tree = searching()
    stepper = finished(Stepper(tree.task, tree.root, seed))
    places = {tuple(f for f in stepper.truth.facts(m.worlds) if f != "seen()") for m in stepper.moments}
    assert len(places) == 1
    for moment in stepper.moments:
        (world,) = moment.worlds
        assert world in dict(belief_in(stepper.task, moment.state.values, 0))


def test_runs_end_in_the_truth_as_often_as_computed() -> None:
    """Of runs of the tiger that listen until they are sure, the share that is right; they end as the truth
    says: free where the tiger is not behind the door."""
    task = tiger(ACCURACY, Fraction(85, 100))  # believed after one reading
    tree = bbtc.plan(task, target=HALF).tree
    ends: Counter[bool] = Counter()
    for seed in range(400):
        stepper = finished(Stepper(tree.task, tree.root, seed))
        opened = stepper.moments[-2].action
        assert opened is not None
        behind = "left" if stepper.truth.facts(stepper.now.worlds) else "right"
        alive = opened.action != f"open({behind})"
        assert alive == (stepper.now.status is NodeStatus.SUCCESS)
        ends[alive] += 1
    deviation = float(400 * ACCURACY * (1 - ACCURACY)) ** 0.5
    assert abs(ends[True] - 400 * float(ACCURACY)) < 5 * deviation


def test_what_is_chosen_against_the_truth_draws_another() -> None:
    tree = bbtc.plan(search(2), target=1).tree
    stepper = Stepper(tree.task, tree.root, 1)
    stepper.start()
    (before,) = stepper.now.worlds
    choices = range(len(stepper.now.branches))
    seen = set()
    for choice in choices:
        stepper.start()
        stepper.step(choice)
        (world,) = stepper.now.worlds
        assert world in dict(belief_in(stepper.task, stepper.now.state.values, 0))
        seen.add(world & 3)
    assert len(seen) == len(choices) == 2
    assert before & 3 in seen
