"""Scripts tick by tick: actions that run for many ticks, conditions that change at any moment, and a
tree that is halted from outside; and what an engine did in every tick."""

from __future__ import annotations

import random
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Protocol

from bbtc.ground.task import Task
from bbtc.replay.engines import Replay
from bbtc.replay.script import Values


@dataclass(frozen=True)
class TickScript:
    """``before[t]`` are the values before tick t, ``inside[t]`` those after the call of an action in
    it (None: as before). ``runs[k]`` tells of the k-th action to start in how many ticks it is called
    if nothing stops it, and whether it succeeds then. After the ticks of ``halts`` the tree is halted."""

    before: tuple[Values, ...]
    inside: tuple[Values | None, ...]
    runs: tuple[tuple[int, bool], ...]
    halts: frozenset[int]


@dataclass
class Tick:
    """What happened in a tick, and by halting the tree after it. An action that starts may be told
    before or after the one that it takes the place of is cancelled: the engines differ in that."""

    started: list[str] = field(default_factory=list)
    went_on: list[str] = field(default_factory=list)
    cancelled: list[str] = field(default_factory=list)
    status: str = ""


class TickWorld:
    """Plays a script for any engine, and writes down what it does. See :class:`bbtc.replay.script.World`."""

    def __init__(self, task: Task, script: TickScript) -> None:
        self.ticks: list[Tick] = []
        self.succeeds = True
        self.values: Values = ()
        self._index = task.variable_index
        self._script = script
        self._starts = 0
        self._left: dict[Hashable, tuple[str, int, bool]] = {}

    def next_tick(self) -> None:
        """A tick begins."""
        self.values = self._script.before[len(self.ticks)]
        self.ticks.append(Tick())

    def tick_ended(self, status: str) -> None:
        """The root has returned."""
        self.ticks[-1].status = status
        assert len(self._left) <= 1, "between ticks at most one action runs"

    def read(self, variable: str) -> int:
        """The value of a variable, by name."""
        return self.values[self._index[variable]]

    def start(self, action: str, runner: Hashable) -> bool:
        """An action starts. Whether it has ended at once."""
        assert runner not in self._left
        self.ticks[-1].started.append(action)
        length, succeeds = self._script.runs[self._starts]
        self._starts += 1
        self._left[runner] = (action, length, succeeds)
        return self._called(runner)

    def running(self, runner: Hashable) -> bool:
        """Whether it has started an action that has neither ended nor been cancelled."""
        return runner in self._left

    def go_on(self, runner: Hashable) -> bool:
        """A running action is called again. Whether it has ended now."""
        self.ticks[-1].went_on.append(self._left[runner][0])
        return self._called(runner)

    def cancel(self, runner: Hashable) -> None:
        """A running action is no longer wanted."""
        self.ticks[-1].cancelled.append(self._left.pop(runner)[0])

    def _called(self, runner: Hashable) -> bool:
        action, left, self.succeeds = self._left[runner]
        self.values = self._script.inside[len(self.ticks) - 1] or self.values
        if left == 1:
            del self._left[runner]
            return True
        self._left[runner] = (action, left - 1, self.succeeds)
        return False


class Tracing(Protocol):
    """An engine in another process, which makes traces itself."""

    def trace(self, script: TickScript) -> list[Tick]: ...


def trace(engine: Replay | Tracing, script: TickScript) -> list[Tick]:
    """What happens in every tick of a script in a new tree, until it ends."""
    if not isinstance(engine, Replay):
        return engine.trace(script)
    world = TickWorld(engine.task, script)
    engine.begin(world, haltable=True)
    for number in range(len(script.before)):
        world.next_tick()
        status = engine.tick()
        world.tick_ended(status)
        if status != "running":
            break
        if number in script.halts:
            engine.halt()
    return world.ticks


def random_script(task: Task, rng: random.Random, ticks: int) -> TickScript:
    """Values that change more or less often, between ticks and while an action is called, in a state
    that the task starts in or in any other."""

    def drawn() -> Values:
        return tuple(int(rng.choice(variable.values)) for variable in task.variables)

    def changed(values: Values) -> Values:
        return tuple(new if rng.random() < 0.4 else old for old, new in zip(values, drawn(), strict=True))

    unrest = rng.choice([0.05, 0.3])
    start = tuple(map(int, rng.choice(task.initial).values)) if rng.random() < 0.5 else drawn()
    before: list[Values] = [start]
    inside: list[Values | None] = []
    for _ in range(ticks):
        inside.append(changed(before[-1]) if rng.random() < 0.3 else None)
        last = inside[-1] or before[-1]
        before.append(changed(last) if rng.random() < unrest else last)
    return TickScript(
        tuple(before[:-1]),
        tuple(inside),
        tuple((rng.choice([1, 2, 3, 6]), rng.random() < 0.8) for _ in range(ticks)),
        frozenset(number for number in range(ticks) if rng.random() < 0.05),
    )
