"""Names, numbers, terms and atoms of the syntax tree (:mod:`bbtc.syntax.ast`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, TypeAlias

from bbtc.source import SourceFile, Span


def span_field() -> Span:
    """The span field: neither compared nor shown."""
    return field(compare=False, repr=False)  # type: ignore[no-any-return]


# --- names, numbers, terms -------------------------------------------------------------------


class _Placed:
    """A word that knows where it starts, and makes its span when asked: a large file has a million
    words, and nearly nobody asks. Nodes made with a span keep that."""

    __slots__ = ("_source", "_start")
    _source: SourceFile
    _start: int
    text: str

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Span:
            if name != "span":
                raise AttributeError(name)
            return Span(self._source, self._start, self._start + len(self.text))


@dataclass(frozen=True, slots=True)
class Name(_Placed):
    """A symbol as written."""

    text: str
    span: Span = span_field()

    @property
    def key(self) -> str:
        """The symbol as compared: lower case."""
        return self.text.lower()


@dataclass(frozen=True, slots=True)
class Variable(_Placed):
    """A parameter, question mark included."""

    text: str
    span: Span = span_field()

    @property
    def key(self) -> str:
        """The parameter as compared: lower case."""
        return self.text.lower()


@dataclass(frozen=True, slots=True)
class Number:
    """A number as written: ``0.5``, ``.5``, ``1/3``, ``7``, ``-2``, ``1e-3``."""

    text: str
    span: Span = span_field()

    @property
    def value(self) -> Fraction:
        """Exact value. Raises ``ZeroDivisionError`` for a zero denominator."""
        return Fraction(self.text)


Term: TypeAlias = Name | Variable


@dataclass(frozen=True, slots=True)
class TypedGroup:
    """``a b - t``: names that share a type. ``types`` is empty without ``-``, and has several
    names for ``(either t1 t2)``."""

    names: tuple[Term, ...]
    types: tuple[Name, ...]
    span: Span = span_field()


TypedList: TypeAlias = tuple[TypedGroup, ...]


@dataclass(frozen=True, slots=True)
class Atom:
    """``(predicate term…)``, or a bare ``predicate``."""

    predicate: Name
    args: tuple[Term, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class FluentRef:
    """``(total-cost)``, ``reward``, ``(distance ?a ?b)``: a numeric fluent."""

    name: Name
    args: tuple[Term, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """``(+ a b)``, ``(* 2 (f))``, ``(- x)``."""

    operator: str
    operands: tuple[NumericExpression, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Empty:
    """``()``: the formula that always holds; as an effect, no change."""

    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Equality:
    """``(= a b)`` over terms."""

    left: Term
    right: Term
    span: Span = span_field()


NumericExpression: TypeAlias = Number | FluentRef | Arithmetic


@dataclass(frozen=True, slots=True)
class Comparison:
    """``(< a b)`` and its kin, of numbers: < <= = >= >."""

    operator: str
    left: NumericExpression
    right: NumericExpression
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class NumberRange:
    """``(int low high)`` as the type of a function; ``policy`` is ``:saturate`` or ``:block``, if given."""

    low: Number
    high: Number
    policy: Name | None
    span: Span = span_field()
