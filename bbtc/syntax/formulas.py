"""Conditions, effects and bodies of templates as syntax trees; :mod:`bbtc.syntax.ast` has the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from bbtc.kleene import Truth
from bbtc.source import Span
from bbtc.syntax.terms import (
    Atom,
    Comparison,
    Empty,
    Equality,
    FluentRef,
    Name,
    Number,
    NumericExpression,
    Term,
    TypedList,
    span_field,
)

# --- formulas --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Not:
    """``(not f)``."""

    part: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class And:
    """``(and f…)``."""

    parts: tuple[Formula, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Or:
    """``(or f…)``."""

    parts: tuple[Formula, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Imply:
    """``(imply a b)``."""

    premise: Formula
    conclusion: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Quantified:
    """``(exists (params) f)`` and ``(forall (params) f)``."""

    kind: Literal["exists", "forall"]
    parameters: TypedList
    part: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Believed:
    """``(believed f q)``: how probable a formula is, given what was told, is at least a number."""

    part: Formula
    at_least: Number
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Test:
    """``(unknown p)`` and ``(known p)``: two-valued tests of an atom, or of what is believed."""

    kind: Literal["unknown", "known"]
    atom: Atom | Believed
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Unsupported:
    """A construct that is recognised and refused by name (preference, object fluent, …)."""

    construct: str
    text: str
    span: Span = span_field()


Formula: TypeAlias = (
    Atom | Empty | Equality | Comparison | Not | And | Or | Imply | Quantified | Believed | Test | Unsupported
)


# --- effects ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assign:
    """``p`` (true), ``(not p)`` (false) or ``(unknown p)`` as an effect or an initial fact."""

    atom: Atom
    value: Truth
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class EffectAnd:
    """``(and e…)``."""

    parts: tuple[Effect, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class When:
    """``(when condition effect)``."""

    condition: Formula
    effect: Effect
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class EffectForall:
    """``(forall (params) effect)``."""

    parameters: TypedList
    effect: Effect
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Branch:
    """``p effect`` within ``probabilistic``."""

    probability: Number
    effect: Effect
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Probabilistic:
    """``(probabilistic p1 e1 …)``."""

    branches: tuple[Branch, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class OneOf:
    """``(oneof e…)``."""

    parts: tuple[Effect, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class FluentEffect:
    """``(increase (total-cost) n)`` and its kin: increase, decrease, assign, scale-up, scale-down."""

    operator: str
    fluent: FluentRef
    amount: NumericExpression
    span: Span = span_field()


Effect: TypeAlias = (
    Empty | Assign | EffectAnd | When | EffectForall | Probabilistic | OneOf | FluentEffect | Unsupported
)


# --- template bodies -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BodyControl:
    """``(sequence …)``, ``(fallback …)``, ``(skipper …)``."""

    kind: Literal["sequence", "fallback", "skipper"]
    children: tuple[Body, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class BodyRetry:
    """``(retry n child)``."""

    attempts: Number
    child: Body
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class BodyCondition:
    """``(condition formula)``."""

    formula: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class BodyCall:
    """``(action name term…)``, or ``(name term…)`` for an action or a template (``kind`` None)."""

    kind: Literal["action"] | None
    name: Name
    args: tuple[Term, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class BodyForeach:
    """``(foreach (params) child)``: the child once for every binding, as children of the parent."""

    parameters: TypedList
    child: Body
    span: Span = span_field()


Body: TypeAlias = BodyControl | BodyRetry | BodyCondition | BodyCall | BodyForeach
