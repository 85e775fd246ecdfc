"""What is believed of hidden facts: distributions over the worlds of a component, and how actions and
what the robot is told change them (Bayes' rule, exactly).

Beliefs of a component are numbered as they first appear; a number stands for its belief wherever the
component goes. A belief is what the robot could know by all it was told: how likely each world is that is
still possible.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, lcm
from typing import NamedTuple, TypeAlias

from bbtc.belief.draws import (
    PLACES,
    Delta,
    Draw,
    Drawer,
    Spend,
    Values,
    compile_factor,
    product_of,
    unbounded,
)
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import (
    TRUE,
    Condition,
    Constant,
    Is,
    Known,
    compile_condition,
    evaluate,
    is_test,
    replaced,
    variables,
)
from bbtc.ground.task import ONE, ZERO, Change, Component, Knowledge, Observation, Task
from bbtc.kleene import Truth
from bbtc.markov import distribution

Belief: TypeAlias = tuple[tuple[int, int], ...]
"""Worlds still possible, in order, with weights: positive integers without a common divisor."""


_MOST_KEPT = 5_000  # results of a change that are kept


@dataclass(slots=True)
class Beliefs:
    """The beliefs of a component that were met, by number, and what is known in each."""

    component: Component
    by_number: list[Belief] = field(default_factory=list)
    _numbers: dict[Belief, int] = field(default_factory=dict)
    _known: list[Delta] = field(default_factory=list)
    _true: dict[int, tuple[int, ...]] = field(default_factory=dict)
    """By world: which of the conditions of :attr:`Component.known` are true."""
    _chances: dict[tuple[int, Condition], Fraction] = field(default_factory=dict)
    _draws: dict[tuple[int, int], tuple[Change, dict[tuple[int, bytes], dict[Draw, Fraction]]]] = field(
        default_factory=dict
    )

    def draws_of(self, change: Change, first: int) -> dict[tuple[int, bytes], dict[Draw, Fraction]]:
        """What was found to come of a change, by what decides over it, in tasks that have the number of what
        is believed at ``first``: whoever compiles the change adds to it."""
        known = self._draws.get((id(change), first))
        if known is None or known[0] is not change:
            known = self._draws[id(change), first] = change, {}
        return known[1]

    def __reduce__(self) -> tuple[Callable[..., Beliefs], tuple[object, ...]]:
        """What comes of changes stays in this process, as these are known by where they are."""
        return Beliefs, (
            self.component,
            self.by_number,
            self._numbers,
            self._known,
            self._true,
            self._chances,
        )

    @property
    def prior(self) -> int:
        """The number of what is believed before anything is told."""
        prior = self.component.prior
        scale = lcm(*(probability.denominator for _, probability in prior))
        return self.number({world: int(probability * scale) for world, probability in prior})

    def number(self, weights: Mapping[int, int]) -> int:
        """The number of the belief with these weights of worlds, none of them 0."""
        common = gcd(*weights.values())
        belief = tuple((world, weights[world] // common) for world in sorted(weights))
        found = self._numbers.get(belief)
        if found is None:
            found = self._numbers[belief] = len(self.by_number)
            self.by_number.append(belief)
            self._known.append(self._known_in(belief))
        return found

    def known(self, number: int) -> Delta:
        """The task's variables that tell what is known, and their values in a belief."""
        return self._known[number]

    def chance(self, number: int, condition: Condition) -> Fraction:
        """How probable a condition over the facts is in a belief."""
        found = self._chances.get((number, condition))
        if found is None:
            belief, holds = self.by_number[number], compile_condition(condition)
            true = sum(w for world, w in belief if holds(local_values(self.component, world)) == Truth.TRUE)
            found = self._chances[number, condition] = Fraction(true, sum(weight for _, weight in belief))
        return found

    def believed(self, number: int, knowledge: Knowledge) -> Truth:
        """What is believed of something in a belief."""
        chance = self.chance(number, knowledge.condition)
        return _believed(chance.numerator, chance.denominator, knowledge.at_least)

    def _known_in(self, belief: Belief) -> Delta:
        true = [0] * len(self.component.known)
        for world, weight in belief:
            for at in self._true_in(world):
                true[at] += weight
        total = sum(weight for _, weight in belief)
        return tuple(
            (knowledge.variable, int(_believed(weight, total, knowledge.at_least)))
            for knowledge, weight in zip(self.component.known, true, strict=True)
        )

    def _true_in(self, world: int) -> tuple[int, ...]:
        found = self._true.get(world)
        if found is None:
            local = local_values(self.component, world)
            values = (compile_condition(knowledge.condition)(local) for knowledge in self.component.known)
            found = tuple(at for at, value in enumerate(values) if value == Truth.TRUE)
            self._true[world] = found
        return found


def _believed(weight: int, total: int, at_least: Fraction) -> Truth:
    """What is believed of a condition with this weight."""
    enough = at_least.numerator * total
    if weight * at_least.denominator >= enough:
        return Truth.TRUE
    return Truth.FALSE if (total - weight) * at_least.denominator >= enough else Truth.UNKNOWN


def beliefs_of(component: Component) -> Beliefs:
    """The beliefs of a component."""
    found = component.memo.get("beliefs")
    if not isinstance(found, Beliefs):
        found = component.memo["beliefs"] = Beliefs(component)
    return found


def local_values(component: Component, world: int, seen: bytes = b"") -> bytes:
    """The local variables of a component in a world: its facts, then the seen variables."""
    bits = (Truth.TRUE if world >> bit & 1 else Truth.FALSE for bit in range(len(component.facts)))
    return bytes(bits) + seen


def refuse_hidden(task: Task, done: str, hint: str | None = None) -> None:
    """Raise :class:`bbtc.diagnostics.BbtcError` (BBT0506) for a task with hidden facts, which cannot be
    ``done`` to it."""
    if task.components:
        fact = task.components[0].facts[0]
        message = f"a task with hidden facts, such as {fact}, cannot be {done}"
        raise BbtcError.single("BBT0506", message, hint=hint)


# --- in the values of a state ------------------------------------------------------------------


def place_of(task: Task, component: int) -> int:
    """Where in the values of a state the number of a component's belief stands."""
    return len(task.variables) + PLACES * component


def number_in(task: Task, values: Values, component: int) -> int:
    """The number of what is believed of a component in a state."""
    at = place_of(task, component)
    return int.from_bytes(values[at : at + PLACES], "big")


def belief_in(task: Task, values: Values, component: int) -> Belief:
    """What is believed of a component in a state."""
    return beliefs_of(task.components[component]).by_number[number_in(task, values, component)]


def told_first(task: Task, values: Values) -> Iterator[tuple[Values, Fraction]]:
    """What an initial state of the task may become by what the robot is told before its first action."""
    drawers: list[Drawer] = []
    for index, component in enumerate(task.components):
        number = beliefs_of(component).prior
        values += number.to_bytes(PLACES, "big")
        drawers.append(compile_change(task, Change(index, component.seen, (), component.first), unbounded))
    for (delta, _, _), probability in product_of(values, drawers, unbounded).items():
        after = bytearray(values)
        for place, value in delta:
            after[place] = value
        yield bytes(after), probability


def chance_of(task: Task, condition: Condition, values: Values) -> Fraction:
    """How probable it is in a state that a condition on what is known is really so: what it reads of hidden
    facts has the value that it has in the world. ``(known …)`` and ``(unknown …)`` ask what is known there,
    too."""
    read = set(variables(condition))
    condition = _with_tests_done(condition, values)
    worlds: dict[bytes, Fraction] = {bytes(values): ONE}
    for index, component in enumerate(task.components):
        known = [each for each in component.known if each.variable in read]
        if known:
            drawn = _drawn(task, values, index, known)
            worlds = distribution(
                (_with(world, sets), probability * p)
                for world, probability in worlds.items()
                for sets, p in drawn.items()
            )
    return sum((p for world, p in worlds.items() if evaluate(condition, world) is Truth.TRUE), ZERO)


def true_in_worlds(task: Task, condition: Condition, values: Values, worlds: Mapping[int, int]) -> bool:
    """Is a condition on what is known really so in a state, in these worlds, by component? As in
    :func:`chance_of`."""
    real = bytearray(values)
    for index, world in worlds.items():
        component = task.components[index]
        local = local_values(component, world)
        for each in component.known:
            real[each.variable] = compile_condition(each.condition)(local)
    return evaluate(_with_tests_done(condition, values), bytes(real)) is Truth.TRUE


def _with_tests_done(condition: Condition, values: Values) -> Condition:
    """A condition in which ``(known …)`` and ``(unknown …)`` are what they are in a state."""

    def done(leaf: Is | Known) -> Condition:
        return Constant(evaluate(leaf, values) is Truth.TRUE) if is_test(leaf) else leaf

    return replaced(condition, done)


def _drawn(task: Task, values: Values, index: int, known: Sequence[Knowledge]) -> dict[Delta, Fraction]:
    """The values that some conditions have in the world, and how probable they are."""
    component = task.components[index]
    belief = belief_in(task, values, index)
    total = sum(weight for _, weight in belief)
    tests = [(each.variable, compile_condition(each.condition)) for each in known]

    def truths(world: int) -> Delta:
        local = local_values(component, world)
        return tuple((variable, test(local)) for variable, test in tests)

    return distribution((truths(world), Fraction(weight, total)) for world, weight in belief)


def _with(values: bytes, sets: Delta) -> bytes:
    after = bytearray(values)
    for place, value in sets:
        after[place] = value
    return bytes(after)


# --- changes -----------------------------------------------------------------------------------

_Told: TypeAlias = tuple[tuple[int, int], ...]
"""What the robot sees of one outcome: seen variables by local number with their new values, and below zero
the numbers of the observations with what they told."""


def case_of(task: Task, change: Change, values: Values) -> tuple[int, bytes]:
    """What decides over a change in a state: the number of what is believed, and the values of the variables
    that are seen."""
    return number_in(task, values, change.component), bytes(values[variable] for variable in change.seen)


def compile_change(task: Task, change: Change, spend: Spend) -> Drawer:
    """A change of hidden facts as a function from the values of a state to what may come of it: what is
    believed and known then, and the seen variables that it sets. Costs and rewards that the robot cannot see
    are expected ones."""
    readings = Readings(task, change, spend)
    first = place_of(task, change.component)
    cache = readings.beliefs.draws_of(change, first)

    def draw(values: Values) -> dict[Draw, Fraction]:
        case = case_of(task, change, values)
        found = cache.get(case)
        if found is None:
            found = results(*case)
            if len(cache) < _MOST_KEPT:
                cache[case] = found
        return found

    def results(number: int, seen: bytes) -> dict[Draw, Fraction]:
        drawn: dict[Draw, Fraction] = {}
        for reading in readings.after(number, seen):
            sets = [(change.seen[at], value) for at, value in reading.shown]
            sets += readings.beliefs.known(reading.belief)
            sets += [(first + at, octet) for at, octet in enumerate(reading.belief.to_bytes(PLACES, "big"))]
            key = tuple(sorted(sets)), reading.cost, reading.reward
            drawn[key] = drawn[key] + reading.probability if key in drawn else reading.probability
        spend(len(drawn), len(drawn))
        return drawn

    return draw


class Reading(NamedTuple):
    """One thing that the robot may be told by a change: what it sees of the seen variables, by their place in
    :attr:`Change.seen`, where they change; what the observations that were made told, by number; the number
    of what is believed then; the probability, and expected cost and reward."""

    shown: Delta
    told: Delta
    belief: int
    probability: Fraction
    cost: Fraction
    reward: Fraction


class Happening(NamedTuple):
    """One of the things that a change may do in a world: what the robot is shown and told, as in
    :class:`Reading`, the world after, and the probability."""

    shown: Delta
    told: Delta
    world: int
    probability: Fraction


class Readings:
    """What the robot may be told by a change of hidden facts, and what it believes then."""

    def __init__(self, task: Task, change: Change, spend: Spend) -> None:
        component = task.components[change.component]
        self.beliefs = beliefs_of(component)
        self._kernel = _Kernel(component, change, spend)
        self._facts = len(component.facts)
        self._spend = spend

    def after(self, number: int, seen: bytes) -> Iterator[Reading]:
        """What may be told where this was believed, and the seen variables had these values."""
        belief = self.beliefs.by_number[number]
        by_told = self._kernel.certain(belief, seen)
        amounts: dict[_Told, tuple[Fraction, Fraction]] = {}
        scale = 1
        if by_told is None:
            by_told, amounts, scale = self._kernel.drawn(belief, seen)
        total = scale * sum(weight for _, weight in belief)
        self._spend(len(belief), len(by_told))
        for told, mass in by_told.items():
            whole = sum(mass.values())
            cost, reward = amounts.get(told, (ZERO, ZERO))
            shown, observed = self._split(told)
            yield Reading(
                shown,
                observed,
                self.beliefs.number(mass),
                Fraction(whole, total),
                cost / whole if cost else ZERO,
                reward / whole if reward else ZERO,
            )

    def in_world(self, number: int, seen: bytes, world: int) -> Iterator[tuple[Delta, int, int, Fraction]]:
        """What may happen in one world: what is seen of the seen variables, what is believed then, the world
        after, and the probability."""
        beliefs = {(reading.shown, reading.told): reading.belief for reading in self.after(number, seen)}
        for part in self.parts(seen, world):
            yield part.shown, beliefs[part.shown, part.told], part.world, part.probability

    def parts(self, seen: bytes, world: int) -> Iterator[Happening]:
        """What may happen in one world, whatever is believed."""
        for part in self._kernel.of(world, seen):
            yield Happening(*self._split(part.told), part.world, part.probability)

    def _split(self, told: _Told) -> tuple[Delta, Delta]:
        """What is seen of the seen variables, and what the observations told."""
        shown = tuple((local - self._facts, value) for local, value in told if local >= 0)
        return shown, tuple((~local, value) for local, value in told if local < 0)


class _Part(NamedTuple):
    """One of the things that a change may do in a world: what the robot sees, the world after, the
    probability, and what is added to cost and reward."""

    told: _Told
    world: int
    probability: Fraction
    cost: Fraction
    reward: Fraction


class _Kernel:
    """What a change does in one world."""

    def __init__(self, component: Component, change: Change, spend: Spend) -> None:
        self._component = component
        self._drawers = [compile_factor(factor, spend) for factor in change.factors]
        self._observations = [_compile(observation) for observation in change.observations]
        self._spend = spend
        self._known: dict[tuple[int, bytes], list[_Part]] = {}
        self._only: dict[bytes, dict[int, tuple[_Told, int] | None]] = {}
        """By what is seen before, and world: what the robot sees, and the world after, if that is certain."""

    def certain(self, belief: Belief, seen: bytes) -> dict[_Told, dict[int, int]] | None:
        """By what the robot sees, the worlds after with their weights; None where chance, or what is added to
        cost or reward, has a part in it."""
        only = self._only.setdefault(seen, {})
        found: dict[_Told, dict[int, int]] = {}
        for world, weight in belief:
            if world not in only:
                parts = self.of(world, seen)
                sure = len(parts) == 1 and not parts[0].cost and not parts[0].reward
                only[world] = (parts[0].told, parts[0].world) if sure else None
            known = only[world]
            if known is None:
                return None
            mass = found.get(known[0])
            if mass is None:
                mass = found[known[0]] = {}
            mass[known[1]] = mass.get(known[1], 0) + weight
        return found

    def drawn(
        self, belief: Belief, seen: bytes
    ) -> tuple[dict[_Told, dict[int, int]], dict[_Told, tuple[Fraction, Fraction]], int]:
        """By what the robot sees, the worlds after with their weights, and what is added to cost and reward,
        with the same weights; they are whole in the unit of the last, the common denominator of all
        probabilities, since they are added and divided often."""
        parts = [(weight, part) for world, weight in belief for part in self.of(world, seen)]
        scale = lcm(*{part.probability.denominator for _, part in parts})
        found: dict[_Told, dict[int, int]] = {}
        amounts: dict[_Told, tuple[Fraction, Fraction]] = {}
        for weight, part in parts:
            mass = found.setdefault(part.told, {})
            added = weight * part.probability.numerator * (scale // part.probability.denominator)
            mass[part.world] = mass.get(part.world, 0) + added
            if part.cost or part.reward:
                cost, reward = amounts.get(part.told, (ZERO, ZERO))
                amounts[part.told] = cost + added * part.cost, reward + added * part.reward
        return found, amounts, scale

    def of(self, world: int, seen: bytes) -> list[_Part]:
        """All that it may do in a world."""
        found = self._known.get((world, seen))
        if found is None:
            found = self._known[world, seen] = list(self._work_out(world, seen))
        return found

    def _work_out(self, world: int, seen: bytes) -> Iterator[_Part]:
        facts = len(self._component.facts)
        before = local_values(self._component, world, seen)
        for (delta, cost, reward), probability in product_of(before, self._drawers, self._spend).items():
            if not probability:
                continue
            values, after = bytearray(before), world
            for local, value in delta:
                values[local] = value
                if local < facts:
                    after = after | 1 << local if value == Truth.TRUE else after & ~(1 << local)
            # What is set to what it was shows nothing.
            shown = tuple(
                (local, value) for local, value in delta if local >= facts and before[local] != value
            )
            for told, chance in self._told(bytes(values)):
                yield _Part((*shown, *told), after, probability * chance, cost, reward)

    def _told(self, values: bytes) -> list[tuple[_Told, Fraction]]:
        """What the observations may tell."""
        found: list[tuple[_Told, Fraction]] = [((), Fraction(1))]
        for number, observe in enumerate(self._observations):
            readings = observe(values)
            found = (
                [((*told, (~number, value)), chance * p) for told, chance in found for value, p in readings]
                if readings
                else found
            )
            self._spend(len(found), len(found))
        return found


def _compile(observation: Observation) -> Callable[[bytes], list[tuple[int, Fraction]]]:
    """What an observation may tell, with probabilities; nothing where it is not made."""
    truth = compile_condition(observation.condition)
    when = compile_condition(TRUE if observation.when is None else observation.when)

    def readings(values: bytes) -> list[tuple[int, Fraction]]:
        if when(values) != Truth.TRUE:
            return []
        true = truth(values) == Truth.TRUE
        right = observation.right(true)
        both = [(int(true), right), (int(not true), 1 - right)]
        return [(value, p) for value, p in both if p]

    return readings
