"""Whole numbers in the modules that bbtc writes: what conditions ask of them, and how a simulated world and
a robot's beliefs keep them."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from py_trees.blackboard import Blackboard
from py_trees.common import Status

from bbtc.runtime.beliefs import Beliefs
from bbtc.runtime.moving import MovingWorld
from bbtc.runtime.nodes import Fact, in_words
from bbtc.runtime.world import Factor, Outcome, State, When, World, happen

Values = dict[Fact, Any]


def between(value: int | None, low: int | None, high: int | None) -> bool | None:
    """Whether a number is no less than one and no more than another; None where it is unknown."""
    if value is None:
        return None
    return (low is None or low <= value) and (high is None or value <= high)


class Shift(When):
    """Adds to a number, no further than to the bounds of its range, if a condition is True in the
    state before the action."""

    def __init__(
        self,
        fact: Fact,
        amount: int,
        low: int,
        high: int,
        condition: Callable[[State], bool | None] = lambda _: True,
    ) -> None:
        super().__init__(condition, {})
        self.fact = fact
        self.amount = amount
        self.low = low
        self.high = high

    def on(self, before: Values) -> When:
        """What it comes to in a state."""
        value = min(max(before[self.fact] + self.amount, self.low), self.high)
        changes: Values = {self.fact: value}
        return When(self.condition, changes)


def on_numbers(factors: list[Factor], before: Values) -> list[Factor]:
    """Factors in which numbers get the values that they come to in a state."""
    return [
        [
            Outcome(
                outcome.probability,
                outcome.changes,
                *(part.on(before) if isinstance(part, Shift) else part for part in outcome.conditional),
                then=on_numbers(outcome.then, before),
            )
            for outcome in factor
        ]
        for factor in factors
    ]


def number_changes(rng: random.Random, factors: list[Factor], before: State) -> Values:
    """What an action or an event changes, numbers included."""
    changes: Values = happen(rng, on_numbers(factors, before), before)
    return changes


def said(value: Any) -> str:
    """A value in words."""
    if value is None:
        return "unknown"
    return str(value).lower()


def in_short(changes: Values, before: State) -> str:
    """What differs from the state before, in words."""
    kept: Values = before
    return ", ".join(
        f"{in_words(fact)} {said(value)}" for fact, value in changes.items() if value != kept[fact]
    )


class NumberWorld(World):
    """A world with numbers among its facts."""

    def _number(self, *fact: str) -> int:
        state: Values = self._state
        value: int = state[fact]
        return value

    def _act(self, *action: str) -> Status:
        changes = number_changes(self._rng, self._actions[action], self._state)
        told = in_short(changes, self._state)
        self._state.update(changes)
        self._report(f"{in_words(action)}: {told or 'no change'}")
        return Status.SUCCESS


class MovingNumberWorld(MovingWorld):
    """A world with numbers among its facts, and with events."""

    def _number(self, *fact: str) -> int:
        state: Values = self._state
        value: int = state[fact]
        return value

    def _act(self, *action: str) -> Status:
        if action not in self._interrupted:
            self._change(action, self._actions[action], "no change")
            self._happen(*action)
            return Status.SUCCESS
        self._happen(*action)
        goes_on, abort = self._interrupted[action]
        if goes_on(self._state) is True:
            self._change(action, self._actions[action], "no change")
        else:
            self._change(action, abort, "aborted")
        return Status.SUCCESS

    def _change(self, action: Fact, factors: list[Factor], otherwise: str) -> None:
        changes = number_changes(self._rng, factors, self._state)
        told = in_short(changes, self._state)
        self._state.update(changes)
        self._report(f"{in_words(action)}: {told or otherwise}")

    def _happen(self, *action: str) -> None:
        for events in self._events[action]:
            due = [factors for test, factors in events if test(self._state) is True]
            factors = [factor for each in due for factor in each]
            changes = number_changes(self._rng, factors, self._state)
            told = in_short(changes, self._state)
            self._state.update(changes)
            if told:
                self._report(f"by itself: {told}")


class NumberBeliefs(Beliefs):
    """Beliefs of numbers, too."""

    def number(self, *fact: str) -> int | None:
        """What is believed of a number; None if nothing is."""
        try:
            value = Blackboard.get(self.key(*fact))
        except KeyError:
            return None
        if value is None or (isinstance(value, int) and not isinstance(value, bool)):
            return value
        raise TypeError(f"{self.key(*fact)} is {value!r}, not a whole number or None")

    def heard_of(self, *fact: str, unknown: bool = True) -> bool:
        """Whether anything was believed of a fact or a number yet, known or, where ``unknown`` will
        do, unknown."""
        key = self.key(*fact)
        return Blackboard.exists(key) and (unknown or Blackboard.get(key) is not None)

    def count(self, value: int | None, *fact: str) -> None:
        """From now on, this is believed of a number."""
        Blackboard.set(self.key(*fact), value)
