"""Components whose beliefs are few, and told apart by what is known, written without hidden facts: as factors
under conditions on what is known. Nothing has to be remembered then but the variables, and everything that
knows no hidden facts works, exactly as well."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product

from bbtc.belief.draws import PLACES, Draw, Drawer
from bbtc.belief.hidden import beliefs_of, compile_change, place_of
from bbtc.ground.condition import Condition, Is, conjunction, conjuncts, evaluate, variables
from bbtc.ground.effects import arrange
from bbtc.ground.task import (
    NO_CHANGE,
    Change,
    Charge,
    Effect,
    Factor,
    GroundAction,
    InitialState,
    Outcome,
    Task,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits

MOST_BELIEFS = 64
"""A component with more beliefs stays."""
_MOST_WORLDS = 64
_LOOK = 4096  # combinations of outcomes between two looks at the clock
_MOST_SEEN = 16  # combinations of values of the seen variables of a change


def lowered(task: Task, limits: Limits) -> Task:
    """The task without the components that can do without worlds, made of the one with them. P*, costs and
    trees are the same, state by state. Raises :class:`bbtc.diagnostics.LimitReached`."""
    found = {}
    count = len(task.initial)
    changes: list[list[tuple[GroundAction, Change]]] = [[] for _ in task.components]
    for action in task.actions:
        for change in action.changes:
            changes[change.component].append((action, change))
    for number in range(len(task.components)):
        limits.check_time("grounding")
        lowering = _Lowering(task, number, changes[number], limits)
        if lowering.explored() and count * lowering.beginnings <= limits.initial_states:
            count *= lowering.beginnings
            found[number] = lowering
    if not found:
        return task
    # What one fact alone is known to be is what was read of it.
    alone = {
        number: lowering
        for number, lowering in found.items()
        if len(task.components[number].facts) == 1 and len(task.components[number].known) == 1
    }
    lower = replace(_without(task, found), unlowered=task)
    if task.true_worlds:  # runs begin in one of them, which has to be kept
        return replace(lower, origin=task)
    return lower if len(alone) == len(found) else replace(lower, origin=_without(task, alone))


@dataclass(frozen=True, slots=True)
class _Case:
    """What an action leads to from one belief of a component, where seen variables have these values."""

    belief: int
    seen: tuple[tuple[int, Truth], ...]
    draws: dict[Draw, Fraction]


@dataclass(slots=True)
class _Doing:
    """An action that changes the component: what its precondition says of what is known, and its cases."""

    action: GroundAction
    seen: tuple[int, ...]
    draw: Drawer
    asks: list[Condition]
    beliefs: list[int] = field(default_factory=list)
    cases: list[_Case] = field(default_factory=list)


class _Lowering:
    def __init__(
        self, task: Task, number: int, changes: list[tuple[GroundAction, Change]], limits: Limits
    ) -> None:
        self._task = task
        self._number = number
        self._component = task.components[number]
        self._limits = limits
        self._beliefs = beliefs_of(self._component)
        self._known = [knowledge.variable for knowledge in self._component.known]
        self._place = place_of(task, number)
        own = set(self._known)
        self._work = 0
        self._drawers: dict[Change, Drawer] = {}
        self._doings = [
            _Doing(
                action,
                change.seen,
                self._drawer(change),
                [
                    part
                    for part in conjuncts(action.precondition)
                    if own.issuperset(variables(part)) and any(True for _ in variables(part))
                ],
            )
            for action, change in changes
        ]
        self._met: dict[int, tuple[Truth, ...]] = {}
        """By belief: the values of what is known."""
        self.first: list[dict[Draw, Fraction]] = []
        """By initial state: what may be told before the first action."""

    @property
    def beginnings(self) -> int:
        """So many things may be told before the first action."""
        return max(map(len, self.first))

    def _told_first(self, state: InitialState) -> dict[Draw, Fraction]:
        """What may be told before the first action."""
        values = self._values(self._beliefs.prior)
        values[: len(state.values)] = bytes(state.values)
        change = Change(self._number, self._component.seen, (), self._component.first)
        return compile_change(self._task, change, self._spend)(bytes(values))

    def _spend(self, work: int, _found: int) -> None:
        self._work += work
        if self._work > _LOOK:
            self._work = 0
            self._limits.check_time("grounding")

    def _drawer(self, change: Change) -> Drawer:
        """The change as a function of the state; many actions have the same, by their sensors."""
        if change not in self._drawers:
            self._drawers[change] = compile_change(self._task, change, self._spend)
        return self._drawers[change]

    def explored(self) -> bool:
        """Look at all beliefs; are they few, and does what is known tell them apart?"""
        if self._component.diagram is not None or len(self._component.prior) > _MOST_WORLDS:
            return False
        if any(2 ** len(doing.seen) > _MOST_SEEN for doing in self._doings):
            return False
        for state in self._task.initial:
            self.first.append(self._told_first(state))
        waiting = list(dict.fromkeys(belief for told in self.first for belief in map(self._after, told)))
        for belief in waiting:
            self._meet(belief)
        while waiting:
            belief = waiting.pop()
            for doing in self._doings:
                if not self._may(doing, belief):
                    continue
                doing.beliefs.append(belief)
                for case in self._cases(doing, belief):
                    doing.cases.append(case)
                    reached = map(self._after, case.draws)
                    waiting += [self._meet(after) for after in reached if after not in self._met]
            if len(self._met) > MOST_BELIEFS:
                return False
        return len(set(self._met.values())) == len(self._met)

    def _meet(self, belief: int) -> int:
        self._met[belief] = tuple(Truth(value) for _, value in self._beliefs.known(belief))
        return belief

    def _values(self, belief: int) -> bytearray:
        """The values of a state in which this is believed."""
        task = self._task
        values = bytearray(len(task.variables) + PLACES * len(task.components))
        values[self._place : self._place + PLACES] = belief.to_bytes(PLACES, "big")
        for variable, value in self._beliefs.known(belief):
            values[variable] = value
        return values

    def _may(self, doing: _Doing, belief: int) -> bool:
        """May the action start, as far as this component tells?"""
        values = self._values(belief)
        return all(evaluate(part, values) is Truth.TRUE for part in doing.asks)

    def _cases(self, doing: _Doing, belief: int) -> list[_Case]:
        """What may come of the action, by the values of those seen variables on which it depends."""
        own = set(self._known)
        free = [variable for variable in doing.seen if variable not in own]
        every: dict[tuple[Truth, ...], dict[Draw, Fraction]] = {}
        for values in product(*(self._task.variables[variable].values for variable in free)):
            state = self._values(belief)
            for variable, value in zip(free, values, strict=True):
                state[variable] = value
            every[values] = doing.draw(bytes(state))
        for at in reversed(range(len(free))):
            merged: dict[tuple[Truth, ...], dict[Draw, Fraction]] = {}
            for values, draws in every.items():
                if merged.setdefault((*values[:at], *values[at + 1 :]), draws) != draws:
                    break
            else:
                every = merged
                free = [*free[:at], *free[at + 1 :]]
        return [
            _Case(belief, tuple(zip(free, values, strict=True)), draws) for values, draws in every.items()
        ]

    def _after(self, draw: Draw) -> int:
        octets = dict(draw[0])
        return int.from_bytes(bytes(octets[self._place + at] for at in range(PLACES)), "big")

    # --- as factors --------------------------------------------------------------------------

    def factors(self) -> Iterator[tuple[str, Factor]]:
        """What the actions, by name, do to the variables of what is known, and to those that they see."""
        for doing in self._doings:
            for case in doing.cases:
                others = [other for other in doing.beliefs if other != case.belief]
                guard = self._telling(case.belief, others)
                guard += [Is(variable, value) for variable, value in case.seen]
                factor = self._factor(case, conjunction(guard))
                if factor is not None:
                    yield doing.action.name, factor

    def _telling(self, belief: int, others: Sequence[int]) -> list[Condition]:
        """Values of what is known that only this one of some beliefs has."""
        mine, found = self._met[belief], list[Condition]()
        left = [self._met[other] for other in others]
        while left:
            at = max(
                range(len(mine)),
                key=lambda place: (sum(other[place] is not mine[place] for other in left), -place),
            )
            found.append(Is(self._known[at], mine[at]))
            left = [other for other in left if other[at] is mine[at]]
        return found

    def _factor(self, case: _Case, guard: Condition) -> Factor | None:
        before = dict(self._beliefs.known(case.belief))
        when = guard if any(True for _ in variables(guard)) else None
        outcomes = []
        for (delta, cost, reward), probability in case.draws.items():
            sets = tuple(
                (variable, Truth(value))
                for variable, value in delta
                if variable < len(self._task.variables) and before.get(variable) != value
            )
            effects = (Effect(when, sets),) if sets else ()
            if when is None:
                outcomes.append(Outcome(probability, effects, cost=cost, reward=reward))
            else:
                charges = (Charge(when, cost, reward),) if cost or reward else ()
                outcomes.append(Outcome(probability, effects, charges=charges))
        plain = all(not (each.effects or each.cost or each.reward or each.charges) for each in outcomes)
        return None if plain else Factor(tuple(outcomes))

    def values(self) -> Iterator[tuple[int, set[Truth]]]:
        """The variables of what is known, with the values that they may have."""
        for at, variable in enumerate(self._known):
            yield variable, {values[at] for values in self._met.values()}


def _without(task: Task, found: dict[int, _Lowering]) -> Task:
    """The task without some of its components."""
    more: dict[str, list[Factor]] = {}
    seen = list(task.variables)
    for lowering in found.values():
        for name, factor in lowering.factors():
            more.setdefault(name, []).append(factor)
        for variable, values in lowering.values():
            seen[variable] = replace(seen[variable], three_valued=Truth.UNKNOWN in values)
    left = [number for number in range(len(task.components)) if number not in found]
    renumber = {number: place for place, number in enumerate(left)}
    actions = tuple(_action(action, more.get(action.name, ()), renumber) for action in task.actions)
    return replace(
        task,
        variables=tuple(seen),
        initial=tuple(
            each
            for number, state in enumerate(task.initial)
            for each in _told(state, [lowering.first[number] for lowering in found.values()])
        ),
        actions=actions,
        components=tuple(task.components[number] for number in left),
    )


def _told(state: InitialState, draws: list[dict[Draw, Fraction]]) -> Iterator[InitialState]:
    """What an initial state becomes by what is told of several components."""
    for combined in product(*(draw.items() for draw in draws)):
        values, probability = list(state.values), state.probability
        for (delta, _, _), share in combined:
            probability *= share
            for variable, value in delta:
                if variable < len(values):
                    values[variable] = Truth(value)
        yield InitialState(probability, tuple(values))


def _action(action: GroundAction, more: Iterable[Factor], renumber: dict[int, int]) -> GroundAction:
    if not action.changes:
        return action
    changes = tuple(
        replace(change, component=renumber[change.component])
        for change in action.changes
        if change.component in renumber
    )
    factors = arrange([*action.factors, *more]) or (NO_CHANGE,)
    return replace(action, factors=factors, changes=changes)
