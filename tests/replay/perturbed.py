"""Perturbed runs in an engine: the world of :mod:`bbtc.disturbance.perturbed`, asked by an exported tree.

From the same seed it draws what the sampling draws, as long as the engine's tree does what the simulation's
does: so both count the same, or the export is wrong. Actions end within the tick that starts them, as in the
simulation.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.draws import Values
from bbtc.belief.state import initial_belief
from bbtc.disturbance.execution import careful_actions
from bbtc.disturbance.perturbed import Draw, bits_of, threshold
from bbtc.ground.condition import evaluate
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.replay.engines import Replay
from bbtc.tree.nodes import Tree


@dataclass(slots=True)
class Counts:
    """What came of runs, as :class:`bbtc.disturbance.perturbed.PerturbedRuns` counts it; an engine cannot
    tell blocked runs from others that fail."""

    successes: int = 0
    missed: int = 0
    failures: int = 0
    cut: int = 0
    starts: int = 0
    unready: int = 0
    changes: int = 0
    cost: Fraction = Fraction(0)


class PerturbedWorld:
    """See :class:`bbtc.replay.script.World`: one run after the other."""

    def __init__(self, tree: Tree, rate: Fraction, limits: Limits) -> None:
        self.succeeds = True
        self.counts = Counts()
        self.values: Values = b""
        self._task = tree.task
        self._actions = careful_actions(tree.task, tree.root, limits)
        self._facts = ChangingFacts.of(tree.task, limits)
        self._threshold = threshold(rate)
        self._bits = bits_of(0, 0)

    def begin(self, seed: int, run: int) -> None:
        """A run starts."""
        belief = initial_belief(self._task)
        self._bits = bits_of(seed, run)
        self.values = list(belief)[Draw(belief.values())(self._bits())]

    def before_tick(self) -> None:
        """A tick comes: something may change."""
        if self._bits() >= self._threshold:
            return
        changes, bits = self._facts.changes(self.values), self._bits()
        if changes:
            self.values = changes[Draw(chance for chance, _ in changes)(bits)][1]
            self.counts.changes += 1

    def goal(self) -> bool:
        """Is the goal true now?"""
        return evaluate(self._task.goal, self.values) is Truth.TRUE

    def read(self, variable: str) -> int:
        """The value of a variable, by name."""
        return self.values[self._task.variable_index[variable]]

    def start(self, action: str, runner: Hashable) -> bool:
        """An action starts, and ends at once."""
        results = self._actions[action](self.values)
        result = results[Draw(each.probability for each in results)(self._bits())]
        precondition = self._task.action_by_name[action].precondition
        self.counts.starts += 1
        self.counts.unready += evaluate(precondition, self.values) is not Truth.TRUE
        self.counts.cost += result.cost
        self.values = result.values
        return True

    def running(self, runner: Hashable) -> bool:
        """No action runs on."""
        return False

    def go_on(self, runner: Hashable) -> bool:
        """No action runs on."""
        raise AssertionError("an action is called again that has ended")

    def cancel(self, runner: Hashable) -> None:
        """No action runs on."""
        raise AssertionError("an action is cancelled that has ended")


def perturbed_counts(
    replay: Replay, tree: Tree, rate: Fraction, limits: Limits, *, runs: int, seed: int, most_ticks: int
) -> Counts:
    """What an engine counts in perturbed runs of a tree."""
    world = PerturbedWorld(tree, rate, limits)
    for run in range(runs):
        world.begin(seed, run)
        replay.begin(world)
        for _ in range(most_ticks):
            world.before_tick()
            status = replay.tick()
            if status != "running":
                break
        match status:
            case "running":
                world.counts.cut += 1
            case "success" if world.goal():
                world.counts.successes += 1
            case "success":
                world.counts.missed += 1
            case "failure":
                world.counts.failures += 1
    return world.counts
