"""Which facts the numbers of a model are written in: binary digits, counted from the least value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.diagnostics import Diagnostic, Report, Severity
from bbtc.ground.numbers.ranges import with_ranges
from bbtc.ground.task import Digit, digit_name
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.amount import Amount, functions
from bbtc.model.hidden import has_hidden_state


def is_digit(model: md.Model, predicate: str) -> bool:
    """Is a predicate that of a digit?"""
    function, found, _ = predicate.partition(" digit ")
    return bool(found) and function in model.functions


def digits_of(model: md.Model) -> dict[str, Digit]:
    """What each predicate of a digit stands for."""
    return {
        digit_name(name, place): Digit(name, place, span.low, span.high, span.blocks)
        for name, function in model.functions.items()
        if (span := function.range) is not None
        for place in range(span.digits)
    }


def with_digits(model: md.Model, report: Report) -> md.Model:
    """The model in which each number that changes is kept in predicates, which stand where conditions and
    effects tell what they read and set. Errors go to the report: numbers without bounds (BBT0438), values
    outside the range at the start (BBT0439), and numbers beside hidden state (BBT0441)."""
    if not any(md.is_number(name) for name in model.predicates):
        return _without(model)
    model = with_ranges(model, report)
    if report.errors:
        return _without(model)
    ranges = {name: function.range for name, function in model.functions.items() if function.range}
    if ranges and has_hidden_state(model):
        first = next(function for function in model.functions.values() if function.range)
        message = f"the number `{first.name}` stands beside hidden state, which is not supported"
        hint = "say what the robot knows as facts that may be unknown, or make the number facts of its own"
        report.error("BBT0441", message, first.span, hint)
        return _without(model)
    predicates = {name: each for name, each in model.predicates.items() if not md.is_number(name)}
    for name, span in ranges.items():
        function = model.functions[name]
        for place in range(span.digits):
            digit = digit_name(name, place)
            predicates[digit] = md.Predicate(digit, function.parameters, span=function.span, inferred=True)
    facts = [
        fact
        for (name, args), value in model.init.numbers.items()
        for fact in _facts(model, name, args, value, report)
    ]
    rewrite = _Rewriting({name: span.digits for name, span in ranges.items()})
    return rewrite.model(
        replace(model, predicates=predicates, init=replace(model.init, facts=(*model.init.facts, *facts)))
    )


def number_faults(model: md.Model) -> Iterator[Diagnostic]:
    """What :func:`with_digits` reports of a model with a problem; that numbers stand beside hidden state only
    as a note, since it is right, but cannot be grounded."""
    report = Report()
    if model.problem is not None:
        with_digits(model, report)
    for diagnostic in report:
        yield replace(diagnostic, severity=Severity.NOTE) if diagnostic.code == "BBT0441" else diagnostic


def _facts(
    model: md.Model, name: str, args: tuple[str, ...], value: Fraction, report: Report
) -> Iterable[md.InitialFact]:
    """The digits of a number at the start that are 1."""
    span = model.functions[name].range
    if span is None:
        return
    shown = " ".join((name, *args))
    if value.denominator != 1:
        message = f"`({shown})` is {value} at the start, no whole number"
        report.error("BBT0439", message, model.init.span, "count in a smaller unit")
    elif not span.low <= value <= span.high:
        message = f"`({shown})` is {value} at the start, outside its range from {span.low} to {span.high}"
        report.error("BBT0439", message, model.init.span or model.problem_span)
    else:
        offset = int(value) - span.low
        for place in range(span.digits):
            if offset >> place & 1:
                yield md.InitialFact(digit_name(name, place), args, Truth.TRUE, model.init.span)


def _without(model: md.Model) -> md.Model:
    """The model without what stands for numbers."""
    if not any(md.is_number(name) for name in model.predicates):
        return model
    predicates = {name: each for name, each in model.predicates.items() if not md.is_number(name)}
    return _Rewriting({}).model(replace(model, predicates=predicates))


class _Rewriting:
    """Tells conditions and effects what digits they read and set."""

    def __init__(self, digits: dict[str, int]) -> None:
        self._digits = digits

    def _atoms(self, *amounts: Amount) -> tuple[mf.Atom, ...]:
        found = {
            mf.Atom(digit_name(value.function, place), value.args, value.span): None
            for amount in amounts
            for value in functions(amount)
            for place in range(self._digits.get(value.function, 0))
        }
        return tuple(found)

    def model(self, model: md.Model) -> md.Model:
        """Every condition and effect of a model."""
        return replace(
            model,
            schemas={
                name: replace(
                    schema,
                    precondition=self.formula(schema.precondition),
                    effect=self.effect(schema.effect),
                    during=None if schema.during is None else self.formula(schema.during),
                    on_abort=self.effect(schema.on_abort),
                )
                for name, schema in model.schemas.items()
            },
            rules=tuple(replace(rule, condition=self.formula(rule.condition)) for rule in model.rules),
            templates={
                name: replace(
                    template,
                    precondition=self.formula(template.precondition),
                    effect=None if template.effect is None else self.effect(template.effect),
                    body=self._body(template.body),
                )
                for name, template in model.templates.items()
            },
            goal=None if model.goal is None else self.formula(model.goal),
        )

    def _body(self, body: md.Body) -> md.Body:
        match body:
            case md.BodyControl(_, children):
                return replace(body, children=tuple(map(self._body, children)))
            case md.BodyCondition(condition):
                return replace(body, condition=self.formula(condition))
            case md.BodyForeach(_, child) | md.BodyRetry(_, child):
                return replace(body, child=self._body(child))
            case md.BodyCall():
                return body
            case _:
                assert_never(body)

    def formula(self, formula: mf.Formula) -> mf.Formula:
        """A condition that tells which digits it reads."""
        match formula:
            case mf.Compare(_, left, right):
                return replace(formula, digits=self._atoms(left, right))
            case mf.Not(part):
                return _changed(formula, part, self.formula, lambda made: replace(formula, part=made))
            case mf.And(parts) | mf.Or(parts):
                made = tuple(map(self.formula, parts))
                same = all(one is other for one, other in zip(made, parts, strict=True))
                return formula if same else replace(formula, parts=made)
            case mf.Quantified(_, _, part):
                return _changed(formula, part, self.formula, lambda made: replace(formula, part=made))
            case mf.Atom() | mf.Test() | mf.Equal():
                return formula
            case _:
                assert_never(formula)

    def effect(self, effect: me.Effect) -> me.Effect:
        """An effect that tells which digits it reads and sets; numbers that are no part of the state are
        left out."""
        match effect:
            case me.Change(function, args, _, amount):
                if function not in self._digits:
                    return me.NOTHING
                own = self._atoms(me.FunctionValue(function, args, effect.span))
                return replace(effect, digits=own, reads=self._atoms(amount))
            case me.Together(parts):
                made = tuple(map(self.effect, parts))
                same = all(one is other for one, other in zip(made, parts, strict=True))
                return effect if same else replace(effect, parts=made)
            case me.When(condition, inner):
                return replace(effect, condition=self.formula(condition), effect=self.effect(inner))
            case me.ForEach(_, inner):
                return replace(effect, effect=self.effect(inner))
            case me.Choice(branches):
                return replace(
                    effect,
                    branches=tuple(replace(each, effect=self.effect(each.effect)) for each in branches),
                )
            case me.Set() | me.Add():
                return effect
            case _:
                assert_never(effect)


def _changed(
    whole: mf.Formula,
    part: mf.Formula,
    change: Callable[[mf.Formula], mf.Formula],
    put: Callable[[mf.Formula], mf.Formula],
) -> mf.Formula:
    made = change(part)
    return whole if made is part else put(made)
