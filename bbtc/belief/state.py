"""Physical states, and the distribution of states an action leads to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from bbtc.belief.draws import Draw, Values, add, compile_factor, product_of
from bbtc.belief.hidden import compile_change, told_first
from bbtc.ground.condition import TRUE, compile_condition
from bbtc.ground.task import NO_CHANGE, ONE, ZERO, GroundAction, GroundEvent, Task
from bbtc.kleene import Truth
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


def compile_parts(task: Task, action: GroundAction, limits: Limits) -> tuple[Transition, Transition]:
    """An action with events that may end it, in two parts: what happens where it goes on to its end, and
    where it is aborted. The probabilities of the results of both sum to 1, together."""
    bounded = Bounded(limits)
    own, abort = _compile_own(task, action, bounded), _compile_abort(action, bounded)
    events = _compile_events(task.rounds(action), bounded)
    goes_on = compile_condition(action.during or TRUE)

    def part(ends: Transition, *, aborted: bool) -> Transition:
        def some(values: Values) -> tuple[Result, ...]:
            return () if (goes_on(values) != Truth.TRUE) is not aborted else ends(values)

        return _cached(lambda values: _merged(_then(events(values), some), bounded))

    return part(own, aborted=False), part(abort, aborted=True)


def compile_action(task: Task, action: GroundAction, limits: Limits) -> Transition:
    """An action of the task, and the events that happen with it, as a function from values to the results:
    equal results merged, most probable first (ties by values). Results are cached per assignment. The
    function raises :class:`bbtc.diagnostics.LimitReached` where outcomes combine to more than the limit on
    states, or for longer than time and memory allow."""
    bounded = Bounded(limits)
    own = _compile_own(task, action, bounded)
    if not task.events and action.during is None:
        return own
    if action.during is None:
        events = _compile_events(task.rounds(action), bounded)
        return _cached(lambda values: _merged(_then(own(values), events), bounded))
    ends, aborted = compile_parts(task, action, limits)
    return _cached(lambda values: _merged((*ends(values), *aborted(values)), bounded))


def _compile_own(task: Task, action: GroundAction, bounded: Bounded) -> Transition:
    """What an action does by itself."""
    factors = (factor for factor in action.factors if factor != NO_CHANGE)
    drawers = [compile_factor(factor, bounded.spend) for factor in factors]
    drawers += [compile_change(task, change, bounded.spend) for change in action.changes]
    return _cached(lambda values: results_of(values, action.cost, product_of(values, drawers, bounded.spend)))


def _compile_abort(action: GroundAction, bounded: Bounded) -> Transition:
    """What an action does where it is aborted."""
    drawers = [compile_factor(factor, bounded.spend) for factor in action.on_abort]
    return _cached(lambda values: results_of(values, action.cost, product_of(values, drawers, bounded.spend)))


def _compile_events(rounds: Iterable[tuple[GroundEvent, ...]], bounded: Bounded) -> Transition:
    """The events of one draw, round by round."""

    def compile_round(events: tuple[GroundEvent, ...]) -> Transition:
        own = [
            (compile_condition(event.precondition), [compile_factor(f, bounded.spend) for f in event.factors])
            for event in events
        ]

        def happen(values: Values) -> tuple[Result, ...]:
            due = (each for ready, drawers in own if ready(values) == Truth.TRUE for each in drawers)
            return results_of(values, ZERO, product_of(values, due, bounded.spend))

        return _cached(happen)

    compiled = [compile_round(events) for events in rounds]

    def all_rounds(values: Values) -> tuple[Result, ...]:
        results: tuple[Result, ...] = (Result(ONE, ZERO, ZERO, values),)
        for happen in compiled:
            results = _merged(_then(results, happen), bounded)
        return results

    return _cached(all_rounds) if len(compiled) > 1 else compiled[0] if compiled else all_rounds


def _then(results: Iterable[Result], after: Transition) -> Iterator[Result]:
    """What follows from each result, in turn."""
    for probability, cost, reward, values in results:
        for each in after(values):
            yield Result(probability * each.probability, cost + each.cost, reward + each.reward, each.values)


def _merged(results: Iterable[Result], bounded: Bounded) -> tuple[Result, ...]:
    """Equal results merged, the most probable first."""
    merged: dict[tuple[Values, Fraction, Fraction], Fraction] = {}
    for work, (probability, cost, reward, values) in enumerate(results, 1):
        add(merged, (values, cost, reward), probability)
        if work % _LOOK == 0:
            bounded.spend(_LOOK + 1, len(merged))
    return _ranked(merged)


def _cached(compute: Transition) -> Transition:
    cache: dict[Values, tuple[Result, ...]] = {}

    def results(values: Values) -> tuple[Result, ...]:
        known = cache.get(values)
        if known is None:
            known = cache[values] = compute(values)
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
    return _ranked(merged)


def _ranked(merged: Mapping[tuple[Values, Fraction, Fraction], Fraction]) -> tuple[Result, ...]:
    results = [Result(p, c, r, v) for (v, c, r), p in merged.items()]
    if len(results) > 1:
        results.sort(key=lambda r: (r.values, r.cost, r.reward))
        results.sort(key=lambda r: r.probability, reverse=True)
    return tuple(results)
