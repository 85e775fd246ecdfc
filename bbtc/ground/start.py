"""The initial belief: certain facts, a probabilistic ``:init`` spelled out into states, and what is drawn
where the robot does not see it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.kleene import Truth
from bbtc.limits import MOST_WORLDS, Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.formula import is_parameter
from bbtc.model.hidden import has_hidden_state, has_oneof
from bbtc.model.types import Parameter
from bbtc.source import Span

Key = tuple[str, tuple[str, ...]]
World = dict[Key, Truth]


@dataclass(frozen=True, slots=True)
class HiddenDraw:
    """One of some branches is the case, unseen: the atoms of a branch are true, all others of the draw
    false."""

    atoms: tuple[Key, ...]
    branches: tuple[tuple[Fraction, frozenset[Key]], ...]
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class Prior:
    """What is hidden at the start: draws, conditions that are known to hold, without quantifiers, and all
    atoms of which it is not known whether they are true. Those that stand in no draw are drawn one by
    one."""

    draws: tuple[HiddenDraw, ...]
    clauses: tuple[md.InitialClause, ...]
    atoms: tuple[Key, ...]


@dataclass(frozen=True, slots=True)
class Beginning:
    """Facts of every initial state, and what each state adds to (or changes in) them. With a ``prior``, what
    is hidden has each value in one of the states, which only tells what is possible."""

    facts: World
    states: tuple[tuple[Fraction, World], ...]
    prior: Prior | None = None


def beginning(model: md.Model, report: Report, limits: Limits) -> Beginning:
    """The initial states of a model, but for what is :func:`refused <bbtc.ground.refused.refused>` anyway.
    Errors: too many of them (BBT0403), draws that contradict facts (BBT0414)."""
    facts = {(fact.predicate, fact.args): fact.value for fact in model.init.facts}
    if has_hidden_state(model):
        prior = _prior(model, facts, report, limits)
        values = (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN)
        states = tuple((Fraction(1, 3), dict.fromkeys(prior.atoms, value)) for value in values)
        return Beginning(facts, states, prior)
    return Beginning(facts, _seen(model, report, limits))


def _seen(model: md.Model, report: Report, limits: Limits) -> tuple[tuple[Fraction, World], ...]:
    """The initial states of which the robot sees which one is the case."""
    states: list[tuple[Fraction, World]] = [(Fraction(1), {})]
    for choice in model.init.choices:
        try:
            states = _product([states, _draw(model, choice, {}, limits)], limits)
        except _TooMany:
            report.error(
                "BBT0403",
                f"the draws in `:init` make more than {limits.initial_states} initial states",
                choice.span,
            )
            break
    return tuple(states)


# --- what is hidden ------------------------------------------------------------------------------


def _prior(model: md.Model, facts: World, report: Report, limits: Limits) -> Prior:
    limits = replace(limits, initial_states=MOST_WORLDS)
    even: list[HiddenDraw] = []
    weighted: list[tuple[list[tuple[Fraction, World]], Span | None]] = []
    for choice in model.init.choices:
        try:
            for part in _parts(model, choice, limits):
                if isinstance(part, me.Choice) and part.oneof:
                    even.append(_one_of(model, part, limits))
                else:
                    weighted.append((_draw(model, part, {}, limits), part.span))
        except _TooMany:
            report.error(
                "BBT0404" if has_oneof(choice) else "BBT0403",
                f"a draw in `:init` has more than {MOST_WORLDS:,} results",
                choice.span,
                "what is hidden is listed world by world: draw facts that are independent one by one",
            )
    draws = [*_joined(weighted, facts, limits), *even]
    drawn = {key for results, _ in weighted for _, world in results for key in world}
    fixed = {key: value for key, value in facts.items() if value is not Truth.UNKNOWN and key not in drawn}
    draws = [_within(draw, fixed, report) for draw in draws]
    clauses = tuple(
        replace(clause, condition=_spelled(model, clause.condition, limits)) for clause in model.init.clauses
    )
    atoms = [key for key, value in facts.items() if value is Truth.UNKNOWN]
    atoms += [key for draw in draws for key in draw.atoms]
    atoms += [(atom.predicate, atom.args) for clause in clauses for atom in mf.atoms(clause.condition)]
    for name, threshold in model.thresholds.items():
        for count, binding in enumerate(_bindings(model, threshold.parameters)):
            limits.check_bindings(count)
            atoms.append((name, tuple(binding.values())))
    return Prior(tuple(draws), clauses, tuple(dict.fromkeys(key for key in atoms if key not in fixed)))


def _parts(model: md.Model, effect: me.Effect, limits: Limits) -> Iterator[me.Effect]:
    """The draws that are made independently."""
    match effect:
        case me.Together(parts):
            for part in parts:
                yield from _parts(model, part, limits)
        case me.ForEach(parameters, inner):
            for count, binding in enumerate(_bindings(model, parameters)):
                limits.check_bindings(count)
                yield from _parts(model, me.substitute(inner, {**binding}), limits)
        case _:
            yield effect


def _one_of(model: md.Model, choice: me.Choice, limits: Limits) -> HiddenDraw:
    """Exactly one of some literals is true; or one of some branches is the case, and what only others
    say is false."""
    if len(choice.branches) > MOST_WORLDS:
        raise _TooMany
    literals = [branch.effect for branch in choice.branches if isinstance(branch.effect, me.Set)]
    share = Fraction(1, len(choice.branches))
    found: list[tuple[Fraction, frozenset[Key]]] = []
    keys = [(literal.predicate, literal.args) for literal in literals]
    if len(literals) == len(choice.branches) and Truth.UNKNOWN not in {each.value for each in literals}:
        negative = {key for key, literal in zip(keys, literals, strict=True) if literal.value is Truth.FALSE}
        for key, literal in zip(keys, literals, strict=True):
            is_true = literal.value is Truth.TRUE
            found.append((share, frozenset(negative | {key} if is_true else negative - {key})))
        return HiddenDraw(tuple(dict.fromkeys(keys)), tuple(found), choice.span)
    results = [
        (share * probability, world)
        for branch in choice.branches
        for probability, world in _draw(model, branch.effect, {}, limits)
    ]
    return _hidden(results, {}, choice.span)


def _hidden(results: list[tuple[Fraction, World]], facts: World, span: Span | None) -> HiddenDraw:
    """A draw of these results; an atom of which a result says nothing has the value of the facts."""
    atoms = tuple(dict.fromkeys(key for _, world in results for key in world))
    given = {key for key in atoms if facts.get(key) is Truth.TRUE}
    branches: dict[frozenset[Key], Fraction] = {}
    for probability, world in results:
        true = {key for key, value in world.items() if value is Truth.TRUE} | (given - world.keys())
        open_ = [key for key, value in world.items() if value is Truth.UNKNOWN]
        if 2 ** len(open_) * len(results) > MOST_WORLDS:
            raise _TooMany
        for picked in product((False, True), repeat=len(open_)):
            both = frozenset(true.union(key for key, pick in zip(open_, picked, strict=True) if pick))
            branches[both] = branches.get(both, Fraction(0)) + probability / 2 ** len(open_)
    return HiddenDraw(atoms, tuple((weight, true) for true, weight in branches.items()), span)


def _joined(
    weighted: list[tuple[list[tuple[Fraction, World]], Span | None]], facts: World, limits: Limits
) -> Iterator[HiddenDraw]:
    """Weighted draws as hidden ones; those that draw the same atom are one."""
    groups: list[tuple[set[Key], list[int]]] = []
    owner: dict[Key, int] = {}
    for number, (results, _) in enumerate(weighted):
        keys = {key for _, world in results for key in world}
        into = sorted({owner[key] for key in keys if key in owner})
        numbers = [number]
        for group in into:
            keys |= groups[group][0]
            numbers += groups[group][1]
            groups[group] = set(), []
        owner.update(dict.fromkeys(keys, len(groups)))
        groups.append((keys, sorted(numbers)))
    for keys, numbers in groups:
        if keys:
            results = _product((weighted[number][0] for number in numbers), limits)
            yield _hidden(results, facts, weighted[numbers[0]][1])


def _within(draw: HiddenDraw, fixed: Mapping[Key, Truth], report: Report) -> HiddenDraw:
    """The draw of what is not fixed, given what is."""
    given = {key: fixed[key] is Truth.TRUE for key in draw.atoms if key in fixed}
    if not given:
        return draw
    true = {key for key, value in given.items() if value}
    false = given.keys() - true
    left = [
        (weight, branch - true) for weight, branch in draw.branches if true <= branch and not branch & false
    ]
    if not left:
        contradicted(report, draw.span)
    return replace(draw, atoms=tuple(key for key in draw.atoms if key not in given), branches=tuple(left))


def contradicted(report: Report, span: Span | None) -> None:
    """Report that no world meets all that ``:init`` says."""
    report.error(
        "BBT0414",
        "what `:init` says of hidden facts contradicts itself: no world is left",
        span,
        "exactly one branch of a `oneof` holds, and every `or`, beside the facts that are given",
    )


def _spelled(model: md.Model, formula: mf.Formula, limits: Limits) -> mf.Formula:
    """A closed formula without quantifiers."""
    match formula:
        case mf.Not(part, span):
            return mf.Not(_spelled(model, part, limits), span)
        case mf.And(parts, span):
            return mf.And(tuple(_spelled(model, part, limits) for part in parts), span)
        case mf.Or(parts, span):
            return mf.Or(tuple(_spelled(model, part, limits) for part in parts), span)
        case mf.Quantified(kind, parameters, part, span):
            every: list[mf.Formula] = []
            for binding in _bindings(model, parameters):
                every.append(_spelled(model, mf.substitute(part, {**binding}), limits))
                limits.check_bindings(len(every))
            return mf.And(tuple(every), span) if kind == "forall" else mf.Or(tuple(every), span)
        case mf.Atom() | mf.Test() | mf.Equal() | mf.Compare():
            return formula
        case _:
            assert_never(formula)


def _bindings(model: md.Model, parameters: tuple[Parameter, ...]) -> Iterator[dict[str, str]]:
    members = [
        [name for name, thing in model.objects.items() if model.types.contains(p.types, thing)]
        for p in parameters
    ]
    names = [parameter.name for parameter in parameters]
    return (dict(zip(names, objects, strict=True)) for objects in product(*members))


# --- draws -------------------------------------------------------------------------------------


class _TooMany(Exception):
    """A draw has more results than the limit allows."""


def _draw(
    model: md.Model, effect: me.Effect, binding: dict[str, str], limits: Limits
) -> list[tuple[Fraction, World]]:
    match effect:
        case me.Set(predicate, args, value):
            atom = (predicate, tuple(binding[arg] if is_parameter(arg) else arg for arg in args))
            return [(Fraction(1), {atom: value})]
        case me.Add() | me.Change():
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
            # One after the other: mostly there are too many results long before there are too many bindings.
            return _product(
                (_draw(model, inner, {**binding, **bound}, limits) for bound in _bindings(model, parameters)),
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
