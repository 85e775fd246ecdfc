"""A run steered by hand is the scenario that the exact simulation lists."""

from __future__ import annotations

import itertools

from hypothesis import assume, given

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.belief.stepper import Branch, Stepper
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import LimitReached
from bbtc.limits import Limits
from bbtc.tree.nodes import Tree
from tests.profiles import examples
from tests.strategies import soda_tree, trees


def place(branches: tuple[Branch, ...], values: bytes) -> int:
    return next(number for number, branch in enumerate(branches) if branch.values == values)


def finish(stepper: Stepper) -> None:
    while not stepper.finished:
        stepper.step()


@examples(150)
@given(trees())
def test_taking_the_outcomes_of_a_scenario_gives_that_scenario(tree: Tree) -> None:
    try:
        chain = explore(tree.task, tree.root, Limits(states=300))
    except LimitReached:
        assume(False)
    stepper = Stepper(tree.task, tree.root)
    for run in itertools.islice(scenarios(chain, Limits()), 8):
        stepper.start(place(stepper.starts, run.initial))
        probability = stepper.starts[place(stepper.starts, run.initial)].probability
        for step in run.steps:
            assert stepper.now.action == step.node
            assert sum(branch.probability for branch in stepper.now.branches) == 1
            number = place(stepper.now.branches, step.values)
            probability *= stepper.now.branches[number].probability
            stepper.step(number)
        assert stepper.finished
        assert (stepper.now.status, stepper.now.state.values) == (run.status, run.final)
        assert stepper.now.statuses[tree.root.id] is run.status
        assert probability == run.probability


def test_going_back_and_on_again_draws_the_same_outcomes() -> None:
    tree = soda_tree()
    for seed in range(20):
        stepper = Stepper(tree.task, tree.root, seed)
        stepper.start()
        assert stepper.back() is False
        finish(stepper)
        moments = list(stepper.moments)
        for _ in moments:
            stepper.back()
        assert stepper.moments == moments[:1]
        finish(stepper)
        assert stepper.moments == moments


def test_seeds_draw_by_the_probabilities() -> None:
    tree = soda_tree()
    wins = 0
    for seed in range(400):
        stepper = Stepper(tree.task, tree.root, seed)
        stepper.start()
        finish(stepper)
        wins += stepper.now.status is NodeStatus.SUCCESS
    assert 150 < wins < 250  # of 400 with probability 1/2: five standard deviations on either side
