"""What the factors of an action may do, as draws: what is set, what it costs, and how likely it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import TypeAlias, TypeVar

from bbtc.ground.condition import compile_condition
from bbtc.ground.task import ONE, ZERO, Effect, Factor, Outcome
from bbtc.kleene import Truth

K = TypeVar("K")

Values: TypeAlias = bytes
"""The truth value of every variable of the task, by index; behind them, of each component of hidden facts,
the number of what is believed of it (:mod:`bbtc.belief.hidden`), in :data:`PLACES` bytes."""

PLACES = 4
Delta: TypeAlias = tuple[tuple[int, int], ...]
"""Places in the values, and what they are set to, ordered by place."""
Draw: TypeAlias = tuple[Delta, Fraction, Fraction]
"""What is set, what is added to the cost, and the reward."""
Spend: TypeAlias = Callable[[int, int], None]
"""Told how many combinations were formed, and how many of them differ; ends it at a limit."""


def unbounded(work: int, found: int) -> None:
    """A :data:`Spend` that ends nothing."""
    del work, found


Drawer: TypeAlias = Callable[[Values], dict[Draw, Fraction]]
_Amounts: TypeAlias = Callable[[Values], tuple[Fraction, Fraction]]  # cost, reward


def product_of(values: Values, drawers: Iterable[Drawer], spend: Spend) -> dict[Draw, Fraction]:
    """Independent draws combined: sets united (the Kleene maximum where they clash), costs and
    rewards added, equal combinations merged at once so that only distinct results multiply."""
    total: dict[Draw, Fraction] | None = None
    for drawer in drawers:
        drawn = drawer(values)
        if total is None:
            total = drawn
            continue
        combined: dict[Draw, Fraction] = {}
        for (delta, cost, reward), p in total.items():
            for (delta2, cost2, reward2), p2 in drawn.items():
                key = (_unite(delta, delta2), _plus(cost, cost2), _plus(reward, reward2))
                add(combined, key, p if p2 is ONE else p2 if p is ONE else p * p2)
            spend(len(drawn), len(combined))
        total = combined
    return {((), ZERO, ZERO): ONE} if total is None else total


def add(to: dict[K, Fraction], key: K, probability: Fraction) -> None:
    """Add to the probability of one thing; its hash, which takes time, is worked out once if it is new."""
    count = len(to)
    before = to.setdefault(key, probability)
    if len(to) == count:
        to[key] = before + probability


def _plus(first: Fraction, second: Fraction) -> Fraction:
    """The sum; most costs and rewards are zero."""
    return first if second is ZERO else second if first is ZERO else first + second


def _unite(first: Delta, second: Delta) -> Delta:
    if not first or not second:
        return first or second
    united = dict(first)
    for variable, value in second:
        united[variable] = max(value, united.get(variable, Truth.FALSE))
    return tuple(sorted(united.items()))


def compile_factor(factor: Factor, spend: Spend) -> Drawer:
    """A factor as a function from values to what may be drawn."""
    outcomes = [
        (
            o.probability,
            _compile_amounts(o),
            _compile_effects(o.effects),
            [compile_factor(f, spend) for f in o.factors],
        )
        for o in factor.outcomes
    ]

    def draw(values: Values) -> dict[Draw, Fraction]:
        drawn: dict[Draw, Fraction] = {}
        for probability, amounts, effects, nested in outcomes:
            delta, (cost, reward) = effects(values), amounts(values)
            product = product_of(values, nested, spend)
            for (delta2, cost2, reward2), p in product.items():
                key = (_unite(delta, delta2), _plus(cost, cost2), _plus(reward, reward2))
                add(drawn, key, probability if p is ONE else probability * p)
            spend(len(product), len(drawn))
        return drawn

    return draw


def _compile_amounts(outcome: Outcome) -> _Amounts:
    """What an outcome adds to cost and reward."""
    certain = outcome.cost, outcome.reward
    if not outcome.charges:
        return lambda _values: certain
    guarded = [(compile_condition(charge.when), charge) for charge in outcome.charges]

    def amounts(values: Values) -> tuple[Fraction, Fraction]:
        due = [charge for guard, charge in guarded if guard(values) == Truth.TRUE]
        cost = sum((charge.cost for charge in due), certain[0])
        return cost, sum((charge.reward for charge in due), certain[1])

    return amounts


def _compile_effects(effects: tuple[Effect, ...]) -> Callable[[Values], Delta]:
    always = _sets(s for e in effects if e.when is None for s in e.sets)
    guarded = [(compile_condition(e.when), _sets(e.sets)) for e in effects if e.when is not None]

    def delta(values: Values) -> Delta:
        united = always
        for guard, sets in guarded:
            if guard(values) == Truth.TRUE:
                united = _unite(united, sets)
        return united

    return delta


def _sets(sets: Iterable[tuple[int, Truth]]) -> Delta:
    united: dict[int, int] = {}
    for variable, value in sets:
        united[variable] = max(int(value), united.get(variable, 0))
    return tuple(sorted(united.items()))
