"""Sections of the syntax tree (:mod:`bbtc.syntax.ast`) in which no formula and no effect stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bbtc.source import Span
from bbtc.syntax.terms import Name, Number, NumericExpression, TypedList, span_field


@dataclass(frozen=True, slots=True)
class Requirements:
    """``(:requirements :key…)``."""

    keys: tuple[Name, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class TypedSection:
    """``(:types …)``, ``(:constants …)``, ``(:objects …)``."""

    kind: Literal["types", "constants", "objects"]
    entries: TypedList
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class PredicateDeclaration:
    """``(name params)`` within ``:predicates``; ``(unknown (name params))`` declares it three-valued,
    ``(external …)`` around either of these as one that others change, ``(observed …)`` as one whose facts
    are always seen."""

    name: Name
    parameters: TypedList
    three_valued: bool
    span: Span = span_field()
    external: bool = False
    observed: bool = False


@dataclass(frozen=True, slots=True)
class Predicates:
    """``(:predicates …)``."""

    declarations: tuple[PredicateDeclaration, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Observables:
    """``(:observables (name params)…)`` or ``(:observations …)``: predicates that stand for what is told."""

    kind: Literal["observables", "observations"]
    declarations: tuple[PredicateDeclaration, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class DomainReference:
    """``(:domain name)``."""

    name: Name
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class GoalNumber:
    """``(:goal-probability p)`` and ``(:goal-reward n)``."""

    kind: Literal["goal-probability", "goal-reward"]
    value: Number
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Metric:
    """``(:metric minimize expression)``."""

    direction: Literal["minimize", "maximize"]
    expression: NumericExpression
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Comment:
    """``; text`` to the end of the line; ``own_line`` if nothing but space stands before it."""

    text: str
    own_line: bool
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Duration:
    """What ``:duration`` gives: a number of seconds, or a distribution of them with its parameters; of
    ``empirical``, the values and their ``weights``."""

    kind: Literal["number", "uniform", "triangular", "empirical", "lognormal"]
    amounts: tuple[NumericExpression, ...]
    weights: tuple[Number, ...]
    span: Span = span_field()
