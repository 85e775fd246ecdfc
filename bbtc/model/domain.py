"""The model of a domain with a problem: what :func:`bbtc.analysis.resolve.resolve` returns.

Frozen; names are keys (lower case) and all of them are declared. Every declaration keeps its span.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.kleene import Truth
from bbtc.model.effect import (
    NOTHING,
    Add,
    Choice,
    Effect,
    LiftedDuration,
    Set,
    TimeOut,
    Together,
    leaves,
    settings,
)
from bbtc.model.formula import And, Atom, Formula, Term
from bbtc.model.types import Object, Parameter, TypeHierarchy
from bbtc.source import Span


@dataclass(frozen=True, slots=True)
class Predicate:
    """A predicate. ``three_valued`` if anything in the model can make it unknown; ``external`` if it is
    declared as one that others change, ``observed`` as one whose facts are always seen."""

    name: str
    parameters: tuple[Parameter, ...]
    three_valued: bool = False
    declared_three_valued: bool = False
    derived: bool = False
    external: bool = False
    observed: bool = False
    span: Span | None = field(default=None, compare=False, repr=False)
    inferred: bool = field(default=False, compare=False, repr=False)
    """Nothing declares it; it is known from its use."""


@dataclass(frozen=True, slots=True)
class NumberRange:
    """The whole numbers from ``low`` to ``high``. What would leave the range ends at its bound; where it
    ``blocks``, an action that may leave it does not start."""

    low: int
    high: int
    blocks: bool = False
    found: bool = False
    """It is not declared, but found: nothing may lead out of it."""
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def digits(self) -> int:
        """How many binary digits it takes."""
        return max(1, (self.high - self.low).bit_length())


_NUMBER = "number "


def number_predicate(function: str) -> str:
    """The predicate that stands for the numbers of a function until it is settled how they are written; no
    file can name it."""
    return _NUMBER + function


def is_number(predicate: str) -> bool:
    """Does a predicate stand for numbers?"""
    return predicate.startswith(_NUMBER)


@dataclass(frozen=True, slots=True)
class Function:
    """A numeric function that ``:init`` gives values to. Those that actions change have a ``range``, declared
    or found (:mod:`bbtc.ground.numbers.ranges`)."""

    name: str
    parameters: tuple[Parameter, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    range: NumberRange | None = None


Rate: TypeAlias = Literal["action", "second"]


@dataclass(frozen=True, slots=True)
class Exogenous:
    """What makes an event of a schema: how often it is drawn, and the events that happen after it."""

    per: Rate = "action"
    before: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Schema:
    """An action, or with ``exogenous`` an event, which happens by itself. ``observe`` is what ``:observe``
    shows: a condition, or a noisy draw; where that ``repeats``, it is drawn anew only when a fact that it
    reads changes."""

    name: str
    parameters: tuple[Parameter, ...]
    precondition: Formula
    effect: Effect
    observe: Formula | Choice | None = None
    observe_span: Span | None = field(default=None, compare=False, repr=False)
    repeats: bool = False
    told: tuple[Reading, ...] = ()
    """What is told besides."""
    uninterruptible: bool = False
    """While it runs, nothing preempts it."""
    during: Formula | None = None
    """While this is true the action goes on; else it ends, with the effect ``on_abort``."""
    on_abort: Effect = NOTHING
    exogenous: Exogenous | None = None
    span: Span | None = field(default=None, compare=False, repr=False)
    duration: LiftedDuration | None = None
    timeout: TimeOut | None = None
    """Where it is given, ``effect`` is a choice of what happens then and what happens else."""

    @property
    def kind(self) -> Literal["action", "event"]:
        """What messages call it."""
        return "action" if self.exogenous is None else "event"

    @property
    def effects(self) -> Effect:
        """All that it may do: its effect, and what happens where it is aborted."""
        return self.effect if self.on_abort is NOTHING else Together((self.effect, self.on_abort))

    @property
    def counts(self) -> bool:
        """Is it an event that adds to cost or reward? Then it matters wherever actions are started."""
        return self.exogenous is not None and any(isinstance(leaf, Add) for leaf in leaves(self.effect))

    @property
    def tells(self) -> bool:
        """Is anything told?"""
        return self.observe is not None or bool(self.told)


@dataclass(frozen=True, slots=True)
class Reading:
    """Where ``when`` holds after an action, it is told whether ``condition`` is true, rightly with the
    probability ``accuracy``; where it is false with ``accuracy_false``, unless that is None."""

    condition: Formula
    accuracy: Fraction
    when: Formula
    accuracy_false: Fraction | None = None


@dataclass(frozen=True, slots=True)
class Sensor:
    """What becomes known by itself whenever the condition holds, as :attr:`Schema.observe` is."""

    name: str
    parameters: tuple[Parameter, ...]
    condition: Formula
    sensed: Formula | Choice
    repeats: bool = False
    span: Span | None = field(default=None, compare=False, repr=False)


def facts_told(observed: Formula | Choice) -> Formula:
    """What an observation tells of, as a condition; of a noisy one, the facts."""
    if isinstance(observed, Choice):
        sets = (leaf for leaf in leaves(observed) if isinstance(leaf, Set))
        return And(tuple(Atom(leaf.predicate, leaf.args, leaf.span) for leaf in sets))
    return observed


@dataclass(frozen=True, slots=True)
class Rule:
    """A derived predicate: it has the value of the condition (least fixpoint where recursive).
    Several rules for one predicate are a disjunction."""

    predicate: str
    args: tuple[Term, ...]
    parameters: tuple[Parameter, ...]
    condition: Formula
    span: Span | None = field(default=None, compare=False, repr=False)


# --- templates -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BodyControl:
    """A control node of a template body."""

    kind: Literal["sequence", "fallback", "skipper"]
    children: tuple[Body, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BodyRetry:
    """The child again where it fails, ``attempts`` times in all."""

    attempts: int
    child: Body
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BodyCondition:
    """A condition of a template body."""

    condition: Formula
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BodyCall:
    """A call of an action or of another template."""

    kind: Literal["action", "template"]
    name: str
    args: tuple[Term, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BodyForeach:
    """The child once for every binding, as children of the parent."""

    parameters: tuple[Parameter, ...]
    child: Body
    span: Span | None = field(default=None, compare=False, repr=False)


Body: TypeAlias = BodyControl | BodyRetry | BodyCondition | BodyCall | BodyForeach


@dataclass(frozen=True, slots=True)
class Template:
    """A named subtree; precondition and effect only guide the planner (effect None: no guide)."""

    name: str
    parameters: tuple[Parameter, ...]
    precondition: Formula
    effect: Effect | None
    body: Body
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Threshold:
    """``(believed condition at_least)``: a fact for each binding of the parameters is true where the
    condition has this probability, given what was told, false where its contrary has, and else unknown.
    ``called`` is what its name tells of the condition."""

    parameters: tuple[Parameter, ...]
    condition: Formula
    at_least: Fraction
    called: str
    span: Span | None = field(default=None, compare=False, repr=False)


# --- the problem -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class InitialFact:
    """The value of a ground atom at the start. What no fact mentions is false."""

    predicate: str
    args: tuple[str, ...]
    value: Truth
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class InitialClause:
    """``(or …)`` and the like in ``:init``: it is known to hold at the start, and in every
    reachable state if it is an ``invariant``."""

    condition: Formula
    invariant: bool = False
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Init:
    """The start: certain facts, numbers, draws (``probabilistic`` and ``oneof``) and clauses."""

    facts: tuple[InitialFact, ...] = ()
    numbers: Mapping[tuple[str, tuple[str, ...]], Fraction] = field(default_factory=dict)
    choices: tuple[Effect, ...] = ()
    clauses: tuple[InitialClause, ...] = ()
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Model:
    """A domain and, unless ``problem`` is None, a problem. Mappings are in source order.

    ``counts_cost``: the domain has a cost fluent, so an action costs what it adds to it;
    otherwise every action costs 1. ``goal`` is None where the problem states none.
    """

    domain: str
    problem: str | None
    types: TypeHierarchy
    objects: Mapping[str, Object]
    predicates: Mapping[str, Predicate]
    functions: Mapping[str, Function]
    schemas: Mapping[str, Schema]
    """Actions, and events behind them."""
    rules: tuple[Rule, ...]
    sensors: tuple[Sensor, ...]
    templates: Mapping[str, Template]
    init: Init
    goal: Formula | None
    goal_probability: Fraction = Fraction(1)
    goal_reward: Fraction = Fraction(0)
    metric: Literal["cost", "reward"] = "cost"
    counts_cost: bool = False
    thresholds: Mapping[str, Threshold] = field(default_factory=dict)
    """By the predicate that stands for each."""
    may_fail: bool = False
    """Preconditions on what is hidden are about the world: where they are false, actions change nothing."""
    true_worlds: tuple[tuple[InitialFact, ...], ...] = ()
    """What is true at the start of simulated runs, one of several: ``:hidden``, and ``:init`` beside
    ``:init-belief``. Facts that are not mentioned are false."""
    symbols: tuple[str, ...] = ()
    """Predicates that stand for what is told, and for nothing else."""
    requirements: Mapping[str, Span] = field(default_factory=dict)
    goal_span: Span | None = field(default=None, compare=False, repr=False)
    span: Span | None = field(default=None, compare=False, repr=False)
    problem_span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def events(self) -> tuple[Schema, ...]:
        """The schemas that are events."""
        return tuple(schema for schema in self.schemas.values() if schema.exogenous is not None)


def walk(body: Body) -> Iterator[Body]:
    """Every part of a body, parents first, from left to right."""
    yield body
    match body:
        case BodyControl(_, children):
            for child in children:
                yield from walk(child)
        case BodyForeach(_, child) | BodyRetry(_, child):
            yield from walk(child)
        case BodyCall() | BodyCondition():
            return
        case _:
            assert_never(body)


def calls(body: Body) -> Iterator[BodyCall]:
    """The calls in a body."""
    return (part for part in walk(body) if isinstance(part, BodyCall))


def conditions(body: Body) -> Iterator[Formula]:
    """The conditions in a body, without those of what it calls."""
    return (part.condition for part in walk(body) if isinstance(part, BodyCondition))


def set_values(model: Model) -> dict[str, set[Truth]]:
    """The values that actions may give the atoms of each predicate that any sets."""
    found: dict[str, set[Truth]] = {}
    for schema in model.schemas.values():
        for each in settings(schema.effects, possible=True):
            found.setdefault(each.predicate, set()).add(each.value)
    return found


def rounds_of(model: Model) -> dict[str, int]:
    """By event, the number of its round: that after the last round of those which are before it, or 0."""
    orders = {
        name: schema.exogenous.before
        for name, schema in model.schemas.items()
        if schema.exogenous is not None
    }
    before: dict[str, list[str]] = {name: [] for name in orders}
    for name, later in orders.items():
        for each in later:
            before[each].append(name)
    rounds: dict[str, int] = {}
    while len(rounds) < len(orders):  # no event is before itself: that was checked with the names
        for name, earlier in before.items():
            if name not in rounds and all(each in rounds for each in earlier):
                rounds[name] = max((rounds[each] + 1 for each in earlier), default=0)
    return rounds
