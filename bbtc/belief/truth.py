"""What is true in a run where facts are hidden: a world for each component, drawn along, so that what the
robot is told follows from it."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from bbtc.belief.draws import Values, unbounded
from bbtc.belief.hidden import Readings, beliefs_of, case_of, number_in
from bbtc.ground.hidden.given import given_worlds
from bbtc.ground.task import ONE, ZERO, Change, Task
from bbtc.markov import distribution

Worlds = tuple[int, ...]
"""The world of every component."""


class _Option(NamedTuple):
    """What a change may come to in a world: the world after, and its probability."""

    world: int
    probability: Fraction


@dataclass(slots=True)
class HiddenTruth:
    """Draws worlds for the states of runs of a task. What is drawn depends on the seed, on the number of the
    step and on what it begins from alone."""

    task: Task
    seed: int = 0
    _readings: dict[tuple[str, int], Readings] = field(default_factory=dict)

    def first(self, values: Values) -> Worlds:
        """The worlds of an initial state, or of any other."""
        return tuple(self._drawn(values, component, 0) for component in range(len(self.task.components)))

    def given(self) -> Worlds | None:
        """The worlds that a run begins in, drawn among those that the problem gives; None where it gives
        none."""
        every = given_worlds(self.task)
        if not every:
            return None
        picked = self._pick(((number, ONE) for number in range(len(every))), "given")
        return tuple(
            beliefs.pick(beliefs.prior, self._point(f"given:{at}"))
            if found is None
            else self._pick(found.items(), f"given:{at}")
            for at, (beliefs, found) in enumerate(
                zip(map(beliefs_of, self.task.components), every[picked], strict=True)
            )
        )

    def begins(self, values: Values, worlds: Worlds) -> Fraction:
        """How much more probable an initial state is in these worlds than as far as is known, by what the
        robot is told at first."""
        before, chance = bytearray(values), ONE
        for component in self.task.components:
            for each in component.known:
                before[each.variable] = self.task.initial[0].values[each.variable]
        for number, (component, world) in enumerate(zip(self.task.components, worlds, strict=True)):
            change = Change(number, component.seen, (), component.first)
            case = beliefs_of(component).prior, bytes(before[variable] for variable in change.seen)
            readings, told = Readings(self.task, change, unbounded), number_in(self.task, values, number)
            fits = sum((p for _, belief, _, p in readings.in_world(*case, world) if belief == told), ZERO)
            known = (each.probability for each in readings.after(*case) if each.belief == told)
            chance *= fits / sum(known, ZERO)
        return chance

    def chance(self, action: str, values: Values, worlds: Worlds, after: Values) -> Fraction:
        """How much more probable it is in these worlds than as far as is known, that an action leads from one
        state to another."""
        chance = ONE
        for change in self.task.action_by_name[action].changes:
            fits = sum(option.probability for option in self._options(action, change, values, worlds, after))
            known = sum(
                reading.probability
                for reading in self._of(action, change).after(*case_of(self.task, change, values))
                if self._same(change, values, after, reading.shown, reading.belief)
            )
            if not known:
                return Fraction(0)
            chance *= Fraction(fits) / known
        return chance

    def after(self, action: str, values: Values, worlds: Worlds, after: Values, step: int) -> Worlds:
        """The worlds after an action that led from one state to another; drawn anew where that could not be
        in these."""
        found = list(worlds)
        for change in self.task.action_by_name[action].changes:
            options = distribution(self._options(action, change, values, worlds, after))
            component = change.component
            if options:
                found[component] = self._pick(options.items(), f"{step}:{component}")
            else:
                found[component] = self._drawn(after, component, step)
        return tuple(found)

    def facts(self, worlds: Worlds) -> list[str]:
        """The hidden facts that are true."""
        return [
            fact
            for world, component in zip(worlds, self.task.components, strict=True)
            for bit, fact in enumerate(component.facts)
            if world >> bit & 1
        ]

    def _drawn(self, values: Values, component: int, step: int) -> int:
        beliefs = beliefs_of(self.task.components[component])
        return beliefs.pick(number_in(self.task, values, component), self._point(f"{step}:{component}"))

    def _pick(self, options: Iterable[tuple[int, Fraction]], what: str) -> int:
        listed = sorted(options)
        point = self._point(what) * sum(weight for _, weight in listed)
        for world, weight in listed:
            point -= weight
            if point < 0:
                return world
        return listed[-1][0]

    def _point(self, what: str) -> Fraction:
        return Fraction(random.Random(f"{self.seed}:truth:{what}").getrandbits(64), 1 << 64)

    def _options(
        self, action: str, change: Change, values: Values, worlds: Worlds, after: Values
    ) -> list[_Option]:
        """What the change may come to, so that it leads from one state to the other."""
        readings = self._of(action, change)
        world = worlds[change.component]
        return [
            _Option(then, probability)
            for shown, belief, then, probability in readings.in_world(
                *case_of(self.task, change, values), world
            )
            if self._same(change, values, after, shown, belief)
        ]

    def _of(self, action: str, change: Change) -> Readings:
        key = action, change.component
        if key not in self._readings:
            self._readings[key] = Readings(self.task, change, unbounded)
        return self._readings[key]

    def _same(
        self, change: Change, values: Values, after: Values, shown: Sequence[tuple[int, int]], belief: int
    ) -> bool:
        then = {variable: values[variable] for variable in change.seen}
        then.update((change.seen[at], value) for at, value in shown)
        return belief == number_in(self.task, after, change.component) and all(
            after[variable] == value for variable, value in then.items()
        )
