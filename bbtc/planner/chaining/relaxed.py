"""The delete relaxation of a task: what could ever become true if nothing were undone, and how much it
would take.

Costs are those of the additive heuristic (Bonet, Geffner, "Planning as heuristic search", 2001): a
condition of several parts costs the sum of theirs, an effect what its action needs plus the action's own
cost, divided by the probability of the outcome (the expected number of tries). A variable takes a value,
unknown among them, as a fact of its own, so that observing is an action like any other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from typing_extensions import assert_never

from bbtc.belief.state import Values
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, variables
from bbtc.ground.task import Factor, Task
from bbtc.kleene import Truth, negate
from bbtc.limits import Limits
from bbtc.rounding import LARGEST, rounded

Costs: TypeAlias = npt.NDArray[np.float64]
Index: TypeAlias = npt.NDArray[np.int64]

_NEVER = float("inf")
_KEPT_BYTES = 1 << 26
_ACTIONS_AT_ONCE = 64  # indexed between two looks at the limits
_LEAST_COST = 2.0**-10
_LEAST_PROBABILITY = 1 / LARGEST
"""What an action costs at least here, so that longer ways cost more."""


class Operator(NamedTuple):
    """What an action may bring about under one guard in one of its outcomes: the number of the action in
    the task, the guard (None: always), the outcome's probability, and the values it sets. One with the
    number -1 only combines facts."""

    action: int
    when: Condition | None
    probability: Fraction
    sets: tuple[tuple[int, Truth], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """What is possible from a state in the relaxation, a superset of the truth. A pair of variable and
    value is ``in`` it if it is; ``costs`` holds what each takes, infinite where impossible."""

    costs: Costs

    def __contains__(self, fact: tuple[int, int]) -> bool:
        variable, value = fact
        return bool(self.costs[3 * variable + value] < _NEVER)

    def cost(self, condition: Condition) -> float:
        """What it takes to make the condition true; infinite if it is impossible."""
        match condition:
            case Is(variable, value):
                return float(self.costs[3 * variable + value])
            case Known(variable):
                return float(min(self.costs[3 * variable], self.costs[3 * variable + 2]))
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


class RelaxedReachability:
    """The relaxation of a task, indexed once and asked for many states. To make it raises
    :class:`bbtc.diagnostics.LimitReached`."""

    def __init__(self, task: Task, limits: Limits) -> None:
        self.task = task
        self.operators: list[Operator] = []
        self._base: list[float] = []
        self._bodies: list[list[int]] = []
        self._heads: list[tuple[int, int]] = []
        self._combined: dict[Condition, int] = {}
        self._always = 3 * len(task.variables)  # a fact that holds, and one that never does
        self._count = self._always + 2
        for number, action in enumerate(task.actions):
            if number % _ACTIONS_AT_ONCE == 0:
                limits.check_time("planning")
            needs = self._body(action.precondition)
            cost = max(rounded(action.cost), _LEAST_COST)
            for operator in operators_of(number, action.factors):
                more = [] if operator.when is None else self._body(operator.when)
                heads = [3 * variable + int(value) for variable, value in operator.sets]
                weight = cost / max(_LEAST_PROBABILITY, float(operator.probability))
                self._add(operator, weight, [*needs, *more], heads)
        self._index()

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
        self._body_facts = np.fromiter((f for body in self._bodies for f in body), dtype=np.int64)
        lengths = np.array([len(body) for body in self._bodies], dtype=np.int64)
        self._body_first = np.cumsum(lengths) - lengths
        self._base_costs = np.array(self._base, dtype=np.float64)
        pairs = np.array(sorted(set(self._heads)), dtype=np.int64).reshape(-1, 2)
        self._made, first = np.unique(pairs[:, 0], return_index=True)
        self._made_first = first.astype(np.int64)
        self._makers = pairs[:, 1]
        del self._base, self._bodies, self._heads
        self._cache: dict[Values, Facts] = {}
        self._most_kept = max(64, _KEPT_BYTES // (8 * self._count))

    def facts(self, values: Values) -> Facts:
        """Everything reachable from a state, with costs."""
        if values in self._cache:
            return self._cache[values]
        costs = np.full(self._count, _NEVER)
        costs[3 * np.arange(len(values)) + np.frombuffer(values, dtype=np.uint8)] = 0.0
        costs[self._always] = 0.0
        while len(self._made):
            found = np.minimum.reduceat(self._operator_costs(costs)[self._makers], self._made_first)
            if not (found < costs[self._made]).any():
                break
            costs[self._made] = np.minimum(costs[self._made], found)
        if len(self._cache) >= self._most_kept:
            self._cache.clear()
        self._cache[values] = Facts(costs)
        return self._cache[values]

    def _operator_costs(self, costs: Costs) -> Costs:
        found: Costs = self._base_costs + np.add.reduceat(costs[self._body_facts], self._body_first)
        return found

    def operator_costs(self, facts: Facts) -> Costs:
        """What it takes to apply each operator until it has its effect."""
        return self._operator_costs(facts.costs) if len(self._base_costs) else self._base_costs

    def makers(self, variable: int, value: Truth) -> Index:
        """The operators that set a variable to a value, by number."""
        fact = 3 * variable + int(value)
        place = int(np.searchsorted(self._made, fact))
        if place == len(self._made) or self._made[place] != fact:
            return self._makers[:0]
        end = self._made_first[place + 1] if place + 1 < len(self._made) else len(self._makers)
        return self._makers[self._made_first[place] : end]


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


def helpful(condition: Condition, value: Truth) -> Iterator[tuple[int, Truth]]:
    """The assignments that can make a condition true that now has the value: those that may make a part
    of it true, or unknown, so that it can be observed; of an unknown one, those that tell. Repeats are
    included."""
    match condition:
        case Is(variable, Truth.UNKNOWN):
            yield variable, Truth.UNKNOWN
        case Is(variable, wanted):
            yield variable, wanted
            yield variable, negate(wanted) if value is Truth.UNKNOWN else Truth.UNKNOWN
        case Known(variable):
            yield variable, Truth.TRUE
            yield variable, Truth.FALSE
        case And(parts) | Or(parts):
            for part in parts:
                yield from helpful(part, value)
        case Not(part):
            for variable in variables(part):
                yield from ((variable, each) for each in Truth)
        case Constant():
            return
        case _:
            assert_never(condition)
