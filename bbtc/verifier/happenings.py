"""What may happen in one world: outcomes of independent factors, and what observations tell; and the worlds
that the robot holds possible then. It crosses out those in which it could not have been told what it was
told; no probability is ever conditioned."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from math import gcd, lcm
from typing import NamedTuple, TypeAlias

from bbtc.ground.condition import Condition, evaluate
from bbtc.ground.task import Change, Component, Factor, Observation
from bbtc.kleene import Truth

_ZERO, _ONE = Fraction(0), Fraction(1)

Amounts: TypeAlias = tuple[Fraction, Fraction]  # cost, reward
Happens: TypeAlias = tuple[Fraction, dict[int, int], Amounts]
Told: TypeAlias = tuple[bool | None, ...]
"""What each observation told (None: it was not made)."""


Shown: TypeAlias = tuple[tuple[int, ...], Told]
"""The values of the seen variables of a change, and what each observation told."""
Possible: TypeAlias = tuple[tuple[int, int], ...]
"""The worlds that the robot holds possible, in order, with weights: 1 where these play no part."""


class Outcome(NamedTuple):
    """One of the things that a change may do in a world."""

    world: int
    told: Shown
    probability: Fraction
    sets: tuple[tuple[int, int], ...]
    amounts: Amounts


def outcomes_of_change(
    component: Component, change: Change, world: int, seen: Sequence[int]
) -> Iterator[Outcome]:
    """All that a change may do in a world, and what the robot is told of it; ``seen`` are the values of the
    seen variables."""
    facts = len(component.facts)
    before = [*local_values(component, world), *seen]
    for p, sets, amounts in together(change.factors, before):
        values = list(before)
        for local, value in sets.items():
            values[local] = value
        after = sum(1 << bit for bit in range(facts) if values[bit] == Truth.TRUE)
        visible = tuple((change.seen[k - facts], v) for k, v in sorted(sets.items()) if k >= facts)
        for q, told in readings(change.observations, values):
            yield Outcome(after, (tuple(values[facts:]), told), p * q, visible, amounts)


def is_weighed(component: Component) -> bool:
    """Does anything ask how probable something is?"""
    return any(each.at_least < 1 for each in component.known)


def prior_worlds(prior: Iterable[tuple[int, Fraction]], weighed: bool) -> Possible:
    """The worlds that are possible before anything is told."""
    likely = [(world, p) for world, p in sorted(prior) if p]
    scale = lcm(*(p.denominator for _, p in likely)) if weighed else 1
    return tuple((world, int(p * scale) if weighed else 1) for world, p in likely)


def possible_worlds(mass: dict[int, Fraction], weighed: bool) -> Possible:
    """The worlds of some weight."""
    if not weighed:
        return tuple((world, 1) for world, weight in sorted(mass.items()) if weight)
    scale = lcm(*(weight.denominator for weight in mass.values()))
    whole = {world: int(weight * scale) for world, weight in sorted(mass.items()) if weight}
    common = gcd(*whole.values())
    return tuple((world, weight // common) for world, weight in whole.items())


def known_of(component: Component, possible: Possible) -> list[tuple[int, int]]:
    """The values of the task's variables that tell what is known of a component."""
    total = sum(weight for _, weight in possible)
    found = []
    for each in component.known:
        true = sum(weight for world, weight in possible if holds(component, each.condition, world))
        if true >= each.at_least * total:
            found.append((each.variable, 2))
        else:
            found.append((each.variable, 0 if total - true >= each.at_least * total else 1))
    return found


def local_values(component: Component, world: int) -> list[int]:
    """The values of the facts of a component in a world."""
    return [2 * (world >> bit & 1) for bit in range(len(component.facts))]


def holds(component: Component, condition: Condition, world: int) -> bool:
    """Is a condition over the facts of a component true in a world?"""
    return evaluate(condition, local_values(component, world)) is Truth.TRUE


def readings(observations: Sequence[Observation], values: Sequence[int]) -> list[tuple[Fraction, Told]]:
    """What observations may tell where the local variables have these values."""
    found: list[tuple[Fraction, Told]] = [(_ONE, ())]
    for each in observations:
        if each.when is not None and evaluate(each.when, values) is not Truth.TRUE:
            tells: list[tuple[Fraction, bool | None]] = [(_ONE, None)]
        else:
            true = evaluate(each.condition, values) is Truth.TRUE
            right = each.right(true)
            tells = [(right, true), (1 - right, not true)]
        found = [(p * q, (*told, tell)) for p, told in found for q, tell in tells if q]
    return found


def together(factors: Sequence[Factor], values: Sequence[int]) -> list[Happens]:
    """What independent factors may do: what is set, where of several values the greatest stays, and what is
    added to cost and reward."""
    found: list[Happens] = [(_ONE, {}, (_ZERO, _ZERO))]
    for factor in factors:
        drawn: list[Happens] = []
        for outcome in factor.outcomes:
            if not outcome.probability:
                continue
            sets: dict[int, int] = {}
            for effect in outcome.effects:
                if effect.when is None or evaluate(effect.when, values) is Truth.TRUE:
                    add(sets, effect.sets)
            due = [each for each in outcome.charges if evaluate(each.when, values) is Truth.TRUE]
            cost = sum((each.cost for each in due), outcome.cost)
            reward = sum((each.reward for each in due), outcome.reward)
            for p, inner, (more_cost, more_reward) in together(outcome.factors, values):
                both = dict(sets)
                add(both, inner.items())
                drawn.append((outcome.probability * p, both, (cost + more_cost, reward + more_reward)))
        combined = []
        for p, one, (cost, reward) in found:
            for q, other, (more_cost, more_reward) in drawn:
                both = dict(one)
                add(both, other.items())
                combined.append((p * q, both, (cost + more_cost, reward + more_reward)))
        found = combined
    return found


def add(sets: dict[int, int], more: Iterable[tuple[int, int]]) -> None:
    """Set more; of two values for one variable the greater stays."""
    for variable, value in more:
        sets[variable] = max(int(value), sets.get(variable, 0))
