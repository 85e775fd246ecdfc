"""The initial belief: certain facts, and a probabilistic ``:init`` spelled out into states."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.ground.refused import has_oneof
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model.formula import is_parameter

Key = tuple[str, tuple[str, ...]]
World = dict[Key, Truth]


@dataclass(frozen=True, slots=True)
class Beginning:
    """Facts of every initial state, and what each state adds to (or changes in) them."""

    facts: World
    states: tuple[tuple[Fraction, World], ...]


def beginning(model: md.Model, report: Report, limits: Limits) -> Beginning:
    """The initial states of a model, but for what is :func:`refused <bbtc.ground.refused.refused>` anyway.
    Too many of them are an error (BBT0403)."""
    facts = {(fact.predicate, fact.args): fact.value for fact in model.init.facts}
    states: list[tuple[Fraction, World]] = [(Fraction(1), {})]
    for choice in model.init.choices:
        if has_oneof(choice):
            continue
        try:
            states = _product([states, _draw(model, choice, {}, limits)], limits)
        except _TooMany:
            report.error(
                "BBT0403",
                f"the draws in `:init` make more than {limits.initial_states} initial states",
                choice.span,
            )
            break
    return Beginning(facts, tuple(states))


class _TooMany(Exception):
    """A draw has more results than the limit allows."""


def _draw(
    model: md.Model, effect: me.Effect, binding: dict[str, str], limits: Limits
) -> list[tuple[Fraction, World]]:
    match effect:
        case me.Set(predicate, args, value):
            atom = (predicate, tuple(binding[arg] if is_parameter(arg) else arg for arg in args))
            return [(Fraction(1), {atom: value})]
        case me.Add():
            return [(Fraction(1), {})]
        case me.When(_, inner):
            return _draw(model, inner, binding, limits)
        case me.Choice(branches):
            return _merged(
                [
                    (branch.probability * p, world)
                    for branch in branches
                    if branch.probability > 0
                    for p, world in _draw(model, branch.effect, binding, limits)
                ]
            )
        case me.Together(parts):
            return _product((_draw(model, part, binding, limits) for part in parts), limits)
        case me.ForEach(parameters, inner):
            members = [
                [name for name, thing in model.objects.items() if model.types.contains(p.types, thing)]
                for p in parameters
            ]
            names = [parameter.name for parameter in parameters]
            # One after the other: mostly there are too many results long before there are too many bindings.
            return _product(
                (
                    _draw(model, inner, {**binding, **dict(zip(names, objects, strict=True))}, limits)
                    for objects in product(*members)
                ),
                limits,
            )
        case _:
            assert_never(effect)


def _product(draws: Iterable[list[tuple[Fraction, World]]], limits: Limits) -> list[tuple[Fraction, World]]:
    limit = limits.initial_states
    result: list[tuple[Fraction, World]] = [(Fraction(1), {})]
    for count, draw in enumerate(draws, 1):
        limits.check_bindings(count)
        limits.check_time("grounding")
        if len(result) * len(draw) > 4 * limit:
            raise _TooMany
        result = _merged([(p * q, _both(world, more)) for p, world in result for q, more in draw])
        if len(result) > limit:
            raise _TooMany
    return result


def _both(one: World, other: World) -> World:
    """What two draws say together: as in effects, the greater value wins, whatever their order."""
    return {**one, **{atom: max(value, one.get(atom, value)) for atom, value in other.items()}}


def _merged(draws: list[tuple[Fraction, World]]) -> list[tuple[Fraction, World]]:
    merged: dict[frozenset[tuple[Key, Truth]], tuple[Fraction, World]] = {}
    for probability, world in draws:
        key = frozenset(world.items())
        before = merged.get(key)
        merged[key] = (probability if before is None else before[0] + probability, world)
    return list(merged.values())
