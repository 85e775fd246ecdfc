"""What a robot works out of its readings where facts are hidden, copied into modules by bbtc."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Protocol, cast

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bbtc.runtime.nodes import Fact, StopWhenBlocked, in_words
from bbtc.runtime.world import Factor, State, World, draw

Entry = int | bool | None
Rows = dict[tuple[Entry, ...], int]


class Move:
    """What an action may tell. ``rows`` lead from what was believed, the ``seen`` facts before the
    action, the ``readings`` (None: not made), and the seen facts after it, to what is believed
    then."""

    def __init__(self, seen: list[Fact], readings: list[str], rows: Rows) -> None:
        self.seen = seen
        self.readings = readings
        self.rows = rows


class Part:
    """Facts that depend on each other: what is known of them (None: it is unknown) in each belief,
    by number, the belief to begin with, and what each action may tell of them."""

    def __init__(
        self,
        facts: list[Fact],
        values: list[tuple[bool | None, ...]],
        start: int,
        moves: dict[Fact, Move],
    ) -> None:
        self.facts = facts
        self.values = values
        self.start = start
        self.moves = moves


class Monitor:
    """Knows of hidden facts what follows from all that the robot was told. ``see`` tells what the
    robot sees of a fact that is not hidden.

    Call :meth:`told` for every action that tells anything, in the moment in which its effects are
    seen. What cannot be in the model ends that: :attr:`outside` says what it was, and nothing is
    known from then on.
    """

    def __init__(self, parts: list[Part], see: Callable[..., bool | None]) -> None:
        self.outside = ""
        self._parts = parts
        self._see = see
        self._beliefs = [part.start for part in parts]
        self._place: dict[Fact, tuple[int, int]] = {}
        for number, part in enumerate(parts):
            self._place.update((fact, (number, at)) for at, fact in enumerate(part.facts))
        self._before: dict[Fact, list[tuple[bool | None, ...]]] = {}
        self._waits = self.listens()

    def listens(self, *action: str) -> bool:
        """Does the action tell anything? Without an action: is anything told before the first?"""
        return any(action in part.moves for part in self._parts)

    def waits(self) -> bool:
        """Is what the robot is told before its first action still missing?"""
        return self._waits

    def value(self, *fact: str) -> bool | None:
        """What is known of a hidden fact: None if it is unknown."""
        if self.outside:
            return None
        number, at = self._place[fact]
        return self._parts[number].values[self._beliefs[number]][at]

    def known(self) -> State:
        """What is known of every fact."""
        return {fact: self.value(*fact) for fact in self._place}

    def begin(self, *action: str) -> None:
        """The action starts. The tree calls this."""
        if not self.listens(*action):
            return
        for earlier in self._before:
            self._leave(f"{in_words(earlier)} told nothing")
        moves = [part.moves.get(action) for part in self._parts]
        self._before[action] = [
            tuple(self._see(*fact) for fact in move.seen) if move else () for move in moves
        ]

    def told(self, *action: str, readings: Mapping[str, bool | None] | None = None) -> None:
        """What the action told: of each observation that was made, by name, whether it seemed true.
        Seen facts are read now, but for those that stand here, too, by name. Without an action:
        what the robot was told before its first one."""
        if not self.listens(*action):
            return
        told = dict(readings or {})
        name = in_words(action) if action else "what is told at the start"
        before = self._before.pop(action, None)
        if before is None and not (self._waits and not action):
            self._leave(f"{name}: it was not started")
            return
        self._waits = self._waits and action != ()
        used: set[str] = set()
        for number, part in enumerate(self._parts):
            move = part.moves.get(action)
            if move is None:
                continue
            after = [told[in_words(f)] if in_words(f) in told else self._see(*f) for f in move.seen]
            used.update(move.readings, map(in_words, move.seen))
            read = [told.get(reading) for reading in move.readings]
            # Before the first action nothing has changed.
            seen = tuple(after) if before is None else before[number]
            row = move.rows.get((self._beliefs[number], *seen, *read, *after))
            if row is None:
                names = [*move.readings, *map(in_words, move.seen)]
                what = [f"{n} {v}" for n, v in zip(names, [*read, *after], strict=True)]
                self._leave(f"{name}: {', '.join(what) or 'at this point'}")
            else:
                self._beliefs[number] = row
        for reading in told.keys() - used:
            self._leave(f"{name}: it has no reading {reading}")

    def _leave(self, why: str) -> None:
        self.outside = self.outside or f"outside the model: {why}"


class WithMonitor(Protocol):
    """A robot with a monitor."""

    monitor: Monitor

    def cancel(self, action: str) -> None:
        """The running action is no longer wanted."""


def watched(
    robot: WithMonitor, action: Fact, act: Callable[[], Status]
) -> tuple[Callable[[], Status], Callable[[str], None]]:
    """The calls that run and cancel an action, so that the monitor learns when it starts."""
    running = False

    def go_on() -> Status:
        nonlocal running
        if not running:
            robot.monitor.begin(*action)
        running = True
        status = act()
        running = status == Status.RUNNING
        return status

    def cancel(name: str) -> None:
        nonlocal running
        running = False
        robot.cancel(name)

    return go_on, cancel


class StopOutside(StopWhenBlocked):
    """The root of a tree of a robot with a monitor: FAILURE, too, where what happened is outside
    the model. Before its first tick the tree waits for what the robot is told before its first
    action."""

    def __init__(
        self, robot: WithMonitor, child: Behaviour, reads: Mapping[Fact, bool] | None = None
    ) -> None:
        super().__init__(robot, child, reads)
        self._watching = cast("WithMonitor", self._robot)

    def tick(self) -> Iterator[Behaviour]:
        monitor = self._watching.monitor
        if not monitor.outside and not monitor.waits():
            yield from super().tick()
            return
        if monitor.outside:
            self.feedback_message = monitor.outside
            self.stop(Status.FAILURE)
        else:
            self.feedback_message = "waiting for what is told at the start"
            self.status = Status.RUNNING
        yield self


class Telling:
    """An observation of a simulated action: its name, how probably it is right, what it tells of,
    and when it is made (None: always)."""

    def __init__(
        self,
        name: str,
        accuracy: str,
        tells: Callable[[State], bool | None],
        when: Callable[[State], bool | None] | None = None,
    ) -> None:
        self.name = name
        self.accuracy = accuracy
        self.tells = tells
        self.when = when


class Walk:
    """Facts that are drawn one after the other. A turn is the place of its fact, how likely that is true, and
    the turns that come next if it is false, or true (-1: none); the last turn comes first. Facts that no turn
    draws are as likely true as false."""

    def __init__(self, facts: list[Fact], turns: list[tuple[int, str, int, int]]) -> None:
        self.facts = facts
        self.turns = turns

    def __call__(self, rng: random.Random) -> State:
        """What is true."""
        state: State = {}
        at = len(self.turns) - 1
        for place, fact in enumerate(self.facts):
            chance, following = "1/2", (at, at)
            if at >= 0 and self.turns[at][0] == place:
                chance, following = self.turns[at][1], self.turns[at][2:]
            value = draw(rng, [(chance, True), (str(1 - Fraction(chance)), False)])
            state[fact] = value
            at = following[value]
        return state


class HiddenWorld(World):
    """A world with hidden facts: they are drawn at the start, one choice for each of ``priors``,
    and one after the other along ``walks``, and the robot is told no more than ``tellings`` say."""

    def __init__(
        self,
        initial: list[tuple[str, State]],
        actions: dict[Fact, list[Factor]],
        rng: random.Random,
        report: Callable[[str], None],
        *,
        priors: list[list[tuple[str, State]]],
        tellings: dict[Fact, list[Telling]],
        parts: list[Part],
        walks: Iterable[Callable[[random.Random], State]] = (),
    ) -> None:
        super().__init__(initial, actions, rng, report)
        hidden: State = {}
        for prior in priors:
            drawn: State = draw(rng, prior)
            hidden.update(drawn)
        for walk in walks:
            hidden.update(walk(rng))
        self._state.update(hidden)
        self._tellings = tellings
        self.monitor = Monitor(parts, self._value)
        truth = [in_words(fact) for fact, value in hidden.items() if value]
        report(f"the truth: {', '.join(truth) or 'nothing'}")
        self._listen()

    def _act(self, *action: str) -> Status:
        status = super()._act(*action)
        self._listen(*action)
        return status

    def _listen(self, *action: str) -> None:
        if self.monitor.listens(*action):
            readings = {
                telling.name: self._reading(telling)
                for telling in self._tellings.get(action, [])
                if telling.when is None or telling.when(self._state)
            }
            self.monitor.told(*action, readings=readings)
            told = [f"{name} {'true' if value else 'false'}" for name, value in readings.items()]
            self._report(f"  told: {', '.join(told) or 'nothing'}; known: {self._words()}")
        self._state.update(self.monitor.known())

    def _reading(self, telling: Telling) -> bool:
        false = str(1 - Fraction(telling.accuracy))
        right = draw(self._rng, [(telling.accuracy, True), (false, False)])
        return bool(telling.tells(self._state)) == right

    def _words(self) -> str:
        known = [each for each in self.monitor.known().items() if each[1] is not None]
        words = [f"{'' if value else 'not '}{in_words(fact)}" for fact, value in known]
        return self.monitor.outside or ", ".join(words) or "nothing"
