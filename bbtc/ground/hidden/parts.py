"""The effects of an action taken apart: what is certain, and draws."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import NamedTuple

from bbtc.ground import task as gt
from bbtc.ground.condition import TRUE, Condition, disjunction, is_test, leaves
from bbtc.kleene import Truth


class Setting(NamedTuple):
    """Sets a variable where ``when`` is true before the action (None: always)."""

    when: Condition | None
    variable: int
    value: Truth


@dataclass(slots=True)
class Parts:
    """What happens certainly, and the draws beside it, none of whose effects all of its outcomes have."""

    settings: list[Setting] = field(default_factory=list)
    charges: list[gt.Charge] = field(default_factory=list)
    cost: Fraction = gt.ZERO
    reward: Fraction = gt.ZERO
    draws: list[gt.Factor] = field(default_factory=list)


def parts_of(factors: Iterable[gt.Factor]) -> Parts:
    """The parts of some factors."""
    parts = Parts()
    for factor in factors:
        _take(parts, factor)
    return parts


def _take(parts: Parts, factor: gt.Factor) -> None:
    if len(factor.outcomes) == 1:
        (only,) = factor.outcomes
        parts.settings += settings_of(only)
        parts.charges += only.charges
        parts.cost += only.cost
        parts.reward += only.reward
        for inner in only.factors:
            _take(parts, inner)
        return
    every = [dict.fromkeys(settings_of(outcome)) for outcome in factor.outcomes]
    common = {setting: None for setting in every[0] if all(setting in each for each in every)}
    parts.settings += common
    rest = [
        replace(outcome, effects=effects_of(setting for setting in settings if setting not in common))
        for outcome, settings in zip(factor.outcomes, every, strict=True)
    ]
    merged = gt.Factor(gt.merge_outcomes(rest), factor.oneof)
    if len(merged.outcomes) == 1:
        _take(parts, merged)
    else:
        parts.draws.append(merged)


def settings_of(outcome: gt.Outcome) -> Iterator[Setting]:
    """What an outcome sets, without what is nested in it."""
    return (
        Setting(effect.when, variable, value) for effect in outcome.effects for variable, value in effect.sets
    )


def effects_of(settings: Iterable[Setting]) -> tuple[gt.Effect, ...]:
    """Settings as effects, one for each condition."""
    grouped: dict[Condition | None, dict[int, Truth]] = {}
    for when, variable, value in settings:
        sets = grouped.setdefault(when, {})
        sets[variable] = max(value, sets.get(variable, value))
    return tuple(gt.Effect(when, tuple(sorted(sets.items()))) for when, sets in grouped.items())


def facts_read(condition: Condition | None) -> set[int]:
    """The variables whose values in the world a condition reads."""
    return set() if condition is None else {leaf.variable for leaf in leaves(condition) if not is_test(leaf)}


def tests_read(condition: Condition | None) -> set[int]:
    """The variables of which a condition asks whether they are known."""
    return set() if condition is None else {leaf.variable for leaf in leaves(condition) if is_test(leaf)}


def all_settings(factors: Iterable[gt.Factor]) -> Iterator[Setting]:
    """Everything that some occurrence of the factors sets."""
    return (setting for outcome in gt.outcomes_of(factors) for setting in settings_of(outcome))


def facts_of(factor: gt.Factor) -> set[int]:
    """The variables that a factor sets, or whose values in the world it reads."""
    found: set[int] = set()
    for outcome in gt.outcomes_of([factor]):
        for setting in settings_of(outcome):
            found |= facts_read(setting.when) | {setting.variable}
        for charge in outcome.charges:
            found |= facts_read(charge.when)
    return found


def drawn_anew(parts: Parts, odds: Mapping[int, Fraction]) -> Parts:
    """The parts in which what becomes unknown is drawn: true with the probability that ``odds`` gives, else
    with 1/2."""
    forgets: dict[int, list[Condition]] = {}
    for setting in parts.settings:
        if setting.value is Truth.UNKNOWN:
            forgets.setdefault(setting.variable, []).append(TRUE if setting.when is None else setting.when)
    settings = [setting for setting in parts.settings if setting.value is not Truth.UNKNOWN]
    draws = [
        replace(draw, outcomes=tuple(_anew(outcome, odds) for outcome in draw.outcomes))
        for draw in parts.draws
    ]
    draws += [_coin(variable, disjunction(whens), odds) for variable, whens in forgets.items()]
    return Parts(settings, parts.charges, parts.cost, parts.reward, draws)


def _anew(outcome: gt.Outcome, odds: Mapping[int, Fraction]) -> gt.Outcome:
    known, coins = [], []
    for setting in settings_of(outcome):
        if setting.value is Truth.UNKNOWN:
            coins.append(_coin(setting.variable, TRUE if setting.when is None else setting.when, odds))
        else:
            known.append(setting)
    inner = [
        replace(factor, outcomes=tuple(_anew(each, odds) for each in factor.outcomes))
        for factor in outcome.factors
    ]
    return replace(outcome, effects=effects_of(known), factors=(*inner, *coins))


def _coin(variable: int, when: Condition, odds: Mapping[int, Fraction]) -> gt.Factor:
    true = odds.get(variable, Fraction(1, 2))
    guard = None if when == TRUE else when
    return gt.Factor(
        tuple(
            gt.Outcome(probability, (gt.Effect(guard, ((variable, value),)),))
            for value, probability in ((Truth.TRUE, true), (Truth.FALSE, 1 - true))
        )
    )


def only(factor: gt.Factor, kept: Set[int]) -> gt.Factor | None:
    """A factor without effects on variables that are not kept; None where nothing is left of it."""
    outcomes = gt.merge_outcomes(_only(outcome, kept) for outcome in factor.outcomes)
    (first, *_) = outcomes
    plain = first.effects or first.factors or first.charges or first.cost or first.reward
    return gt.Factor(outcomes, factor.oneof) if len(outcomes) > 1 or plain else None


def _only(outcome: gt.Outcome, kept: Set[int]) -> gt.Outcome:
    inner = [only(factor, kept) for factor in outcome.factors]
    effects = effects_of(setting for setting in settings_of(outcome) if setting.variable in kept)
    return replace(outcome, effects=effects, factors=tuple(each for each in inner if each is not None))
