"""What is believed of hidden facts: distributions over the worlds of a component, and how actions and
what the robot is told change them (Bayes' rule, exactly).

Beliefs of a component are numbered as they first appear; a number stands for its belief wherever the
component goes. A belief is what the robot could know by all it was told: how likely each world is that is
still possible.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction

from bbtc.belief.draws import PLACES, Delta, Draw, Drawer, Spend, Values, add, product_of, unbounded
from bbtc.belief.worlds.beliefs import Belief, Beliefs, ListedBeliefs
from bbtc.belief.worlds.diagrams import DiagramBeliefs
from bbtc.belief.worlds.kernel import Happening, Kernel, Reading, Told, local_values
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import (
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
from bbtc.ground.task import ONE, ZERO, Change, Component, Task
from bbtc.kleene import Truth
from bbtc.markov import distribution

_MOST_KEPT = 5_000  # results of a change that are kept


def beliefs_of(component: Component) -> Beliefs:
    """The beliefs of a component."""
    found = component.memo.get("beliefs")
    if not isinstance(found, Beliefs):
        made = ListedBeliefs if component.diagram is None else DiagramBeliefs
        found = component.memo["beliefs"] = made(component)
    return found


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
    """What is believed of a component in a state, if its worlds are listed."""
    beliefs = beliefs_of(task.components[component])
    assert isinstance(beliefs, ListedBeliefs)
    return beliefs.by_number[number_in(task, values, component)]


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
            drawn = beliefs_of(component).joint(number_in(task, values, index), known)
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


def _with(values: bytes, sets: Delta) -> bytes:
    after = bytearray(values)
    for place, value in sets:
        after[place] = value
    return bytes(after)


# --- changes -----------------------------------------------------------------------------------


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
            add(drawn, (tuple(sorted(sets)), reading.cost, reading.reward), reading.probability)
        spend(len(drawn), len(drawn))
        return drawn

    return draw


class Readings:
    """What the robot may be told by a change of hidden facts, and what it believes then."""

    def __init__(self, task: Task, change: Change, spend: Spend) -> None:
        component = task.components[change.component]
        self.beliefs = beliefs_of(component)
        self._kernel = Kernel(component, change, spend)
        self._facts = len(component.facts)
        self._spend = spend

    def after(self, number: int, seen: bytes) -> Iterator[Reading]:
        """What may be told where this was believed, and the seen variables had these values."""
        for told, belief, probability, cost, reward in self.beliefs.updates(
            self._kernel, number, seen, self._spend
        ):
            yield Reading(*self._split(told), belief, probability, cost, reward)

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

    def _split(self, told: Told) -> tuple[Delta, Delta]:
        """What is seen of the seen variables, and what the observations told."""
        shown = tuple((local - self._facts, value) for local, value in told if local >= 0)
        return shown, tuple((~local, value) for local, value in told if local < 0)
