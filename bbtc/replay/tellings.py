"""What a robot is told in the runs of a tree where facts are hidden, as scripts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bbtc.belief.draws import Values, unbounded
from bbtc.belief.hidden import Readings, beliefs_of, number_in
from bbtc.belief.monitored import ObservationNames, changes_of, with_hidden
from bbtc.belief.scenarios import Scenario
from bbtc.ground.task import Change, Task, effects_of
from bbtc.kleene import Truth
from bbtc.replay.script import Run, Script, Told, script_of
from bbtc.tree.monitor import FIRST
from bbtc.tree.nodes import Tree


class Tellings:
    """Readings for the runs of a tree, of its task with hidden facts; ``exported`` is the tree with its
    monitor. Where several readings lead to the same belief, it is now one, now another."""

    def __init__(self, task: Task, exported: Tree) -> None:
        assert exported.monitor is not None
        self._task = task = with_hidden(task)
        self._wanted = exported.monitor.readings
        self._names = ObservationNames(task)
        self._length = len(task.variables)
        self._readings: dict[tuple[str, int], Readings] = {}

    def run(self, run: Run) -> Run:
        """A run as a world of variables alone knows it."""
        return replace(run, values=run.values[: self._length])

    def script(self, scenario: Scenario) -> Script:
        """The script of a scenario, with what is told."""
        script = script_of(scenario)
        told = [self._told(FIRST, None, bytes(scenario.initial), 0)]
        before = bytes(scenario.initial)
        for number, step in enumerate(scenario.steps, 1):
            told.append(self._told(step.node.action, before, bytes(step.values), number))
            before = bytes(step.values)
        steps = tuple((action, values[: self._length]) for action, values in script.steps)
        return Script(script.initial[: self._length], steps, tuple(told))

    def _told(self, action: str, before: Values | None, after: Values, turn: int) -> Told:
        """What an action told, that led from one state to another."""
        found: list[tuple[str, bool]] = []
        for change in changes_of(self._task, action):
            names = self._names.of(action, change.component)
            options = sorted(set(self._possible(action, change, before, after)))
            wanted = self._wanted.get(action, ())
            told = options[turn % len(options)]
            found += [(names[at], bool(value)) for at, value in told if names[at] in wanted]
        return tuple(found)

    def _possible(
        self, action: str, change: Change, before: Values | None, after: Values
    ) -> Iterator[tuple[tuple[int, int], ...]]:
        component = change.component
        if before is None:
            number = beliefs_of(self._task.components[component]).prior
            before = after
        else:
            number = number_in(self._task, before, component)
        key = action, component
        if key not in self._readings:
            self._readings[key] = Readings(self._task, change, unbounded)
        seen = bytes(before[variable] for variable in change.seen)
        # What the action sets besides is not told of here; where both do, the greatest of the values wins.
        drawn = self._task.action_by_name[action].factors if action != FIRST else ()
        besides = {variable for effect in effects_of(drawn) for variable, _ in effect.sets}
        for reading in self._readings[key].after(number, seen):
            shown = dict(reading.shown)
            if reading.belief == number_in(self._task, after, component) and all(
                after[variable] >= shown.get(at, Truth.FALSE)
                if variable in besides
                else after[variable] == shown.get(at, seen[at])
                for at, variable in enumerate(change.seen)
            ):
                yield reading.told
