"""Lifted effects, as written: ``when``, ``forall`` and chance nest freely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.durations import Duration, Empirical, Fixed, LogNormal, Triangular, Uniform
from bbtc.kleene import Truth
from bbtc.model.amount import Amount, Arithmetic, Constant, FunctionValue
from bbtc.model.amount import substitute as substitute_amount
from bbtc.model.formula import Atom, Formula, Term, substitute_atom
from bbtc.model.formula import substitute as substitute_formula
from bbtc.model.types import Parameter
from bbtc.source import Span

__all__ = ["Amount", "Arithmetic", "Constant", "FunctionValue"]


@dataclass(frozen=True, slots=True)
class Set:
    """Makes an atom true, false or unknown."""

    predicate: str
    args: tuple[Term, ...]
    value: Truth
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Together:
    """All parts at once; without parts, no change."""

    parts: tuple[Effect, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class When:
    """The effect, if the condition is true in the state before the action."""

    condition: Formula
    effect: Effect
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class ForEach:
    """The effect for every binding of the parameters; chance inside is drawn for each of them."""

    parameters: tuple[Parameter, ...]
    effect: Effect
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Branch:
    """One thing that may happen, with its probability."""

    probability: Fraction
    effect: Effect
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Choice:
    """Exactly one branch happens; probabilities sum to 1. ``oneof`` marks branches whose
    probabilities are not known and count as equal."""

    branches: tuple[Branch, ...]
    oneof: bool = False
    span: Span | None = field(default=None, compare=False, repr=False)
    timeout: TimeOut | None = None
    """If given, the first of two branches is what happens where an action is given up, and the probabilities
    follow from this; those of the branches stand for any."""


@dataclass(frozen=True, slots=True)
class LiftedDuration:
    """How long an action takes: a number of seconds, or a distribution of them (:mod:`bbtc.durations`)."""

    kind: Literal["number", "uniform", "triangular", "empirical", "lognormal"]
    amounts: tuple[Amount, ...]
    weights: tuple[Fraction, ...] = ()
    span: Span | None = field(default=None, compare=False, repr=False)


def duration_of(lifted: LiftedDuration, values: Sequence[Fraction]) -> Duration:
    """The duration with these values of its amounts; they need not make sense."""
    match lifted.kind:
        case "number":
            return Fixed(values[0])
        case "uniform":
            return Uniform(values[0], values[1])
        case "triangular":
            return Triangular(values[0], values[1], values[2])
        case "lognormal":
            return LogNormal(values[0], values[1])
        case "empirical":
            return Empirical(tuple(zip(values, lifted.weights, strict=True)))
        case _:
            assert_never(lifted.kind)


@dataclass(frozen=True, slots=True)
class TimeOut:
    """An action is given up after so many seconds; how probably it comes to that is given, or follows from
    its duration."""

    seconds: Amount
    duration: LiftedDuration | None
    probability: Fraction | None
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Add:
    """Adds to the cost or the reward; ``sign`` is -1 for a decrease."""

    to: Literal["cost", "reward"]
    amount: Amount
    sign: int = 1
    span: Span | None = field(default=None, compare=False, repr=False)


Operator: TypeAlias = Literal["increase", "decrease", "assign", "scale-up", "scale-down"]


@dataclass(frozen=True, slots=True)
class Change:
    """Changes a number. ``digits`` are the facts that it is written in, once that is settled
    (:mod:`bbtc.ground.numbers.digits`)."""

    function: str
    args: tuple[Term, ...]
    operator: Operator
    amount: Amount
    digits: tuple[Atom, ...] = ()
    reads: tuple[Atom, ...] = ()
    """The digits of the numbers that the amount reads."""
    span: Span | None = field(default=None, compare=False, repr=False)


Leaf: TypeAlias = Set | Add | Change
Effect: TypeAlias = Set | Together | When | ForEach | Choice | Add | Change
NOTHING = Together(())


def walk(effect: Effect, *, possible: bool = False) -> Iterator[Effect]:
    """Every part of an effect, parents first, from left to right; with ``possible``, without what stands in
    branches of probability 0."""
    waiting = [effect]
    while waiting:
        each = waiting.pop()
        yield each
        match each:
            case Set() | Add() | Change():
                pass
            case Together(parts):
                waiting.extend(reversed(parts))
            case When(_, part) | ForEach(_, part):
                waiting.append(part)
            case Choice(branches):
                waiting += (b.effect for b in reversed(branches) if not possible or b.probability > 0)
            case _:
                assert_never(each)


def both_ways(effects: Sequence[Effect]) -> bool:
    """Are these two, of which one makes true what the other makes false?"""
    match effects:
        case [Set(predicate, args, Truth() as one), Set(other, others, Truth() as two)]:
            return (predicate, args) == (other, others) and {one, two} == {Truth.TRUE, Truth.FALSE}
        case _:
            return False


def leaves(effect: Effect, *, possible: bool = False) -> Iterator[Leaf]:
    """Everything the effect does somewhere; ``possible`` as in :func:`walk`."""
    return (part for part in walk(effect, possible=possible) if isinstance(part, Set | Add | Change))


def sets_of(leaf: Leaf) -> tuple[Set, ...]:
    """What a leaf may set: of a number, each of its digits, either way."""
    match leaf:
        case Set():
            return (leaf,)
        case Add():
            return ()
        case Change():
            return tuple(
                Set(digit.predicate, digit.args, value, leaf.span)
                for digit in leaf.digits
                for value in (Truth.TRUE, Truth.FALSE)
            )
        case _:
            assert_never(leaf)


def settings(effect: Effect, *, possible: bool = False) -> Iterator[Set]:
    """Every setting in the effect, those of digits included."""
    return (each for leaf in leaves(effect, possible=possible) for each in sets_of(leaf))


def changes(effect: Effect) -> Iterator[Change]:
    """Every change of a number in the effect."""
    return (leaf for leaf in leaves(effect) if isinstance(leaf, Change))


def earns(effect: Effect) -> bool:
    """Whether anything in the effect adds to the reward."""
    return any(isinstance(leaf, Add) and leaf.to == "reward" for leaf in leaves(effect))


def conditions(effect: Effect) -> Iterator[Formula]:
    """The conditions of every ``when`` in the effect."""
    return (part.condition for part in walk(effect) if isinstance(part, When))


def substitute(effect: Effect, binding: dict[str, Term]) -> Effect:
    """The effect with free parameters replaced (see :func:`bbtc.model.formula.substitute`)."""
    match effect:
        case Set(predicate, args, value, span):
            return Set(predicate, tuple(binding.get(a, a) for a in args), value, span)
        case Add(to, amount, sign, span):
            return Add(to, substitute_amount(amount, binding), sign, span)
        case Change(function, args, operator, amount, digits, read, span):
            return Change(
                function,
                tuple(binding.get(a, a) for a in args),
                operator,
                substitute_amount(amount, binding),
                tuple(substitute_atom(each, binding) for each in digits),
                tuple(substitute_atom(each, binding) for each in read),
                span,
            )
        case Together(parts, span):
            return Together(tuple(substitute(part, binding) for part in parts), span)
        case When(condition, inner, span):
            return When(substitute_formula(condition, binding), substitute(inner, binding), span)
        case ForEach(parameters, inner, span):
            return ForEach(parameters, substitute(inner, binding), span)
        case Choice(branches):
            drawn = tuple(Branch(b.probability, substitute(b.effect, binding), b.span) for b in branches)
            return replace(effect, branches=drawn, timeout=_substitute_timeout(effect.timeout, binding))
        case _:
            assert_never(effect)


def substitute_duration(duration: LiftedDuration | None, binding: dict[str, Term]) -> LiftedDuration | None:
    """The duration with free parameters replaced."""
    if duration is None:
        return None
    return replace(duration, amounts=tuple(substitute_amount(each, binding) for each in duration.amounts))


def functions_timing(duration: LiftedDuration | None, timeout: TimeOut | None) -> Iterator[str]:
    """The functions that a duration and a time-out read, repeats included."""
    waiting = [] if duration is None else list(duration.amounts)
    waiting += [] if timeout is None else [timeout.seconds]
    while waiting:
        match waiting.pop():
            case FunctionValue(function):
                yield function
            case Arithmetic(_, operands):
                waiting.extend(operands)
            case Constant():
                pass


def _substitute_timeout(timeout: TimeOut | None, binding: dict[str, Term]) -> TimeOut | None:
    if timeout is None:
        return None
    seconds = substitute_amount(timeout.seconds, binding)
    return replace(timeout, seconds=seconds, duration=substitute_duration(timeout.duration, binding))
