"""Scripted runs: what a world shall do, and what a tree then did in it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

from bbtc.belief.scenarios import Scenario
from bbtc.belief.tick import NodeStatus
from bbtc.ground.task import Task
from bbtc.kleene import Truth

Values = tuple[int, ...]
"""The truth value of every variable, by index (0 false, 1 unknown, 2 true)."""

Timing = Literal["between", "during", "within", "after"]
"""When the outcome of an action lands: between the tick that starts it and the next; during its run, in
the tick after the one that starts it and before the one that ends it; within the tick that starts it,
which also ends it; after its run, that is, after the third tick, in which it says that it has ended."""

TIMINGS: tuple[Timing, ...] = ("between", "during", "within", "after")


Told = tuple[tuple[str, bool], ...]
"""What each observation that was made told, by name."""


@dataclass(frozen=True)
class Script:
    """Where a run starts, and for each action in turn its name and the values after it. ``told``, where facts
    are hidden: what is told before the first action, and by each in turn."""

    initial: Values
    steps: tuple[tuple[str, Values], ...]
    told: tuple[Told, ...] = ()


@dataclass(frozen=True)
class Run:
    """What a tree did: the actions it started, its last status, the values at the end. The status
    is ``cut`` where it started an action that the script does not have, ``endless`` where it
    ticked on although nothing could change any more."""

    actions: tuple[str, ...]
    status: Literal["success", "failure", "cut", "endless"]
    values: Values


def script_of(scenario: Scenario) -> Script:
    """The script of a scenario of the exact simulation."""
    steps = tuple((step.node.action, tuple(step.values)) for step in scenario.steps)
    return Script(tuple(scenario.initial), steps)


def run_of(scenario: Scenario) -> Run:
    """What the exact simulation says the tree does. A blocked tree ends in failure."""
    return Run(
        tuple(step.node.action for step in scenario.steps),
        "success" if scenario.status is NodeStatus.SUCCESS else "failure",
        tuple(scenario.final),
    )


class OffScript(Exception):
    """The tree started an action that the script does not have at this place."""


class Watch(Protocol):
    """A monitor of exported code: what follows from readings. Actions are named by words; what is told before
    the first by none."""

    @property
    def outside(self) -> str: ...

    def begin(self, *action: str) -> None: ...

    def told(self, *action: str, readings: Mapping[str, bool | None] | None = None) -> None: ...

    def value(self, *fact: str) -> bool | None: ...


class World(Protocol):
    """What the nodes of an engine call: conditions :meth:`read`, actions :meth:`start`, then
    :meth:`go_on` until that says that they ended, in success or not; or else :meth:`cancel`."""

    succeeds: bool

    def read(self, variable: str) -> int: ...

    def start(self, action: str, runner: Hashable) -> bool: ...

    def running(self, runner: Hashable) -> bool: ...

    def go_on(self, runner: Hashable) -> bool: ...

    def cancel(self, runner: Hashable) -> None: ...


class ScriptedWorld:
    """Plays a script for any engine, whose loop calls :meth:`between_ticks`."""

    def __init__(self, task: Task, script: Script, timing: Timing) -> None:
        self.task = task
        self.values = script.initial
        self.monitor: Watch | None = None
        self.known: frozenset[int] = frozenset()
        self._starts_are_told = True
        self.actions: list[str] = []
        self.cancelled: list[str] = []
        self.timing = timing
        self.succeeds = True
        self._index = task.variable_index
        self._script = script
        self._pending: Values | None = None
        self._ended = False
        self._ticks_run: dict[Hashable, int] = {}
        self._action_of: dict[Hashable, str] = {}

    def read(self, variable: str) -> int:
        """The value of a variable, by name. What is known of what is hidden the monitor tells."""
        index = self._index[variable]
        if self.monitor is None or index not in self.known:
            return self.values[index]
        read = self.task.variables[index]
        value = self.monitor.value(read.predicate, *read.args)
        return Truth.UNKNOWN if value is None else Truth.of(value)

    def watch(self, monitor: Watch, known: frozenset[int], *, starts: bool) -> None:
        """From now on, a monitor is told what the script tells, and asked what is ``known``; it is told of
        starts, too, unless the tree does that."""
        self.monitor, self.known, self._starts_are_told = monitor, known, starts
        self._tell(0)

    @property
    def told_values(self) -> Values:
        """The value of every variable, as the tree reads it."""
        return tuple(self.read(variable.name) for variable in self.task.variables[: len(self.values)])

    def _words(self, action: str) -> tuple[str, ...]:
        if not action:
            return ()
        ground = self.task.action_by_name[action]
        return (ground.schema, *ground.args)

    def _tell(self, step: int) -> None:
        if self.monitor is not None and self._script.told:
            action = self._script.steps[step - 1][0] if step else ""
            self.monitor.told(*self._words(action), readings=dict(self._script.told[step]))

    def start(self, action: str, runner: Hashable) -> bool:
        """An action starts; ``runner`` identifies who runs it. Whether it has ended at once."""
        step = len(self.actions)
        self.actions.append(action)
        if step >= len(self._script.steps) or self._script.steps[step][0] != action:
            raise OffScript
        after = self._script.steps[step][1]
        if self.monitor is not None and self._starts_are_told:
            self.monitor.begin(*self._words(action))
        if self.timing == "within":
            self.values = after
            self._tell(step + 1)
            return True
        self._pending = after
        self._ended = False
        self._ticks_run[runner] = 1
        self._action_of[runner] = action
        return False

    def running(self, runner: Hashable) -> bool:
        """Whether it has started an action that has neither ended nor been cancelled."""
        return runner in self._ticks_run

    def go_on(self, runner: Hashable) -> bool:
        """A running action is ticked again. Whether it has ended now."""
        ticks = self._ticks_run[runner] = self._ticks_run[runner] + 1
        if self.timing == "during" and ticks == 2 and self._pending is not None:
            self._land()
        if ticks < (2 if self.timing == "between" else 3):
            return False
        self._ended = True
        del self._ticks_run[runner]
        return True

    def cancel(self, runner: Hashable) -> None:
        """A running action is no longer wanted."""
        assert runner in self._ticks_run, "only what runs is cancelled"
        self.cancelled.append(self._action_of[runner])
        del self._ticks_run[runner]

    def between_ticks(self) -> None:
        """The engine has finished a tick."""
        lands = self.timing == "between" or (self.timing == "after" and self._ended)
        if lands and self._pending is not None:
            self._land()

    def _land(self) -> None:
        assert self._pending is not None
        self.values, self._pending = self._pending, None
        self._tell(len(self.actions))

    def most_ticks(self) -> int:
        """No tree that is right needs more ticks than this."""
        return 6 * len(self._script.steps) + 6
