"""A task with hidden facts as a partially observable Markov decision process (POMDP) in arrays of
floating-point numbers.

A *class* is what a robot sees apart from what it works out: an assignment to the task's variables that tell
of no knowledge. Its *worlds* are what may be true of the hidden facts then. A belief is a class with weights
of its worlds. What an action does is a matrix for each thing that the robot may be told: it makes of the
weights those of the worlds after, not normalized.

An action applies in a belief if it does in each of its worlds: a robot that knows more can do more, and the
best probability is a convex function of the weights. So it is where conditions ask that something is known;
what they ask to be unknown, or only believed, counts as met here, which may make P* greater, but seldom does:
who knows already need not look. Disjunctions are spelled out, an action for each part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import numpy as np

from bbtc.belief.draws import Values, compile_factor, product_of
from bbtc.belief.hidden import Readings, belief_in
from bbtc.belief.state import Bounded, initial_belief
from bbtc.belief.worlds.kernel import local_values
from bbtc.ground.condition import Condition, Is, compile_condition, negation
from bbtc.ground.task import NO_CHANGE, Observation, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.markov import independent
from bbtc.planner.mdp.fully_observable import reads_knowledge
from bbtc.planner.mdp.graph import Floats, sums
from bbtc.planner.mdp.packing import Cube, Flags, Packing, bit_test, cubes
from bbtc.planner.mdp.transitions import MOST_CUBES, Index

_World: TypeAlias = tuple[int, ...]
"""A world of each component."""
_Told: TypeAlias = tuple[int, tuple[object, ...]]
"""What tells one reading from another: the class after, and what observations told."""


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What an action does to the weights of worlds where the robot is told one of the things that it may be
    told: the class ``after`` and its number of worlds; edges, each from a world (``source``) to another
    (``target``), with the probability that the action leads there and this is told."""

    after: int
    worlds: int
    source: Index
    target: Index
    probability: Floats

    def weights(self, weights: Floats) -> Floats:
        """The weights after."""
        return sums(self.target, weights[self.source] * self.probability, self.worlds)

    def worth(self, values: Floats, worlds: int) -> Floats:
        """What the ``worlds`` worlds before are worth each, given what those after are."""
        return sums(self.source, self.probability * values[self.target], worlds)


@dataclass(frozen=True, slots=True, eq=False)
class Doing:
    """An action in a class: its number in the task, the worlds in which it applies, and all that the robot
    may be told."""

    action: int
    applies: Flags
    told: tuple[Told, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Class:
    """How many worlds are possible where the same is seen, what can be done, and for each part of the goal (a
    disjunction) the worlds in which it is met."""

    worlds: int
    doings: tuple[Doing, ...]
    goals: tuple[Flags, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Pomdp:
    """The process of a task. ``initial`` is what a run may begin with: a probability, the class and the
    weights, which sum to 1."""

    task: Task
    classes: tuple[Class, ...]
    initial: tuple[tuple[Fraction, int, Floats], ...]
    _numbers: dict[Values, int]
    _worlds: list[dict[_World, int]]
    _unseen: tuple[int, ...]

    def belief(self, values: Values) -> tuple[int, Floats]:
        """The class and the weights of a state of the task."""
        number = self._numbers[_seen_in(self.task, values, self._unseen)]
        worlds = self._worlds[number]
        weights = {worlds[world]: p for world, p in _possible(self.task, values)}
        return number, _dense(weights, len(worlds))


def pomdp_of(task: Task, limits: Limits) -> Pomdp | None:
    """The task as such a process. None where conditions are too large a disjunction, where effects read what
    is known, and where there are worlds that are not listed. Raises ``LimitReached`` where it has more worlds
    than the limit on states, or where it takes too long."""
    if reads_knowledge(task) or any(component.diagram is not None for component in task.components):
        return None
    told = _told_always(task)
    known = _Known.of(task, told)
    parts = [known.parts(action.precondition) for action in task.actions]
    goals = known.parts(task.goal)
    if goals is None or any(part is None for part in parts):
        return None
    return _Maker(task, limits, [part for part in parts if part is not None], goals, told).made()


# --- conditions --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of a disjunction: what is seen, as bits, and of components, by number, what is true in every
    world."""

    seen: Cube
    true: tuple[tuple[int, Condition], ...]


@dataclass(frozen=True, slots=True)
class _Known:
    """The variables that tell what is known, with the component and condition that each tells of; None for
    one that tells what is only believed."""

    packing: Packing
    of_what: dict[int, tuple[int, Condition] | None]

    @classmethod
    def of(cls, task: Task, told: Mapping[int, tuple[int, int]]) -> _Known:
        found: dict[int, tuple[int, Condition] | None] = {}
        for number, component in enumerate(task.components):
            for each in component.known:
                if each.variable in told:
                    continue
                found[each.variable] = (number, each.condition) if each.at_least == 1 else None
        return cls(Packing.of(task), found)

    def parts(self, condition: Condition) -> list[_Part] | None:
        """The condition as a disjunction, spelled out; None where that is not possible."""
        found: list[_Part] = []
        spelled = cubes(bit_test(self.packing, condition), MOST_CUBES)
        for cube in spelled or ():
            found += self._part(cube)
        return found if spelled is not None and len(found) <= MOST_CUBES else None

    def _part(self, cube: Cube) -> list[_Part]:
        mask, value = cube.mask, cube.value
        choices: list[list[tuple[int, Condition]]] = []
        for variable, what in self.of_what.items():
            bits = self.packing.bits(variable)
            asked, true = mask & bits, 1 << variable
            mask &= ~bits
            if what is None or not asked or value & bits & ~true:
                continue  # nothing is asked, or what counts as met
            number, condition = what
            if value & true:
                choices.append([(number, condition)])
            elif asked == bits:
                choices.append([(number, negation(condition))])
            elif asked & true == 0:  # known, whichever it is
                choices.append([(number, condition), (number, negation(condition))])
        return [_Part(Cube(mask, value & mask), drawn) for drawn in product(*choices)]


def _told_always(task: Task) -> dict[int, tuple[int, int]]:
    """The variables that tell of a single hidden fact (its component, and its number there) which the robot
    is told after whatever may have changed it, and at first: it sees it."""
    found: dict[int, tuple[int, int]] = {}
    changes = [change for action in task.actions for change in action.changes]
    for number, component in enumerate(task.components):
        told = [change.observations for change in changes if change.component == number]
        for each in component.known:
            fact = next(
                (at for at in range(len(component.facts)) if each.condition == Is(at, Truth.TRUE)), None
            )
            if fact is None or each.at_least != 1:
                continue
            first = len({world >> fact & 1 for world, _ in component.prior}) == 1
            tells = Observation(each.condition)
            if (first or tells in component.first) and all(tells in each for each in told):
                found[each.variable] = number, fact
    return found


# --- the arrays --------------------------------------------------------------------------------


@dataclass(slots=True)
class _Edges:
    """What an action does in a class, while worlds are found: by what is told, edges with probabilities."""

    applies: set[int] = field(default_factory=set)
    told: dict[_Told, dict[tuple[int, int], Fraction]] = field(default_factory=dict)

    def doing(self, action: int, number: int, sizes: list[int]) -> Doing:
        applies = np.zeros(sizes[number], dtype=np.bool_)
        applies[list(self.applies)] = True
        told = []
        for (after, _), edges in self.told.items():
            ends = np.array(list(edges), dtype=np.int64).reshape(-1, 2)
            probability = np.array([float(p) for p in edges.values()])
            told.append(Told(after, sizes[after], ends[:, 0].copy(), ends[:, 1].copy(), probability))
        return Doing(action, applies, tuple(told))


class _Maker:
    def __init__(
        self,
        task: Task,
        limits: Limits,
        parts: list[list[_Part]],
        goals: list[_Part],
        told: Mapping[int, tuple[int, int]],
    ) -> None:
        self._task, self._limits = task, limits
        self._packing = Packing.of(task)
        self._bounded = Bounded(limits)
        self._goals = goals
        self._doings = [(number, part) for number, each in enumerate(parts) for part in each]
        knowledge = [each.variable for component in task.components for each in component.known]
        self._told = told
        self._unseen = tuple(variable for variable in knowledge if variable not in told)
        self._classes: dict[Values, int] = {}
        self._seen: list[Values] = []
        self._worlds: list[dict[_World, int]] = []
        self._waiting: list[tuple[int, _World]] = []
        self._drawers = [
            [compile_factor(factor, self._bounded.spend) for factor in action.factors if factor != NO_CHANGE]
            for action in task.actions
        ]
        self._changes = [
            [(change, Readings(task, change, self._bounded.spend)) for change in action.changes]
            for action in task.actions
        ]
        self._tests: dict[tuple[int, Condition, int], bool] = {}

    def made(self) -> Pomdp:
        initial = []
        for values, probability in initial_belief(self._task).items():
            number = self._class(values)
            weights = {self._world(number, world): p for world, p in _possible(self._task, values)}
            initial.append((probability, number, weights))
        edges: dict[int, dict[int, _Edges]] = {}
        done = 0
        while done < len(self._waiting):
            self._limits.check_states(len(self._waiting), "exploration")
            number, world = self._waiting[done]
            self._expand(number, world, edges.setdefault(number, {}))
            done += 1
        sizes = [len(worlds) for worlds in self._worlds]
        classes = tuple(
            Class(
                sizes[number],
                tuple(
                    each.doing(self._doings[place][0], number, sizes)
                    for place, each in sorted(edges.get(number, {}).items())
                ),
                tuple(self._met(number, goal) for goal in self._goals if self._fits(values, goal)),
            )
            for values, number in self._classes.items()
        )
        first = tuple((p, at, _dense(found, sizes[at])) for p, at, found in initial)
        return Pomdp(self._task, classes, first, self._classes, self._worlds, self._unseen)

    def _class(self, values: Values) -> int:
        """The number of the class of a state."""
        seen = _seen_in(self._task, values, self._unseen)
        found = self._classes.setdefault(seen, len(self._classes))
        if found == len(self._worlds):
            self._worlds.append({})
            self._seen.append(seen)
        return found

    def _world(self, number: int, world: _World) -> int:
        """The number of a world of a class."""
        worlds = self._worlds[number]
        if world not in worlds:
            worlds[world] = len(worlds)
            self._waiting.append((number, world))
        return worlds[world]

    def _expand(self, number: int, world: _World, edges: dict[int, _Edges]) -> None:
        values = self._seen[number]
        at = self._world(number, world)
        for place, (action, part) in enumerate(self._doings):
            if not self._fits(values, part) or not self._holds(part, world):
                continue
            growing = edges.setdefault(place, _Edges())
            growing.applies.add(at)
            for told, target, probability in self._results(values, world, action):
                by_ends = growing.told.setdefault(told, {})
                by_ends[at, target] = by_ends.get((at, target), Fraction(0)) + probability

    def _results(self, values: Values, world: _World, action: int) -> Iterator[tuple[_Told, int, Fraction]]:
        """What an action may do in a world: what is told, the number of the world after, the probability."""
        changes = self._changes[action]
        parts = [
            list(readings.parts(bytes(values[at] for at in change.seen), world[change.component]))
            for change, readings in changes
        ]
        for (delta, _, _), chance in product_of(values, self._drawers[action], self._bounded.spend).items():
            if not chance:
                continue
            for drawn in product(*parts):
                after, worlds, probability = bytearray(values), list(world), chance
                for place, value in delta:
                    after[place] = value
                for (change, _), part in zip(changes, drawn, strict=True):
                    worlds[change.component] = part.world
                    probability *= part.probability
                    for place, value in part.shown:
                        variable = change.seen[place]
                        # As everywhere, the greatest of the values wins.
                        set_before = any(variable == at for at, _ in delta)
                        after[variable] = max(value, after[variable]) if set_before else value
                for variable, (component, fact) in self._told.items():
                    after[variable] = Truth.of(bool(worlds[component] >> fact & 1))
                target = self._class(bytes(after))
                told = target, tuple(part.told for part in drawn)
                yield told, self._world(target, tuple(worlds)), probability

    def _fits(self, values: Values, part: _Part) -> bool:
        """Is what a part asks of what is seen so in a class?"""
        return self._packing.pack(values) & part.seen.mask == part.seen.value

    def _holds(self, part: _Part, world: _World) -> bool:
        """Is what a part asks of a world so?"""
        for number, condition in part.true:
            key = number, condition, world[number]
            if key not in self._tests:
                local = local_values(self._task.components[number], world[number])
                self._tests[key] = compile_condition(condition)(local) == Truth.TRUE
            if not self._tests[key]:
                return False
        return True

    def _met(self, number: int, part: _Part) -> Flags:
        """The worlds of a class in which a part of the goal is met."""
        return np.array([self._holds(part, world) for world in self._worlds[number]], dtype=np.bool_)


def _seen_in(task: Task, values: Values, unseen: tuple[int, ...]) -> Values:
    """The values of a state of what is seen, which tell its class."""
    seen = bytearray(values[: len(task.variables)])
    for variable in unseen:
        seen[variable] = Truth.FALSE
    return bytes(seen)


def _possible(task: Task, values: Values) -> Iterator[tuple[_World, Fraction]]:
    """The worlds that are possible in a state, with their probabilities."""
    beliefs = [belief_in(task, values, index) for index in range(len(task.components))]
    totals = [sum(weight for _, weight in belief) for belief in beliefs]
    return independent(
        {world: Fraction(weight, total) for world, weight in belief}
        for belief, total in zip(beliefs, totals, strict=True)
    )


def _dense(weights: dict[int, Fraction], worlds: int) -> Floats:
    found = np.zeros(worlds)
    found[list(weights)] = [float(weight) for weight in weights.values()]
    return found
