"""The whole language as frozen syntax trees.

Names are kept as written (the language is case-insensitive: compare :attr:`Name.key`). Every
node knows its span; spans take no part in equality, so that printing and parsing again gives an
equal tree. Sections stand in source order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from bbtc.source import SourceFile, Span
from bbtc.syntax.formulas import And as And
from bbtc.syntax.formulas import Assign as Assign
from bbtc.syntax.formulas import Believed as Believed
from bbtc.syntax.formulas import Body as Body
from bbtc.syntax.formulas import BodyCall as BodyCall
from bbtc.syntax.formulas import BodyCondition as BodyCondition
from bbtc.syntax.formulas import BodyControl as BodyControl
from bbtc.syntax.formulas import BodyForeach as BodyForeach
from bbtc.syntax.formulas import BodyRetry as BodyRetry
from bbtc.syntax.formulas import Branch as Branch
from bbtc.syntax.formulas import Effect as Effect
from bbtc.syntax.formulas import EffectAnd as EffectAnd
from bbtc.syntax.formulas import EffectForall as EffectForall
from bbtc.syntax.formulas import FluentEffect as FluentEffect
from bbtc.syntax.formulas import Formula as Formula
from bbtc.syntax.formulas import Imply as Imply
from bbtc.syntax.formulas import Not as Not
from bbtc.syntax.formulas import OneOf as OneOf
from bbtc.syntax.formulas import Or as Or
from bbtc.syntax.formulas import Probabilistic as Probabilistic
from bbtc.syntax.formulas import Quantified as Quantified
from bbtc.syntax.formulas import Test as Test
from bbtc.syntax.formulas import Unsupported as Unsupported
from bbtc.syntax.formulas import When as When
from bbtc.syntax.terms import Arithmetic as Arithmetic
from bbtc.syntax.terms import Atom as Atom
from bbtc.syntax.terms import Comparison as Comparison
from bbtc.syntax.terms import Empty as Empty
from bbtc.syntax.terms import Equality as Equality
from bbtc.syntax.terms import FluentRef as FluentRef
from bbtc.syntax.terms import Name as Name
from bbtc.syntax.terms import Number as Number
from bbtc.syntax.terms import NumberRange as NumberRange
from bbtc.syntax.terms import NumericExpression as NumericExpression
from bbtc.syntax.terms import Term as Term
from bbtc.syntax.terms import TypedGroup as TypedGroup
from bbtc.syntax.terms import TypedList as TypedList
from bbtc.syntax.terms import Variable as Variable
from bbtc.syntax.terms import span_field

# --- sections --------------------------------------------------------------------------------


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
class FunctionDeclaration:
    """``(name params) - type`` within ``:functions``, or with a range as its type."""

    name: Name
    parameters: TypedList
    types: tuple[Name, ...]
    span: Span = span_field()
    range: NumberRange | None = None


@dataclass(frozen=True, slots=True)
class Functions:
    """``(:functions …)``."""

    declarations: tuple[FunctionDeclaration, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Action:
    """``(:action name :parameters … :precondition … :observe … :repeats :uninterruptible :effect …
    :while … :on-abort …)``."""

    name: Name
    parameters: TypedList
    precondition: Formula | None
    observe: Observation | SensingModel | None
    effect: Effect | None
    span: Span = span_field()
    repeats: bool = False
    uninterruptible: bool = False
    during: Formula | None = None
    on_abort: Effect | None = None
    timing: Timing | None = None


Moment: TypeAlias = Literal["at start", "over all", "at end"]


@dataclass(frozen=True, slots=True)
class TimedFormula:
    """``(at start f)``, ``(over all f)``, ``(at end f)``."""

    when: Moment
    formula: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class TimedChange:
    """``(at start e)``, ``(at end e)``."""

    when: Moment
    effect: Effect
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class TimedAll:
    """``(and t…)`` of a durative action; without parts also ``()``."""

    parts: tuple[Timed, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class TimedForall:
    """``(forall (params) t)``."""

    parameters: TypedList
    part: Timed
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class TimedWhen:
    """``(when t t)``, a condition and an effect."""

    condition: Timed
    effect: Timed
    span: Span = span_field()


Timed: TypeAlias = TimedFormula | TimedChange | TimedAll | TimedForall | TimedWhen


@dataclass(frozen=True, slots=True)
class DurativeAction:
    """``(:durative-action name :parameters … :duration (= ?duration n) :condition … :effect …)``."""

    name: Name
    parameters: TypedList
    duration: NumericExpression
    condition: Timed | None
    effect: Timed | None
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Exogenous:
    """``(:exogenous name :parameters … :precondition … :per action :before (other…) :effect …)``."""

    name: Name
    parameters: TypedList
    precondition: Formula | None
    effect: Effect
    per: Name | None
    before: tuple[Name, ...] | None
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Duration:
    """What ``:duration`` gives: a number of seconds, or a distribution of them with its parameters; of
    ``empirical``, the values and their ``weights``."""

    kind: Literal["number", "uniform", "triangular", "empirical", "lognormal"]
    amounts: tuple[NumericExpression, ...]
    weights: tuple[Number, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Timing:
    """``:duration``, ``:timeout``, ``:timeout-probability``, ``:on-timeout`` of an action, where given."""

    duration: Duration | None
    timeout: NumericExpression | None
    timeout_probability: Number | None
    on_timeout: Effect | None
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Observation:
    """What ``:observe`` or ``:sensed`` gives: a formula (one atom, or a conjunction of them), or a noisy
    distribution written as an effect."""

    content: Formula | Probabilistic
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class SensingModel:
    """``:sensing-model``, or ``:observation``, which may have chance: what is observed, each value under the
    condition that makes it so."""

    effect: Effect
    span: Span = span_field()
    word: Literal["sensing-model", "observation"] = "sensing-model"


@dataclass(frozen=True, slots=True)
class Derived:
    """``(:derived (p ?x) formula)`` and ``(:axiom :vars … :context … :implies …)``; the latter may have a
    ``label``, and derive ``others`` besides."""

    kind: Literal["derived", "axiom"]
    parameters: TypedList
    head: Atom
    condition: Formula
    span: Span = span_field()
    label: Name | None = None
    others: tuple[Atom, ...] = ()

    @property
    def heads(self) -> tuple[Atom, ...]:
        """All that is derived."""
        return self.head, *self.others


@dataclass(frozen=True, slots=True)
class StateVariable:
    """``(:variable name value…)`` and ``(:obs-variable …)``: exactly one of several values holds, or the only
    one does or not. A value is an atom, or ``(forall (params) atom)``."""

    kind: Literal["variable", "obs-variable"]
    name: Name
    parameters: TypedList | None
    values: tuple[Formula, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class AtomList:
    """``(:observable value…)``: what is always told; ``(:sticky value…)``: what stays true. Values are those
    of a :class:`StateVariable`."""

    kind: Literal["observable", "sticky"]
    values: tuple[Formula, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class DefaultSensing:
    """``(:default-sensing-model effect)``: the :class:`SensingModel` of every action without one."""

    effect: Effect
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Observables:
    """``(:observables (name params)…)`` or ``(:observations …)``: predicates that stand for what is told."""

    kind: Literal["observables", "observations"]
    declarations: tuple[PredicateDeclaration, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class ObservationModel:
    """``(:observation name :parameters … :condition f :distribution e)``: after each action, where the
    condition holds, an observable is told as the distribution draws it."""

    name: Name
    parameters: TypedList
    condition: Formula | None
    distribution: Effect
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Sensor:
    """``(:sensor name :parameters … :condition f :sensed f)``: whenever the condition holds, what is
    sensed becomes known without any action."""

    name: Name
    parameters: TypedList
    condition: Formula | None
    sensed: Observation
    span: Span = span_field()
    repeats: bool = False


@dataclass(frozen=True, slots=True)
class Template:
    """``(:template name :parameters … :precondition … :effect <guide> :body <tree>)``."""

    name: Name
    parameters: TypedList
    precondition: Formula | None
    effect: Effect | None
    body: Body
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class DomainReference:
    """``(:domain name)``."""

    name: Name
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class FluentValue:
    """``(= (distance a b) 4)`` in ``:init``."""

    fluent: FluentRef
    value: Number
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class InitClause:
    """``(or …)`` and other uncertain formulas in ``:init``."""

    formula: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class InitAnd:
    """``(and …)`` in ``:init``: unlike an effect's, its parts may be clauses and numbers."""

    parts: tuple[InitElement, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Invariant:
    """``(invariant f…)`` or ``(at-least-one f…)`` in ``:init``: at least one of the formulas holds, of an
    invariant in every reachable state."""

    parts: tuple[Formula, ...]
    span: Span = span_field()
    word: Literal["invariant", "at-least-one"] = "invariant"


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
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class FactBelief:
    """``(prob p 0.3)``: how probable a fact is, by itself."""

    atom: Atom
    probability: Number
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class JointBelief:
    """``(joint 0.5 (and p (not q)))``: how probable it is that literals hold together."""

    probability: Number
    condition: Formula
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class InitBelief:
    """``(:init-belief …)``: what is believed at the start, in the place of ``:init``."""

    elements: tuple[FactBelief | JointBelief, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Hidden:
    """``(:hidden literal…)``: the true state a simulator hides from the planner. It says nothing a
    planner may use."""

    facts: tuple[Assign, ...]
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Goal:
    """``(:goal formula)``."""

    formula: Formula
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


Section: TypeAlias = (
    Requirements
    | TypedSection
    | Predicates
    | Functions
    | Action
    | DurativeAction
    | Exogenous
    | Derived
    | Sensor
    | StateVariable
    | AtomList
    | DefaultSensing
    | Observables
    | ObservationModel
    | Template
    | DomainReference
    | Init
    | InitBelief
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
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Comment:
    """``; text`` to the end of the line; ``own_line`` if nothing but space stands before it."""

    text: str
    own_line: bool
    span: Span = span_field()


@dataclass(frozen=True, slots=True)
class Document:
    """Everything one file holds."""

    source: SourceFile = field(compare=False, repr=False)
    definitions: tuple[Definition, ...] = ()
    comments: tuple[Comment, ...] = ()
