"""A simulated world in which things happen by themselves, copied into the modules that bbtc writes."""

from __future__ import annotations

import random
from collections.abc import Callable

from py_trees.common import Status

from bbtc.runtime.nodes import Fact, in_words
from bbtc.runtime.world import Factor, State, World, happen

Test = Callable[[State], bool | None]
Rounds = list[list[tuple[Test, list[Factor]]]]


class MovingWorld(World):
    """A world with events. ``events`` are, for each action, those of each round: where one may happen, and
    what it does. Of the actions that events may end: while what they go on, and what happens else."""

    def __init__(
        self,
        initial: list[tuple[str, State]],
        actions: dict[Fact, list[Factor]],
        rng: random.Random,
        report: Callable[[str], None],
        *,
        events: dict[Fact, Rounds],
        interrupted: dict[Fact, tuple[Test, list[Factor]]],
    ) -> None:
        super().__init__(initial, actions, rng, report)
        self._events = events
        self._interrupted = interrupted

    def _act(self, *action: str) -> Status:
        if action not in self._interrupted:
            status = super()._act(*action)
            self._happen(*action)
            return status
        self._happen(*action)
        goes_on, abort = self._interrupted[action]
        if goes_on(self._state) is True:
            return super()._act(*action)
        self._state.update(happen(self._rng, abort, self._state))
        self._report(f"{in_words(action)}: aborted")
        return Status.SUCCESS

    def _happen(self, *action: str) -> None:
        """The events of one draw: those of a round all read the state that it begins with."""
        for events in self._events[action]:
            due = [factors for test, factors in events if test(self._state) is True]
            changes = happen(self._rng, [factor for factors in due for factor in factors], self._state)
            words = {True: "true", False: "false", None: "unknown"}
            told = [
                f"{in_words(fact)} {words[value]}"
                for fact, value in changes.items()
                if value != self._state[fact]
            ]
            self._state.update(changes)
            if told:
                self._report(f"by itself: {', '.join(told)}")
