"""A task that begins elsewhere, too: in states that others may leave it in.

A tree that was planned from there goes on where it is not expected to be. One fact of an initial state, or
one group of facts that exclude one another, such as the places of a robot, has another value that actions can
give it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from bbtc.ground.task import Factor, InitialState, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.strong_cyclic.determinised import Determinised
from bbtc.planner.strong_cyclic.exclusion import Exclusion

MOST_STARTS = 100
"""So many other initial states are considered, those of facts with low numbers first."""

_SHARE = Fraction(1, 1000)


def starts_elsewhere(task: Task, limits: Limits) -> list[tuple[Truth, ...]]:
    """Initial states that the task does not have. Raises ``LimitReached``."""
    groups = Exclusion(Determinised(task, limits), limits).groups
    single = [each for each in range(len(task.variables)) if not any(each in group for group in groups)]
    settable = _settable(task)
    own = {initial.values for initial in task.initial}
    found: dict[tuple[Truth, ...], None] = {}
    for values in dict.fromkeys(initial.values for initial in task.initial):
        for group in groups:
            for member in group:
                if values[member] is not Truth.TRUE and Truth.TRUE in settable[member]:
                    others = dict.fromkeys(group, Truth.FALSE)
                    found[_changed(values, {**others, member: Truth.TRUE})] = None
        for variable in single:
            for value in sorted(settable[variable] - {values[variable]}):
                found[_changed(values, {variable: value})] = None
    return [values for values in found if values not in own][:MOST_STARTS]


def only_at(task: Task, starts: Sequence[tuple[Truth, ...]]) -> Task:
    """The task, beginning in one of these states, all equally likely."""
    share = Fraction(1, len(starts))
    return replace(task, initial=tuple(InitialState(share, values) for values in starts))


def also_at(task: Task, starts: Sequence[tuple[Truth, ...]]) -> Task:
    """The task, with a small share of the runs beginning in these states."""
    own = tuple(replace(each, probability=each.probability * (1 - _SHARE)) for each in task.initial)
    share = _SHARE / len(starts)
    return replace(task, initial=(*own, *(InitialState(share, values) for values in starts)))


def _changed(values: tuple[Truth, ...], changes: dict[int, Truth]) -> tuple[Truth, ...]:
    return tuple([changes.get(number, value) for number, value in enumerate(values)])


def _settable(task: Task) -> list[set[Truth]]:
    """The values that each variable has at the start or by an action."""
    found: list[set[Truth]] = [set() for _ in task.variables]
    for initial in task.initial:
        for number, value in enumerate(initial.values):
            found[number].add(value)
    for action in task.actions:
        for number, value in _sets(action.factors):
            found[number].add(value)
    return found


def _sets(factors: Iterable[Factor]) -> Iterator[tuple[int, Truth]]:
    for factor in factors:
        for outcome in factor.outcomes:
            for effect in outcome.effects:
                yield from effect.sets
            yield from _sets(outcome.factors)
