"""Lifted effects and conditions in normal form.

Of effects (:func:`normalise`), ``chance`` being ``probabilistic`` or ``oneof``, these rules leave settings
and chances that stand side by side, each with its quantifiers around its guard:

1. ``(forall (?x) (and d e))`` → ``(and (forall (?x) d) (forall (?x) e))``; so with ``when`` for ``forall``
2. ``(when f (when g e))`` → ``(when (and f g) e)``, the guard in normal form
3. ``(when f (forall (?x) e))`` → ``(forall (?x) (when f e))``: no quantifier takes a name from around it
4. ``(forall (?x) (forall (?y) e))`` → ``(forall (?x ?y) e)``
5. ``(chance p d 0 e)`` → ``(chance p d)``
6. ``(chance 1 e)`` → ``e``

Of conditions (:func:`normal_form`), these leave negations of atoms and equations only, and quantifiers of one
parameter each, with nothing inside that does not read it. They are exact in strong Kleene logic, which is a
distributive lattice where negation reverses the order:

7. ``(not (not f))`` → ``f``
8. ``(not (and f g))`` → ``(or (not f) (not g))``; so with ``and`` and ``or`` exchanged
9. ``(not (forall (?x) f))`` → ``(exists (?x) (not f))``; so with ``exists`` and ``forall`` exchanged
10. ``(not (unknown p))`` → ``(known p)``; so with ``known`` and ``unknown`` exchanged
11. ``(forall (?x ?y) f)`` → ``(forall (?x) (forall (?y) f))``; so with ``exists``
12. ``(exists (?x) (and f (g ?x)))`` → ``(and f (exists (?x) (g ?x)))``; so with ``forall`` and ``or``
13. ``(not (< a b))`` → ``(>= a b)``; so with the other comparisons
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from typing_extensions import assert_never

from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.amount import functions
from bbtc.model.types import Parameter

# --- effects ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Item:
    """For every binding of ``parameters``: the leaf, where all of ``guard`` is true."""

    parameters: tuple[Parameter, ...]
    guard: tuple[mf.Formula, ...]
    leaf: me.Leaf


@dataclass(frozen=True, slots=True)
class Chance:
    """For every binding of ``parameters``, independently: one of the branches, which changes
    something only where all of ``guard`` is true. Probabilities are positive and sum to 1."""

    parameters: tuple[Parameter, ...]
    guard: tuple[mf.Formula, ...]
    branches: tuple[tuple[Fraction, Block], ...]
    oneof: bool
    timeout: me.TimeOut | None = None
    """What the probabilities follow from, if they are not those of the branches."""


@dataclass(frozen=True, slots=True)
class Block:
    """All items and one branch of each chance, at once."""

    items: tuple[Item, ...] = ()
    chances: tuple[Chance, ...] = ()


def normalise(effect: me.Effect) -> Block:
    """The effect as single settings with their quantifiers and guard, beside the chances they are
    drawn with, by rules 1 to 6."""
    items: list[Item] = []
    chances: list[Chance] = []
    _walk(effect, (), (), items, chances)
    return Block(tuple(items), tuple(chances))


def _walk(
    effect: me.Effect,
    parameters: tuple[Parameter, ...],
    guard: tuple[mf.Formula, ...],
    items: list[Item],
    chances: list[Chance],
) -> None:
    match effect:
        case me.Set() | me.Add() | me.Change():
            items.append(Item(parameters, guard, effect))
        case me.Together(parts):  # 1
            for part in parts:
                _walk(part, parameters, guard, items, chances)
        case me.When(condition, inner):  # 2
            _walk(inner, parameters, (*guard, *conjuncts(normal_form(condition))), items, chances)
        case me.ForEach(more, inner):  # 3, 4
            _walk(inner, parameters + more, guard, items, chances)
        case me.Choice(branches, _, _, me.TimeOut() as timeout):
            drawn = tuple((branch.probability, normalise(branch.effect)) for branch in branches)
            chances.append(Chance(parameters, guard, drawn, False, timeout))
        case me.Choice(branches, oneof):
            possible = [branch for branch in branches if branch.probability > 0]  # 5
            if len(possible) == 1:  # 6
                _walk(possible[0].effect, parameters, guard, items, chances)
            elif possible:
                drawn = tuple((branch.probability, normalise(branch.effect)) for branch in possible)
                chances.append(Chance(parameters, guard, drawn, oneof))
        case _:
            assert_never(effect)


@dataclass(frozen=True, slots=True)
class Group:
    """For every binding of ``parameters``: all the leaves, where all of ``guard`` is true."""

    parameters: tuple[Parameter, ...]
    guard: tuple[mf.Formula, ...]
    leaves: tuple[me.Leaf, ...]

    @property
    def sets(self) -> list[me.Set]:
        """What the leaves may set."""
        return [each for leaf in self.leaves for each in me.sets_of(leaf)]


def groups(block: Block) -> Iterator[Group]:
    """The items of a block by parameters and guard, in order of appearance."""
    found: dict[tuple[tuple[Parameter, ...], tuple[mf.Formula, ...]], list[me.Leaf]] = {}
    for item in block.items:
        found.setdefault((item.parameters, item.guard), []).append(item.leaf)
    return (Group(parameters, guard, tuple(leaves)) for (parameters, guard), leaves in found.items())


def reads(block: Block) -> Iterator[str]:
    """The terms of a block, repeats and those that it binds itself included."""
    for item in block.items:
        for part in item.guard:
            yield from mf.free(part)
        match item.leaf:
            case me.Set(_, args):
                yield from args
            case me.Add(amount=amount):
                yield from _terms(amount)
            case me.Change(args=args, amount=amount):
                yield from args
                yield from _terms(amount)
            case _:
                assert_never(item.leaf)
    for chance in block.chances:
        for part in chance.guard:
            yield from mf.free(part)
        for _, branch in chance.branches:
            yield from reads(branch)
        if chance.timeout is not None:
            yield from timing_terms(chance.timeout.duration, chance.timeout)


def timing_terms(duration: me.LiftedDuration | None, timeout: me.TimeOut | None) -> Iterator[str]:
    """The terms of a duration and of a time-out."""
    amounts = () if duration is None else duration.amounts
    for amount in amounts if timeout is None else (*amounts, timeout.seconds):
        yield from _terms(amount)


def _terms(amount: me.Amount) -> Iterator[str]:
    return (arg for value in functions(amount) for arg in value.args)


# --- conditions ------------------------------------------------------------------------------


def normal_form(formula: mf.Formula, negative: bool = False) -> mf.Formula:
    """The condition, or its negation, in negation normal form, by rules 7 to 12."""
    match formula:
        case mf.Atom() | mf.Equal():
            return mf.Not(formula) if negative else formula
        case mf.Test(kind, atom, span):
            other: Literal["unknown", "known"] = "known" if kind == "unknown" else "unknown"
            return mf.Test(other, atom, span) if negative else formula  # 10
        case mf.Compare(operator):
            return replace(formula, operator=mf.OPPOSITE[operator]) if negative else formula  # 13
        case mf.Not(part):  # 7
            return normal_form(part, not negative)
        case mf.And(parts, span) | mf.Or(parts, span):  # 8
            join = mf.And if isinstance(formula, mf.And) is not negative else mf.Or
            return join(tuple(normal_form(part, negative) for part in parts), span)
        case mf.Quantified(kind, parameters, part, span):
            inner = normal_form(part, negative)
            universal = (kind == "forall") is not negative  # 9
            for parameter in reversed(parameters):  # 11
                inner = _bind("forall" if universal else "exists", parameter, inner)
            return inner
        case _:
            assert_never(formula)


def _bind(kind: Literal["exists", "forall"], parameter: Parameter, part: mf.Formula) -> mf.Formula:
    join = mf.And if kind == "exists" else mf.Or  # 12
    parts = list(_flat(join, part))
    outside = [each for each in parts if parameter.name not in mf.free(each)]
    inside = [each for each in parts if parameter.name in mf.free(each)]
    bound = mf.Quantified(kind, (parameter,), inside[0] if len(inside) == 1 else join(tuple(inside)))
    return join((*outside, bound)) if outside else bound


def _flat(join: type[mf.And] | type[mf.Or], formula: mf.Formula) -> Iterator[mf.Formula]:
    if isinstance(formula, join):
        for part in formula.parts:
            yield from _flat(join, part)
    else:
        yield formula


def conjuncts(formula: mf.Formula) -> Iterator[mf.Formula]:
    """The parts of nested conjunctions, from left to right."""
    return _flat(mf.And, formula)


def disjuncts(formula: mf.Formula) -> Iterator[mf.Formula]:
    """The parts of nested disjunctions, from left to right."""
    return _flat(mf.Or, formula)
