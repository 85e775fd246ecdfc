"""The delete relaxation of a task, and its additive heuristic: what could ever become true if nothing were
undone, and how much it would take.

A variable takes a value, unknown among them, as a fact of its own, so that observing is an action like any
other. Costs are those of h_add (Bonet, Geffner, "Planning as heuristic search", 2001): a condition of several
parts costs the sum of theirs, an effect what its action needs plus the action's own cost, divided by the
probability of the outcome (the expected number of tries: the all-outcomes determinization). They are the
least fixed point of these equations, found for many states at a time (Bellman and Ford). Where one is
infinite, no policy makes the condition true; elsewhere it is a guess that guides search and proves nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from typing_extensions import assert_never

from bbtc.belief.draws import Values
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, in_digits
from bbtc.ground.task import Factor, Knowledge, Task, apparent_factors, seen_factors
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import Packing, Words
from bbtc.planner.mdp.state_space import ranges
from bbtc.planner.mdp.transitions import Index
from bbtc.rounding import LARGEST, rounded

Costs: TypeAlias = npt.NDArray[np.floating[Any]]
"""Guessed costs; infinite where something is impossible for sure."""

_NEVER = float("inf")
_MOST = 1e30  # what anything within reach takes, at most
_KEPT_BYTES = 1 << 26
_CELLS = 1 << 18  # array cells worked on at a time
_ACTIONS_AT_ONCE = 64  # indexed between two looks at the limits
_LONG = 16  # rows in a group; of longer ones there are few
_DEAREST = 100.0  # where actions count one, an outcome costs no more than this, however improbable
_LEAST_COST = 2.0**-10
"""What an action costs at least here, so that longer ways cost more."""
_TOLD = 2.0
"""What it takes besides, that what is told is what is wanted."""
_LEAST_PROBABILITY = 1 / LARGEST


class Operator(NamedTuple):
    """What an action may bring about under one guard in one of its outcomes: the number of the action in
    the task, the guard (None: always), the outcome's probability, and the values it sets. One with the
    number -1 only combines facts, or is an event."""

    action: int
    when: Condition | None
    probability: Fraction
    sets: tuple[tuple[int, Truth], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """What is possible from a state in the relaxation, a superset of the truth: ``costs`` holds what each
    value of each variable takes, infinite where impossible."""

    costs: Costs

    def cost(self, condition: Condition) -> float:
        """What it takes to make the condition true; infinite if it is impossible."""
        match condition:
            case Is(variable, value):
                return float(self.costs[3 * variable + value])
            case Known(variable):
                return float(min(self.costs[3 * variable], self.costs[3 * variable + 2]))
            case Within():
                return self.cost(in_digits(condition))
            case And(parts):
                return sum(map(self.cost, parts), 0.0)
            case Or(parts):
                return min(map(self.cost, parts), default=_NEVER)
            case Not(_):
                return 0.0  # never built by grounding, which pushes negations to the leaves
            case Constant(value):
                return 0.0 if value else _NEVER
            case _:
                assert_never(condition)


def possible(condition: Condition, facts: Facts) -> bool:
    """Can the condition be true if every variable takes any of its possible values at will?"""
    return facts.cost(condition) < _NEVER


class Relaxation:
    """The relaxation of a task, indexed once and asked for many states. Actions have their costs, or, with
    ``count_actions``, cost one each. To make it raises :class:`bbtc.diagnostics.LimitReached`."""

    def __init__(self, task: Task, limits: Limits, *, count_actions: bool = False) -> None:
        self.task = task
        self.operators: list[Operator] = []
        self._dtype = np.float32 if count_actions else np.float64
        self._base: list[float] = []
        self._bodies: list[list[int]] = []
        self._heads: list[tuple[int, int]] = []
        self._combined: dict[Condition, int] = {}
        self._always = 3 * len(task.variables)  # a fact that holds, and one that never does
        self._count = self._always + 2
        self._told = [self._tells(component.known) for component in task.components if count_actions]
        for number, action in enumerate(task.actions):
            if number % _ACTIONS_AT_ONCE == 0:
                limits.check_time("planning")
            needs = self._body(action.precondition)
            cost, dearest = max(rounded(action.cost), _LEAST_COST), _NEVER
            if count_actions:
                cost, dearest = 1.0, _DEAREST
            # Who asks what makes a fact asks for actions; else what tells of a component is one fact.
            whole = apparent_factors if not count_actions else seen_factors
            for change in action.changes if count_actions else ():
                self._add(Operator(-1, None, Fraction(1), ()), cost, needs, [self._told[change.component]])
            self._add_all(operators_of(number, whole(task, action)), needs, cost, dearest)
            # Where it is aborted, events may have ended its precondition.
            self._add_all(operators_of(number, action.on_abort), needs, cost, dearest)
        for event in task.events:
            cost, dearest = (1.0, _DEAREST) if count_actions else (_LEAST_COST, _NEVER)
            self._add_all(operators_of(-1, event.factors), self._body(event.precondition), cost, dearest)
        self._goal: Index = np.array(self._body(task.goal), dtype=np.int64)
        self._index()

    def _add_all(self, operators: Iterable[Operator], needs: list[int], cost: float, dearest: float) -> None:
        for operator in operators:
            more = [] if operator.when is None else self._body(operator.when)
            heads = [3 * variable + int(value) for variable, value in operator.sets]
            weight = min(dearest, cost / max(_LEAST_PROBABILITY, float(operator.probability)))
            self._add(operator, weight, [*needs, *more], heads)

    def _tells(self, known: Iterable[Knowledge]) -> int:
        """A fact from which all may follow that can be known."""
        told, self._count = self._count, self._count + 1
        for each in known:
            heads = [3 * each.variable + int(value) for value in Truth]
            self._add(Operator(-1, None, Fraction(1), ()), _TOLD, [told], heads)
        return told

    def _add(self, operator: Operator, cost: float, body: list[int], heads: Iterable[int]) -> None:
        number = len(self.operators)
        self.operators.append(operator)
        self._base.append(cost)
        self._bodies.append(body or [self._always])
        self._heads.extend((head, number) for head in heads)

    def _body(self, condition: Condition) -> list[int]:
        """The facts that together make a condition true."""
        match condition:
            case Is(variable, value):
                return [3 * variable + int(value)]
            case And(parts):
                return [fact for part in parts for fact in self._body(part)]
            case Constant(False):
                return [self._always + 1]
            case Constant() | Not():
                return []
            case Within():
                return self._body(in_digits(condition))
            case Known(variable):
                ways: list[list[int]] = [[3 * variable], [3 * variable + 2]]
            case Or(parts):
                ways = [self._body(part) for part in parts] if condition not in self._combined else []
            case _:
                assert_never(condition)
        if condition not in self._combined:
            self._combined[condition] = self._count
            self._count += 1
            for way in ways:
                self._add(Operator(-1, None, Fraction(1), ()), 0.0, way, [self._combined[condition]])
        return [self._combined[condition]]

    def _index(self) -> None:
        bodies = np.fromiter((fact for body in self._bodies for fact in body), dtype=np.int64)
        self._needed = _Groups(bodies, np.array([len(body) for body in self._bodies], dtype=np.int64))
        self._base_costs: Costs = np.array(self._base, dtype=self._dtype)[self._needed.order]
        self._place: Index = np.argsort(self._needed.order)
        pairs = np.array(sorted(set(self._heads)), dtype=np.int64).reshape(-1, 2)
        self._made, first, counts = np.unique(pairs[:, 0], return_index=True, return_counts=True)
        self._makers = pairs[:, 1]
        self._made_first: Index = np.append(first, len(pairs))
        self._best = _Groups(self._place[self._makers], counts)
        self._added = self._made[self._best.order]
        self._width = self._count + len(bodies) + len(pairs)
        del self._base, self._bodies, self._heads
        self._cache: dict[Values, Facts] = {}
        self._most_kept = max(64, _KEPT_BYTES // (8 * self._count))

    def facts(self, values: Values) -> Facts:
        """Everything reachable from a state, with costs."""
        if values in self._cache:
            return self._cache[values]
        costs: Costs = np.full(self._count, np.inf, dtype=self._dtype)
        count = len(self.task.variables)
        costs[3 * np.arange(count) + np.frombuffer(values, dtype=np.uint8, count=count)] = 0
        costs[self._always] = 0
        while (least := self._backup(costs)) is not None:
            costs[self._added] = least
        if len(self._cache) >= self._most_kept:
            self._cache.clear()
        self._cache[values] = Facts(costs)
        return self._cache[values]

    def estimate(self, packing: Packing, states: Words) -> Costs:
        """What the goal takes from each of some states."""
        step = max(1, _CELLS // self._width)
        pieces = [np.empty(0, dtype=self._dtype)]
        for at in range(0, len(states), step):
            costs = self._fixed_points(packing.unpack(states[at : at + step]).T)
            pieces.append(costs[self._goal].sum(axis=0, dtype=self._dtype))
        return np.concatenate(pieces)

    def _fixed_points(self, values: npt.NDArray[np.uint8]) -> Costs:
        """The costs of all facts (rows) from each state, a column of values; columns that rest are put
        aside."""
        count = values.shape[1]
        costs: Costs = np.full((self._count, count), np.inf, dtype=self._dtype)
        by_value = costs[: self._always].reshape(-1, 3, count)
        np.put_along_axis(by_value, values[:, None].astype(np.intp), 0, axis=1)
        costs[self._always] = 0
        found, live = costs, np.arange(count)
        while (least := self._backup(costs)) is not None:
            moved = (least < costs[self._added]).any(axis=0)
            costs[self._added] = least
            if not moved.all():
                if found is not costs:
                    found[:, live[~moved]] = costs[:, ~moved]
                live, costs = live[moved], costs[:, moved]
        if found is not costs:
            found[:, live] = costs
        return found

    def _backup(self, costs: Costs) -> Costs | None:
        """What the facts of :attr:`_added` take by the equations, given what all take; None if none takes
        less than before."""
        if not len(self._added):
            return None
        before = costs[self._added]
        least = np.minimum(before, self._best.reduced(np.minimum, self._reached(costs)))
        # Sums may double from step to step; what is far is not out of reach.
        np.minimum(least, _MOST, out=least, where=np.isfinite(least))
        return least if (least < before).any() else None

    def _reached(self, costs: Costs) -> Costs:
        """What it takes to apply each operator, in the order of the index, until it has its effect."""
        base = self._base_costs
        return self._needed.reduced(np.add, costs) + (base if costs.ndim == 1 else base[:, None])

    def operator_costs(self, facts: Facts) -> Costs:
        """What it takes to apply each operator until it has its effect."""
        if not self.operators:
            return np.empty(0, dtype=self._dtype)
        return self._reached(facts.costs)[self._place]

    def makers(self, variable: int, value: Truth) -> Index:
        """The operators that set a variable to a value, by number."""
        fact = 3 * variable + int(value)
        place = int(np.searchsorted(self._made, fact))
        if place == len(self._made) or self._made[place] != fact:
            return self._makers[:0]
        return self._makers[self._made_first[place] : self._made_first[place + 1]]


class _Groups:
    """Groups of row numbers, none of them empty; the rows of each are reduced to one. ``order`` tells which
    group stands where in the result: those with the most rows first."""

    def __init__(self, flat: Index, counts: Index) -> None:
        self.order: Index = np.argsort(-counts, kind="stable")
        first, self._counts = (np.cumsum(counts) - counts)[self.order], counts[self.order]
        self._flat = flat[ranges(first, self._counts)]
        self._first: Index = np.cumsum(self._counts) - self._counts
        self._long = int((counts > _LONG).sum())

    @cached_property
    def _columns(self) -> list[Index]:
        """The first rows of all groups that are not long, the second rows of those that have one, …"""
        first, counts = self._first[self._long :], self._counts[self._long :]
        ends = np.searchsorted(-counts, -np.arange(int(counts.max(initial=0))))
        return [self._flat[first[:end] + at] for at, end in enumerate(ends.tolist())]

    def reduced(self, ufunc: np.ufunc, rows: Costs) -> Costs:
        """A row for each group; likewise of a single column."""
        if rows.ndim == 1:
            found: Costs = ufunc.reduceat(rows[self._flat], self._first)
            return found
        # Of many columns, first rows with first rows and so on, which is several times as fast.
        found = np.empty((len(self.order), rows.shape[1]), dtype=rows.dtype)
        if self._long:
            long = self._flat[: int(self._counts[: self._long].sum())]
            ufunc.reduceat(rows[long], self._first[: self._long], axis=0, out=found[: self._long])
        if self._columns:
            rest = found[self._long :]
            rest[:] = rows[self._columns[0]]
            for column in self._columns[1:]:
                ufunc(rest[: len(column)], rows[column], out=rest[: len(column)])
        return found


def operators_of(action: int, factors: Iterable[Factor]) -> Iterator[Operator]:
    """The operators of an action, given by its number: one for every guard in every outcome."""
    stack = [(Fraction(1), factor) for factor in factors]
    while stack:
        share, factor = stack.pop()
        for outcome in factor.outcomes:
            probability = share * outcome.probability
            if not probability:
                continue
            sets: dict[Condition | None, dict[tuple[int, Truth], None]] = {}
            for effect in outcome.effects:
                sets.setdefault(effect.when, {}).update(dict.fromkeys(effect.sets))
            for when, what in sets.items():
                yield Operator(action, when, probability, tuple(what))
            stack.extend((probability, nested) for nested in outcome.factors)
