"""The whole language as frozen syntax trees.

Names are kept as written (the language is case-insensitive: compare :attr:`Name.key`). Every
node knows its span; spans take no part in equality, so that printing and parsing again gives an
equal tree. Sections stand in source order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Literal, TypeAlias

from bbtc.kleene import Truth
from bbtc.source import SourceFile, Span


def _span() -> Span:
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
    span: Span = _span()

    @property
    def key(self) -> str:
        """The symbol as compared: lower case."""
        return self.text.lower()


@dataclass(frozen=True, slots=True)
class Variable(_Placed):
    """A parameter, question mark included."""

    text: str
    span: Span = _span()

    @property
    def key(self) -> str:
        """The parameter as compared: lower case."""
        return self.text.lower()


@dataclass(frozen=True, slots=True)
class Number:
    """A number as written: ``0.5``, ``.5``, ``1/3``, ``7``, ``-2``, ``1e-3``."""

    text: str
    span: Span = _span()

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
    span: Span = _span()


TypedList: TypeAlias = tuple[TypedGroup, ...]


@dataclass(frozen=True, slots=True)
class Atom:
    """``(predicate term…)``, or a bare ``predicate``."""

    predicate: Name
    args: tuple[Term, ...]
    span: Span = _span()


# --- formulas --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Empty:
    """``()``: the formula that always holds; as an effect, no change."""

    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Equality:
    """``(= a b)`` over terms."""

    left: Term
    right: Term
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Not:
    """``(not f)``."""

    part: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class And:
    """``(and f…)``."""

    parts: tuple[Formula, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Or:
    """``(or f…)``."""

    parts: tuple[Formula, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Imply:
    """``(imply a b)``."""

    premise: Formula
    conclusion: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Quantified:
    """``(exists (params) f)`` and ``(forall (params) f)``."""

    kind: Literal["exists", "forall"]
    parameters: TypedList
    part: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Test:
    """``(unknown p)`` and ``(known p)``: two-valued tests of an atom."""

    kind: Literal["unknown", "known"]
    atom: Atom
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Unsupported:
    """A construct that is recognised and refused by name (numeric comparison, preference, …)."""

    construct: str
    text: str
    span: Span = _span()


Formula: TypeAlias = Atom | Empty | Equality | Not | And | Or | Imply | Quantified | Test | Unsupported


# --- effects ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Assign:
    """``p`` (true), ``(not p)`` (false) or ``(unknown p)`` as an effect or an initial fact."""

    atom: Atom
    value: Truth
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class EffectAnd:
    """``(and e…)``."""

    parts: tuple[Effect, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class When:
    """``(when condition effect)``."""

    condition: Formula
    effect: Effect
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class EffectForall:
    """``(forall (params) effect)``."""

    parameters: TypedList
    effect: Effect
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Branch:
    """``p effect`` within ``probabilistic``."""

    probability: Number
    effect: Effect
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Probabilistic:
    """``(probabilistic p1 e1 …)``."""

    branches: tuple[Branch, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class OneOf:
    """``(oneof e…)``."""

    parts: tuple[Effect, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class FluentRef:
    """``(total-cost)``, ``reward``, ``(distance ?a ?b)``: a numeric fluent."""

    name: Name
    args: tuple[Term, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """``(+ a b)``, ``(* 2 (f))``, ``(- x)``."""

    operator: str
    operands: tuple[NumericExpression, ...]
    span: Span = _span()


NumericExpression: TypeAlias = Number | FluentRef | Arithmetic


@dataclass(frozen=True, slots=True)
class FluentEffect:
    """``(increase (total-cost) n)`` and its kin: increase, decrease, assign, scale-up, scale-down."""

    operator: str
    fluent: FluentRef
    amount: NumericExpression
    span: Span = _span()


Effect: TypeAlias = (
    Empty | Assign | EffectAnd | When | EffectForall | Probabilistic | OneOf | FluentEffect | Unsupported
)


# --- template bodies -------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BodyControl:
    """``(sequence …)``, ``(fallback …)``, ``(skipper …)``."""

    kind: Literal["sequence", "fallback", "skipper"]
    children: tuple[Body, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class BodyCondition:
    """``(condition formula)``."""

    formula: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class BodyCall:
    """``(action name term…)``, or ``(name term…)`` for an action or a template (``kind`` None)."""

    kind: Literal["action"] | None
    name: Name
    args: tuple[Term, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class BodyForeach:
    """``(foreach (params) child)``: the child once for every binding, as children of the parent."""

    parameters: TypedList
    child: Body
    span: Span = _span()


Body: TypeAlias = BodyControl | BodyCondition | BodyCall | BodyForeach


# --- sections --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Requirements:
    """``(:requirements :key…)``."""

    keys: tuple[Name, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class TypedSection:
    """``(:types …)``, ``(:constants …)``, ``(:objects …)``."""

    kind: Literal["types", "constants", "objects"]
    entries: TypedList
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class PredicateDeclaration:
    """``(name params)`` within ``:predicates``; ``(unknown (name params))`` declares it three-valued,
    ``(external …)`` around either of these as one that others change, ``(observed …)`` as one whose facts
    are always seen."""

    name: Name
    parameters: TypedList
    three_valued: bool
    span: Span = _span()
    external: bool = False
    observed: bool = False


@dataclass(frozen=True, slots=True)
class Predicates:
    """``(:predicates …)``."""

    declarations: tuple[PredicateDeclaration, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class FunctionDeclaration:
    """``(name params) - type`` within ``:functions``."""

    name: Name
    parameters: TypedList
    types: tuple[Name, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Functions:
    """``(:functions …)``."""

    declarations: tuple[FunctionDeclaration, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Action:
    """``(:action name :parameters … :precondition … :observe … :effect …)``."""

    name: Name
    parameters: TypedList
    precondition: Formula | None
    observe: Observation | None
    effect: Effect | None
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Observation:
    """What ``:observe`` gives: a formula (one atom, or a conjunction of them), or a noisy
    distribution written as an effect."""

    content: Formula | Probabilistic
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Derived:
    """``(:derived (p ?x) formula)`` and ``(:axiom :vars … :context … :implies …)``."""

    kind: Literal["derived", "axiom"]
    parameters: TypedList
    head: Atom
    condition: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Sensor:
    """``(:sensor name :parameters … :condition f :sensed f)``: whenever the condition holds, what is
    sensed becomes known without any action."""

    name: Name
    parameters: TypedList
    condition: Formula | None
    sensed: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Template:
    """``(:template name :parameters … :precondition … :effect <guide> :body <tree>)``."""

    name: Name
    parameters: TypedList
    precondition: Formula | None
    effect: Effect | None
    body: Body
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class DomainReference:
    """``(:domain name)``."""

    name: Name
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class FluentValue:
    """``(= (distance a b) 4)`` in ``:init``."""

    fluent: FluentRef
    value: Number
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class InitClause:
    """``(or …)`` and other uncertain formulas in ``:init``."""

    formula: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class InitAnd:
    """``(and …)`` in ``:init``: unlike an effect's, its parts may be clauses and numbers."""

    parts: tuple[InitElement, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Invariant:
    """``(invariant f…)`` in ``:init``: at least one of the formulas holds in every reachable state."""

    parts: tuple[Formula, ...]
    span: Span = _span()


InitElement: TypeAlias = (
    Assign
    | InitAnd
    | EffectForall
    | Probabilistic
    | OneOf
    | FluentValue
    | InitClause
    | Invariant
    | Unsupported
    | Empty
)


@dataclass(frozen=True, slots=True)
class Init:
    """``(:init …)``."""

    elements: tuple[InitElement, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Hidden:
    """``(:hidden literal…)``: the true state a simulator hides from the planner. It says nothing a
    planner may use."""

    facts: tuple[Assign, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Goal:
    """``(:goal formula)``."""

    formula: Formula
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class GoalNumber:
    """``(:goal-probability p)`` and ``(:goal-reward n)``."""

    kind: Literal["goal-probability", "goal-reward"]
    value: Number
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Metric:
    """``(:metric minimize expression)``."""

    direction: Literal["minimize", "maximize"]
    expression: NumericExpression
    span: Span = _span()


Section: TypeAlias = (
    Requirements
    | TypedSection
    | Predicates
    | Functions
    | Action
    | Derived
    | Sensor
    | Template
    | DomainReference
    | Init
    | Hidden
    | Goal
    | GoalNumber
    | Metric
    | Unsupported
)


# --- definitions and files -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Definition:
    """``(define (domain name) section…)`` or ``(define (problem name) section…)``."""

    kind: Literal["domain", "problem"]
    name: Name
    sections: tuple[Section, ...]
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Comment:
    """``; text`` to the end of the line; ``own_line`` if nothing but space stands before it."""

    text: str
    own_line: bool
    span: Span = _span()


@dataclass(frozen=True, slots=True)
class Document:
    """Everything one file holds."""

    source: SourceFile = field(compare=False, repr=False)
    definitions: tuple[Definition, ...] = ()
    comments: tuple[Comment, ...] = ()
