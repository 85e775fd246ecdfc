"""Lifted conditions. A term is a string: ``?x`` is a parameter, anything else an object.

Parameters of quantifiers never shadow another parameter in scope: :mod:`bbtc.analysis.resolve`
renames them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.kleene import Truth
from bbtc.model.amount import Amount, functions
from bbtc.model.amount import substitute as substitute_amount
from bbtc.model.types import Parameter
from bbtc.source import Span

Term: TypeAlias = str


def is_parameter(term: Term) -> bool:
    """Whether the term is a parameter."""
    return term[0] == "?"


@dataclass(frozen=True, slots=True)
class Atom:
    """The value of a predicate for its arguments."""

    predicate: str
    args: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Test:
    """The two-valued tests ``(unknown p)`` and ``(known p)``."""

    kind: Literal["unknown", "known"]
    atom: Atom
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Equal:
    """Both terms are the same object."""

    left: Term
    right: Term
    span: Span | None = field(default=None, compare=False, repr=False)


Comparator: TypeAlias = Literal["<", "<=", "=", "!=", ">=", ">"]
OPPOSITE: Mapping[Comparator, Comparator] = {"<": ">=", "<=": ">", "=": "!=", "!=": "=", ">=": "<", ">": "<="}


@dataclass(frozen=True, slots=True)
class Compare:
    """How two numbers compare; two-valued. ``digits`` are the facts that those which change are written in,
    once that is settled (:mod:`bbtc.ground.numbers.digits`)."""

    operator: Comparator
    left: Amount
    right: Amount
    digits: tuple[Atom, ...] = ()
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Not:
    """Kleene negation."""

    part: Formula
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class And:
    """Kleene conjunction; without parts, true."""

    parts: tuple[Formula, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Or:
    """Kleene disjunction; without parts, false."""

    parts: tuple[Formula, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Quantified:
    """``exists``: the disjunction, ``forall``: the conjunction over all bindings."""

    kind: Literal["exists", "forall"]
    parameters: tuple[Parameter, ...]
    part: Formula
    span: Span | None = field(default=None, compare=False, repr=False)


Formula: TypeAlias = Atom | Test | Equal | Compare | Not | And | Or | Quantified
ALWAYS = And(())
NEVER = Or(())


def conjoin(first: Formula | None, second: Formula | None) -> Formula | None:
    """The conjunction of two optional conditions (None: no condition)."""
    if first is None or second is None:
        return second if first is None else first
    return And((first, second))


@dataclass(frozen=True, slots=True)
class Reading:
    """An atom in a condition. ``value`` is what makes the condition true; None for ``known``."""

    atom: Atom
    value: Truth | None
    span: Span | None


def readings(formula: Formula, negative: bool = False) -> Iterator[Reading]:
    """Every atom of a condition, with the value that helps to make it true."""
    match formula:
        case Atom(_, _, span):
            yield Reading(formula, Truth.FALSE if negative else Truth.TRUE, span)
        case Test(kind, atom, span):
            unknown = (kind == "unknown") is not negative
            yield Reading(atom, Truth.UNKNOWN if unknown else None, span)
        case Equal():
            return
        case Compare(_, _, _, digits, span):
            for digit in digits:
                for value in (Truth.TRUE, Truth.FALSE):
                    yield Reading(digit, value, span)
        case Not(part):
            yield from readings(part, not negative)
        case And(parts) | Or(parts):
            for part in parts:
                yield from readings(part, negative)
        case Quantified(_, _, part):
            yield from readings(part, negative)
        case _:
            assert_never(formula)


def comparisons(formula: Formula) -> Iterator[Compare]:
    """The comparisons of numbers in a condition; what is denied is not among them."""
    match formula:
        case Compare():
            yield formula
        case And(parts) | Or(parts):
            for part in parts:
                yield from comparisons(part)
        case Quantified(_, _, part):
            yield from comparisons(part)
        case Atom() | Test() | Equal() | Not():
            return
        case _:
            assert_never(formula)


def atoms(formula: Formula) -> Iterator[Atom]:
    """The atoms a formula reads, tests included, from left to right."""
    return (reading.atom for reading in readings(formula))


def substitute_atom(atom: Atom, binding: dict[str, Term]) -> Atom:
    """The atom with free parameters replaced."""
    return Atom(atom.predicate, tuple(binding.get(a, a) for a in atom.args), atom.span)


def substitute(formula: Formula, binding: dict[str, Term]) -> Formula:
    """The formula with free parameters replaced. The new terms must not be captured by
    quantifiers inside (objects never are)."""
    match formula:
        case Atom(predicate, args, span):
            return Atom(predicate, tuple(binding.get(a, a) for a in args), span)
        case Test(kind, atom, span):
            return Test(kind, substitute_atom(atom, binding), span)
        case Compare(operator, left, right, digits, span):
            return Compare(
                operator,
                substitute_amount(left, binding),
                substitute_amount(right, binding),
                tuple(substitute_atom(digit, binding) for digit in digits),
                span,
            )
        case Equal(left, right, span):
            return Equal(binding.get(left, left), binding.get(right, right), span)
        case Not(part, span):
            return Not(substitute(part, binding), span)
        case And(parts, span):
            return And(tuple(substitute(p, binding) for p in parts), span)
        case Or(parts, span):
            return Or(tuple(substitute(p, binding) for p in parts), span)
        case Quantified(kind, parameters, part, span):
            return Quantified(kind, parameters, substitute(part, binding), span)
        case _:
            assert_never(formula)


def free(formula: Formula) -> dict[str, None]:
    """Free parameters, in order of appearance."""
    found: dict[str, None] = {}
    _free(formula, frozenset(), found)
    return found


def _free(formula: Formula, bound: frozenset[str], found: dict[str, None]) -> None:
    terms: tuple[Term, ...]
    match formula:
        case Atom(_, args) | Test(_, Atom(_, args)):
            terms = args
        case Equal(left, right):
            terms = (left, right)
        case Compare(_, left_side, right_side):
            terms = tuple(
                arg for side in (left_side, right_side) for value in functions(side) for arg in value.args
            )
        case Not(part):
            _free(part, bound, found)
            return
        case And(parts) | Or(parts):
            for part in parts:
                _free(part, bound, found)
            return
        case Quantified(_, parameters, part):
            _free(part, bound | {p.name for p in parameters}, found)
            return
        case _:
            assert_never(formula)
    for term in terms:
        if is_parameter(term) and term not in bound:
            found[term] = None
