"""Physical states, and the distribution of states an action leads to."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from bbtc.belief.draws import Draw, Values, add, compile_factor, product_of
from bbtc.belief.hidden import compile_change, told_first
from bbtc.ground.task import NO_CHANGE, ZERO, GroundAction, Task
from bbtc.limits import Limits
from bbtc.markov import distribution


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
    return distribution(
        (after, probability * p)
        for values, p in own.items()
        for after, probability in told_first(task, values)
    )


_LOOK = 4096  # combinations of outcomes between two looks at the clock


class Bounded:
    """A :data:`bbtc.belief.draws.Spend` that ends the multiplication of outcomes: n independent draws may
    have 2 to the n results."""

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
    bounded = Bounded(limits)
    factors = (factor for factor in action.factors if factor != NO_CHANGE)
    drawers = [compile_factor(factor, bounded.spend) for factor in factors]
    drawers += [compile_change(task, change, bounded.spend) for change in action.changes]
    cache: dict[Values, tuple[Result, ...]] = {}

    def results(values: Values) -> tuple[Result, ...]:
        known = cache.get(values)
        if known is None:
            known = cache[values] = results_of(
                values, action.cost, product_of(values, drawers, bounded.spend)
            )
        return known

    return results


def results_of(values: Values, cost: Fraction, draws: dict[Draw, Fraction]) -> tuple[Result, ...]:
    """Draws as results, equal ones merged, the most probable first (ties by values)."""
    merged: dict[tuple[Values, Fraction, Fraction], Fraction] = {}
    for (delta, extra, reward), probability in draws.items():
        if not probability:
            continue  # an outcome that cannot happen leads nowhere
        after = bytearray(values)
        for variable, value in delta:
            after[variable] = value
        key = (bytes(after), cost if extra is ZERO else cost + extra, reward)
        add(merged, key, probability)
    results = [Result(p, c, r, v) for (v, c, r), p in merged.items()]
    if len(results) > 1:
        results.sort(key=lambda r: (r.values, r.cost, r.reward))
        results.sort(key=lambda r: r.probability, reverse=True)
    return tuple(results)
