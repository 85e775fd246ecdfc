"""The best that any policy attains in a world that others change: backward induction from the last tick.

A policy that may go on for ever waits, by doing something useless, until somebody puts right what went wrong;
in the undisturbed world it would never end. One that gives up ends where the goal is out of reach of the
model's actions. Only what a change may lead to is taken from bbtc, which has tests of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from tests.disturbance.reference import State, best_chances, outcomes_in
from tests.replay.reference import value_of

Floats = npt.NDArray[np.float64]


class _Step:
    """Chances of states after each of some rows."""

    def __init__(self, rows: Iterable[list[tuple[float, int]]]) -> None:
        entries = [(row, chance, after) for row, each in enumerate(rows) for chance, after in each]
        self.row = np.array([entry[0] for entry in entries])
        self.chance = np.array([entry[1] for entry in entries])
        self.after = np.array([entry[2] for entry in entries])
        self.count = 1 + max(self.row)

    def expected(self, values: Floats) -> Floats:
        """The mean of the values after each row."""
        means: Floats = np.zeros(self.count)
        np.add.at(means, self.row, self.chance * values[self.after])
        return means


class DisturbedTask:
    """A task in a world where changes may happen; all states that actions and changes lead to."""

    def __init__(self, task: Task) -> None:
        facts = ChangingFacts.of(task, Limits())
        self._number: dict[State, int] = {}
        self._states: list[State] = []
        self._starts = [
            (float(each.probability), self._of(tuple(map(int, each.values)))) for each in task.initial
        ]
        changes: list[list[tuple[float, int]]] = []
        choices: list[list[tuple[float, int]]] = []
        owners: list[int] = []
        for number, state in enumerate(self._states):  # grows
            found = facts.changes(bytes(state))
            changes.append([(float(p), self._of(tuple(after))) for p, after in found] or [(1.0, number)])
            for action in task.actions:
                if value_of(action.precondition, state) == "T":
                    owners.append(number)
                    results = outcomes_in(action, state).items()
                    choices.append([(float(p), self._of(after)) for (after, _), p in results])
        self._changed, self._acted = _Step(changes), _Step(choices)
        self._owners = np.array(owners)
        chances = best_chances(task, set(self._states))
        self._goal = np.array([value_of(task.goal, state) == "T" for state in self._states])
        self._hopeless = np.array([not chances[state] for state in self._states])

    def _of(self, state: State) -> int:
        if state not in self._number:
            self._number[state] = len(self._states)
            self._states.append(state)
        return self._number[state]

    def best(self, rate: Fraction, ticks: int, *, gives_up: bool) -> float:
        """The best success probability within so many ticks, of policies that wait, or that give up."""
        values = self._goal.astype(float)
        for _ in range(ticks):
            before = float(1 - rate) * values + float(rate) * self._changed.expected(values)
            acted = np.zeros(len(values))
            np.maximum.at(acted, self._owners, self._acted.expected(before))
            acted[self._goal] = 1.0
            if gives_up:
                acted[self._hopeless] = 0.0
            values = acted
        before = float(1 - rate) * values + float(rate) * self._changed.expected(values)
        return float(sum(chance * before[number] for chance, number in self._starts))
