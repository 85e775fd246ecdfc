"""Where states that read alike want different actions, because what is believed in them differs: what a tree
has to ask about, too.

Thresholds on how probable something is believed to be are variables like others
(:class:`bbtc.ground.task.Knowledge`). Added are thresholds on what conditions read, and on single facts,
between levels that want different actions, as few as tell them all apart; where none tells, thresholds on
single worlds. With readings of one kind this is a counter: of how many more of them spoke for something than
against it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from typing import TypeAlias

from bbtc.belief.hidden import beliefs_of
from bbtc.belief.worlds.beliefs import Beliefs
from bbtc.ground.condition import Condition, Is, conjunction
from bbtc.ground.task import Component, InitialState, Knowledge, Task, Variable, split_name
from bbtc.kleene import Truth
from bbtc.planner.synthesis.permissive import MultiPolicy
from bbtc.rounding import short_text

_MOST_PAIRS = 2_000
_HALF = Fraction(1, 2)
_Pair: TypeAlias = tuple[int, int]
"""Numbers of two beliefs of a component."""
_Interval: TypeAlias = tuple[Fraction, Fraction]
"""Thresholds above the first, up to the second."""


def with_beliefs(task: Task, policy: MultiPolicy) -> Task | None:
    """The task with variables that tell apart states of a policy which read alike and have no action in
    common; None if there are no such states, or there is nothing to tell them apart by."""
    variables, components = list(task.variables), list(task.components)
    prior: list[Truth] = []
    for number, component in enumerate(task.components):
        pairs = list(dict.fromkeys(_conflicts(policy, number)))
        known, beliefs = list(component.known), beliefs_of(component)
        for name, condition, at_least in _thresholds(task, component, pairs):
            args = (*name.args, short_text(at_least))
            variable = Variable(f"believed-{name.predicate}", args, three_valued=True)
            if any(variable.name == each.name for each in variables):
                continue
            knowledge = Knowledge(len(variables), condition, at_least)
            variables.append(variable)
            known.append(knowledge)
            prior.append(beliefs.believed(beliefs.prior, knowledge))
        components[number] = replace(component, known=tuple(known))
    if not prior:
        return None
    initial = (InitialState(state.probability, (*state.values, *prior)) for state in task.initial)
    return replace(task, variables=tuple(variables), initial=tuple(initial), components=tuple(components))


def _conflicts(policy: MultiPolicy, component: int) -> Iterator[_Pair]:
    """Beliefs of a component in states that read alike and have no action in common."""
    actions: dict[int, set[int]] = {}
    for state, action in zip(policy.choice_state.tolist(), policy.choice_action.tolist(), strict=True):
        actions.setdefault(state, set()).add(action)
    alike: dict[bytes, list[int]] = {}
    for state in actions:
        alike.setdefault(policy.values[state].tobytes(), []).append(state)
    found = 0
    for states in alike.values():
        for one, other in combinations(states, 2):
            pair = int(policy.beliefs[one, component]), int(policy.beliefs[other, component])
            if pair[0] != pair[1] and not actions[one] & actions[other]:
                yield pair
                found += 1
                if found == _MOST_PAIRS:
                    return


def _thresholds(
    task: Task, component: Component, pairs: Sequence[_Pair]
) -> Iterator[tuple[Variable, Condition, Fraction]]:
    """Thresholds that tell pairs apart: what the condition is called, the condition, and the threshold."""
    beliefs, waiting = beliefs_of(component), list(pairs)
    # What is known of a condition names it, rather than what was believed of it before.
    surest = sorted(component.known, key=lambda each: each.at_least)
    named = {each.condition: task.variables[each.variable] for each in surest}
    for place, fact in enumerate(component.facts):
        named.setdefault(Is(place, Truth.TRUE), Variable(*split_name(fact), three_valued=True))
    for condition, name in named.items():
        yield from ((name, condition, at_least) for at_least in _piercing(beliefs, condition, waiting))
        waiting = [pair for pair in waiting if _between(beliefs, condition, pair) is None]
    index = task.components.index(component) + 1
    for place, (world, _) in enumerate(component.prior):
        if not waiting:
            return
        facts = range(len(component.facts))
        condition = conjunction(Is(at, Truth.TRUE if world >> at & 1 else Truth.FALSE) for at in facts)
        name = Variable("world", (str(index), str(place + 1)), three_valued=True)
        yield from ((name, condition, at_least) for at_least in _piercing(beliefs, condition, waiting))
        waiting = [pair for pair in waiting if _between(beliefs, condition, pair) is None]


def _piercing(beliefs: Beliefs, condition: Condition, pairs: Sequence[_Pair]) -> Iterator[Fraction]:
    """As few thresholds on a condition as lie between all pairs that it tells apart."""
    intervals = {_between(beliefs, condition, pair) for pair in pairs}
    waiting = sorted((each for each in intervals if each is not None), key=lambda each: (each[1], each[0]))
    while waiting:
        high = waiting[0][1]
        low = max(each[0] for each in waiting if each[0] < high)
        found = _shortest(low, high)
        yield found
        waiting = [each for each in waiting if not each[0] < found <= each[1]]


def _between(beliefs: Beliefs, condition: Condition, pair: _Pair) -> _Interval | None:
    """The thresholds that tell two beliefs apart."""
    one, other = (beliefs.chance(number, condition) for number in pair)
    if one == other:
        return None
    low, high = sorted(max(chance, 1 - chance) for chance in (one, other))
    # On both sides of a half, as strong: any threshold up to that tells which side.
    return (_HALF, high) if low == high else (low, high)


def _shortest(low: Fraction, high: Fraction) -> Fraction:
    """A decimal fraction above ``low``, at most ``high``, of as few digits as there is."""
    scale = 10
    while True:
        found = Fraction(high * scale // 1, scale)
        if found > low:
            return found
        scale *= 10
