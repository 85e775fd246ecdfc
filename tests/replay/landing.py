"""Effects that land one by one, at any moment of a run of three ticks, in any order."""

from __future__ import annotations

import itertools
import random
from collections.abc import Hashable, Iterator, Mapping, Sequence

from bbtc.ground.task import Task
from bbtc.replay.script import Script, ScriptedWorld
from tests.replay.reference import set_by

MOMENTS = 6
"""In the call that starts the action, after that tick, in the next call, after that, in the call that ends
it, and after that, before the next tick."""

LAST = MOMENTS - 1

Landing = Mapping[int, int]
"""By variable that an action changes: at which moment it shows."""


class LandingWorld(ScriptedWorld):
    """Plays a script in which every action takes three ticks; ``landings`` tell of each when its effects
    show."""

    def __init__(self, task: Task, script: Script, landings: Sequence[Landing]) -> None:
        super().__init__(task, script, "after")
        self._landings = landings
        self._moment = LAST

    def start(self, action: str, runner: Hashable) -> bool:
        assert self._pending is None, "the last action has been done"
        super().start(action, runner)
        self._show(0)
        return False

    def go_on(self, runner: Hashable) -> bool:
        ticks = self._ticks_run[runner] = self._ticks_run[runner] + 1
        self._show(2 * ticks - 2)
        if ticks < 3:
            return False
        del self._ticks_run[runner]
        return True

    def between_ticks(self) -> None:
        if self._pending is not None:
            self._show(self._moment + 1)

    def _show(self, moment: int) -> None:
        assert self._pending is not None
        self._moment = moment
        landing = self._landings[len(self.actions) - 1]
        values = zip(self.values, self._pending, strict=True)
        self.values = tuple(
            new if landing.get(index, moment + 1) <= moment else old
            for index, (old, new) in enumerate(values)
        )
        if moment == LAST:
            assert self.values == self._pending
            self._pending = None


def every_landing(task: Task, script: Script, most: int, rng: random.Random) -> Iterator[list[Landing]]:
    """How the effects of a script may land: first all that becomes false before all that becomes true, the
    other way round, and then up to ``most`` of the ways there are, each step going through its own: all of
    them, if none has more. What the action does not set itself shows when it is over."""
    steps = list(_changes(task, script))
    yield [{v: 0 if new == 0 else LAST for v, (new, own) in step.items()} | _others(step) for step in steps]
    yield [{v: LAST if new == 0 else 0 for v, (new, own) in step.items()} | _others(step) for step in steps]
    ways = [_ways(step, most, rng) for step in steps]
    for number in range(min(most, max(map(len, ways), default=0))):
        yield [way[number % len(way)] for way in ways]


def _ways(step: Mapping[int, tuple[int, bool]], most: int, rng: random.Random) -> list[Landing]:
    own = [variable for variable, (_, is_own) in step.items() if is_own]
    if MOMENTS ** len(own) <= most:
        moments: Iterator[tuple[int, ...]] = itertools.product(range(MOMENTS), repeat=len(own))
    else:
        moments = (tuple(rng.randrange(MOMENTS) for _ in own) for _ in range(most))
    found: list[Landing] = [dict(zip(own, each, strict=True)) | _others(step) for each in moments]
    rng.shuffle(found)
    return found


def _others(step: Mapping[int, tuple[int, bool]]) -> dict[int, int]:
    return {variable: LAST for variable, (_, is_own) in step.items() if not is_own}


def _changes(task: Task, script: Script) -> Iterator[dict[int, tuple[int, bool]]]:
    """By variable that each step changes: its new value, and whether the action may set it."""
    before = script.initial
    for action, after in script.steps:
        own = set_by(task, task.action_by_name[action])
        pairs = enumerate(zip(before, after, strict=True))
        yield {index: (int(new), index in own) for index, (old, new) in pairs if old != new}
        before = after
