"""Physical states, and the distribution of states an action leads to."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from bbtc.ground.condition import compile_condition
from bbtc.ground.task import Effect, Factor, GroundAction, Outcome, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.markov import distribution

Values: TypeAlias = bytes
"""The truth value of every variable of the task, by index; behind them, of each component of hidden facts,
the number of what is believed of it (:mod:`bbtc.belief.hidden`), in :data:`PLACES` bytes."""

PLACES = 4


class State(NamedTuple):
    """A physical state: the values of the variables, and what the tree remembers: which latched
    action nodes have finished (bit i stands for the i-th from the left), and how many attempts its
    retry nodes have made (:class:`bbtc.belief.tick.Memory`)."""

    values: Values
    finished: int


class Result(NamedTuple):
    """One possible result of an action: its probability, cost (of the action and this outcome),
    reward, and the values after it."""

    probability: Fraction
    cost: Fraction
    reward: Fraction
    values: Values


Transition: TypeAlias = Callable[[Values], tuple[Result, ...]]


def initial_belief(task: Task) -> dict[Values, Fraction]:
    """The task's initial distribution over assignments, equal ones merged."""
    own = distribution((bytes(initial.values), initial.probability) for initial in task.initial)
    if not task.components:
        return own
    from bbtc.belief.hidden import told_first

    return distribution(
        (after, probability * p)
        for values, p in own.items()
        for after, probability in told_first(task, values)
    )


Delta: TypeAlias = tuple[tuple[int, int], ...]
"""Places in the values, and what they are set to, ordered by place."""
Draw: TypeAlias = tuple[Delta, Fraction, Fraction]
"""What is set, what is added to the cost, and the reward."""
Spend: TypeAlias = Callable[[int, int], None]
"""Told how many combinations were formed, and how many of them differ; ends it at a limit."""


_LOOK = 4096  # combinations of outcomes between two looks at the clock


class _Bounded:
    """Ends the multiplication of outcomes: n independent draws may have 2 to the n results."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._work = 0

    def spend(self, work: int, found: int) -> None:
        """So many combinations were formed, and so many of them differ."""
        self._work += work
        if found > self._limits.states:
            self._limits.check_states(found, "working out what an action leads to")
        if self._work > _LOOK:
            self._work = 0
            self._limits.check_time("working out what an action leads to")


def compile_action(task: Task, action: GroundAction, limits: Limits) -> Transition:
    """An action of the task as a function from values to its results: equal results merged, most probable
    first (ties by values). Results are cached per assignment. The function raises
    :class:`bbtc.diagnostics.LimitReached` where outcomes combine to more than the limit on states, or
    for longer than time and memory allow."""
    bounded = _Bounded(limits)
    drawers = [compile_factor(factor, bounded.spend) for factor in action.factors]
    if action.changes:
        from bbtc.belief.hidden import compile_change

        drawers += [compile_change(task, change, bounded.spend) for change in action.changes]
    cache: dict[Values, tuple[Result, ...]] = {}

    def results(values: Values) -> tuple[Result, ...]:
        known = cache.get(values)
        if known is None:
            known = cache[values] = _results(values, action.cost, product_of(values, drawers, bounded.spend))
        return known

    return results


def _results(values: Values, cost: Fraction, draws: dict[Draw, Fraction]) -> tuple[Result, ...]:
    merged: dict[tuple[Values, Fraction, Fraction], Fraction] = {}
    for (delta, extra, reward), probability in draws.items():
        if not probability:
            continue  # an outcome that cannot happen leads nowhere
        after = bytearray(values)
        for variable, value in delta:
            after[variable] = value
        key = (bytes(after), cost + extra, reward)
        merged[key] = merged.get(key, Fraction(0)) + probability
    results = [Result(p, c, r, v) for (v, c, r), p in merged.items()]
    return tuple(sorted(results, key=lambda r: (-r.probability, r.values, r.cost, r.reward)))


Drawer: TypeAlias = Callable[[Values], dict[Draw, Fraction]]
_Amounts: TypeAlias = Callable[[Values], tuple[Fraction, Fraction]]  # cost, reward


def product_of(values: Values, drawers: Iterable[Drawer], spend: Spend) -> dict[Draw, Fraction]:
    """Independent draws combined: sets united (the Kleene maximum where they clash), costs and
    rewards added, equal combinations merged at once so that only distinct results multiply."""
    total: dict[Draw, Fraction] = {((), Fraction(0), Fraction(0)): Fraction(1)}
    for drawer in drawers:
        drawn = drawer(values)
        combined: dict[Draw, Fraction] = {}
        for (delta, cost, reward), p in total.items():
            for (delta2, cost2, reward2), p2 in drawn.items():
                key = (_unite(delta, delta2), cost + cost2, reward + reward2)
                combined[key] = combined.get(key, Fraction(0)) + p * p2
            spend(len(drawn), len(combined))
        total = combined
    return total


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
                key = (_unite(delta, delta2), cost + cost2, reward + reward2)
                drawn[key] = drawn.get(key, Fraction(0)) + probability * p
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
