"""The ranges of numbers that no declaration bounds, by bounded reachability.

All numbers of a function share one interval. It begins with the values of ``:init``; each change widens it by
what it may lead to from the intervals so far, as far as preconditions and guards allow, until nothing grows
any more (the interval relaxation of numeric planning). What still grows after many rounds has no bound that
is seen here, and is refused by the change that makes it grow.

A condition bounds what a change leads to where both speak of the same: after ``(decrease (fuel ?v) (use
?a))`` under ``(>= (fuel ?v) (use ?a))`` the fuel is 0 at least, whatever the use. So the new value and the
condition are written as sums of products, and where their sum or difference is free of numbers that change,
it bounds the new value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, floor, inf
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.ground.normal import conjuncts, normal_form
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.amount import Amount, Arithmetic, Constant, FunctionValue, functions
from bbtc.model.intervals import Interval, arithmetic, both_ways, interval, never

LARGEST = 2**31
"""Numbers stay within this, above and below zero."""
_EXACT_ROUNDS = 12
"""After so many rounds, what grows is taken to grow without end, and so many rounds let conditions bound it
again."""
_TERMS = 64
"""An expression of more products is not looked into."""

_Monomial: TypeAlias = tuple[tuple[str, tuple[str, ...]], ...]
_Sum: TypeAlias = dict[_Monomial, Fraction]
"""A sum of products of values of functions, each product with its factor."""


@dataclass(frozen=True, slots=True)
class _Doing:
    """A change with the conditions around it."""

    change: me.Change
    conditions: tuple[mf.Formula, ...]


def with_ranges(model: md.Model, report: Report) -> md.Model:
    """The model in which every number that changes, and that something reads, has a range. Reports numbers
    without bounds (BBT0438)."""
    doings = [
        each
        for schema in model.schemas.values()
        for each in _doings(schema.effect, tuple(conjuncts(normal_form(schema.precondition))))
    ]
    # What happens where an action ends early is read in another state than its precondition.
    doings += [each for schema in model.schemas.values() for each in _doings(schema.on_abort, ())]
    changed = {each.change.function for each in doings}
    read = set(_read(model))
    open_ = {name for name in changed & read if model.functions[name].range is None}
    if not open_:
        return model
    found = _Fixpoint(model, doings, open_).found(report)
    functions_ = {
        name: replace(each, range=found[name]) if name in found else each
        for name, each in model.functions.items()
    }
    return replace(model, functions=functions_)


def _doings(effect: me.Effect, above: tuple[mf.Formula, ...]) -> Iterator[_Doing]:
    match effect:
        case me.Change():
            yield _Doing(effect, above)
        case me.Together(parts):
            for part in parts:
                yield from _doings(part, above)
        case me.When(condition, inner):
            yield from _doings(inner, (*above, *conjuncts(normal_form(condition))))
        case me.ForEach(_, inner):
            yield from _doings(inner, above)
        case me.Choice(branches):
            for branch in branches:
                if branch.probability > 0:
                    yield from _doings(branch.effect, above)
        case me.Set() | me.Add():
            return
        case _:
            assert_never(effect)


def _read(model: md.Model) -> Iterator[str]:
    """Functions that conditions, costs, or changes of other numbers read."""
    formulas: list[mf.Formula] = [schema.precondition for schema in model.schemas.values()]
    for schema in model.schemas.values():
        formulas += me.conditions(schema.effects)
        formulas += [] if schema.during is None else [schema.during]
        for leaf in me.leaves(schema.effects):
            if isinstance(leaf, me.Add):
                yield from (value.function for value in functions(leaf.amount))
            elif isinstance(leaf, me.Change):
                names = {value.function for value in functions(leaf.amount)}
                yield from names - {leaf.function}
    for template in model.templates.values():
        formulas += [template.precondition, *md.conditions(template.body)]
        formulas += [] if template.effect is None else list(me.conditions(template.effect))
    formulas += [rule.condition for rule in model.rules]
    formulas += [] if model.goal is None else [model.goal]
    for formula in formulas:
        for side in _sides(formula):
            yield from (value.function for value in functions(side))


def _sides(formula: mf.Formula) -> Iterator[Amount]:
    match formula:
        case mf.Compare(_, left, right):
            yield left
            yield right
        case mf.Not(part) | mf.Quantified(_, _, part):
            yield from _sides(part)
        case mf.And(parts) | mf.Or(parts):
            for part in parts:
                yield from _sides(part)
        case mf.Atom() | mf.Test() | mf.Equal():
            return
        case _:
            assert_never(formula)


class _Fixpoint:
    def __init__(self, model: md.Model, doings: list[_Doing], open_: set[str]) -> None:
        self._model = model
        self._open = open_
        self._doings = [each for each in doings if each.change.function in open_]
        self._changing = {each.change.function for each in doings}
        self._intervals: dict[str, Interval] = {}
        self._blamed: dict[tuple[str, bool], _Doing] = {}
        """By number, and whether it falls: the change that moves its end, round after round."""
        values: dict[str, list[Fraction]] = {}
        for (name, _), value in model.init.numbers.items():
            values.setdefault(name, []).append(value)
        for name, function in model.functions.items():
            given = values.get(name)
            if function.range is not None:
                self._intervals[name] = (Fraction(function.range.low), Fraction(function.range.high))
            elif given:
                self._intervals[name] = (min(given), max(given))

    def found(self, report: Report) -> dict[str, md.NumberRange]:
        """The range of each function."""
        self._settle()
        ranges: dict[str, md.NumberRange] = {}
        for name in sorted(self._open):
            if name not in self._intervals:
                continue  # no value at the start: told where it is read
            low, high = self._intervals[name]
            if low == -inf or high == inf:
                self._refuse(name, falls=low == -inf, report=report)
            elif low < -LARGEST or high > LARGEST:
                message = f"`{name}` may go from {low} to {high}, beyond 2^31"
                report.error("BBT0437", message, self._model.functions[name].span)
            else:
                span = self._model.functions[name].span
                ranges[name] = md.NumberRange(floor(low), ceil(high), span=span, found=True)
        return ranges

    def _settle(self) -> None:
        """Widen until nothing grows; what grows for long is taken to grow without end, as far as conditions
        let it (widening and narrowing: Cousot and Cousot 1977)."""
        first = dict(self._intervals)
        for round_ in range(_EXACT_ROUNDS + 2 * len(first) + 2):
            new = self._stepped(self._intervals)
            if new == self._intervals:
                break
            if round_ >= _EXACT_ROUNDS:
                self._blame(new)
                new = {name: _widened(self._intervals[name], each) for name, each in new.items()}
            self._intervals = new
        for _ in range(_EXACT_ROUNDS):
            self._intervals = self._stepped(first)

    def _blame(self, new: Mapping[str, Interval]) -> None:
        """Note which changes move the ends of intervals."""
        for doing in self._doings:
            name, after = doing.change.function, self._after(doing)
            if after is not None and after[0] == new[name][0] < self._intervals[name][0]:
                self._blamed.setdefault((name, True), doing)
            if after is not None and after[1] == new[name][1] > self._intervals[name][1]:
                self._blamed.setdefault((name, False), doing)

    def _stepped(self, base: Mapping[str, Interval]) -> dict[str, Interval]:
        """Some intervals with what the changes may lead to from the present ones."""
        found = dict(base)
        for doing in self._doings:
            new = self._after(doing)
            if new is not None:
                name = doing.change.function
                found[name] = (min(found[name][0], new[0]), max(found[name][1], new[1]))
        return found

    def _refuse(self, name: str, *, falls: bool, report: Report) -> None:
        """Report the first change that a number has no bound for."""
        change = (self._blamed.get((name, falls)) or self._endless(name, falls=falls)).change
        shown = f"{change.operator} ({' '.join((name, *change.args))})"
        message = f"`{shown}` changes `{name}` {'downwards' if falls else 'upwards'} without a bound"
        hint = (
            f"declare its range in `:functions`: `({name} …) - (int 0 100)`; or let a precondition bound it"
        )
        report.error("BBT0438", message, change.span, hint)

    def _endless(self, name: str, *, falls: bool) -> _Doing:
        """A change of a number that may lead anywhere."""
        return next(
            doing
            for doing in self._doings
            if doing.change.function == name
            and (after := self._after(doing)) is not None
            and (after[0] == -inf if falls else after[1] == inf)
        )

    def _after(self, doing: _Doing) -> Interval | None:
        """What a change may lead to; None where it never happens."""
        change = doing.change
        name = change.function
        impossible = any(never(condition, self._plain) for condition in doing.conditions)
        if name not in self._intervals or impossible:
            return None
        own = FunctionValue(name, change.args)
        match change.operator:
            case "assign":
                new: Amount = change.amount
            case "increase":
                new = Arithmetic("+", (own, change.amount))
            case "decrease":
                new = Arithmetic("-", (own, change.amount))
            case "scale-up":
                new = Arithmetic("*", (own, change.amount))
            case "scale-down":
                new = Arithmetic("/", (own, change.amount))
            case _:
                assert_never(change.operator)
        low, high = self._of(new, doing.conditions)
        for least, most in self._bounds(new, doing.conditions):
            low, high = max(low, least), min(high, most)
        return None if low > high else (low, high)

    # --- what intervals tell -----------------------------------------------------------------

    def _value(self, value: FunctionValue, conditions: tuple[mf.Formula, ...]) -> Interval:
        low, high = self._intervals.get(value.function, (-inf, inf))
        # A condition on this number alone narrows it here.
        for condition in conditions:
            if not isinstance(condition, mf.Compare):
                continue
            for one, other, operator in both_ways(condition):
                if isinstance(one, FunctionValue) and (one.function, one.args) == (
                    value.function,
                    value.args,
                ):
                    least, most = self._plain(other)
                    if operator in (">=", ">", "="):
                        low = max(low, least)
                    if operator in ("<=", "<", "="):
                        high = min(high, most)
        return low, high

    def _plain(self, amount: Amount) -> Interval:
        return self._of(amount, ())

    def _of(self, amount: Amount, conditions: tuple[mf.Formula, ...]) -> Interval:
        return interval(amount, lambda value: self._value(value, conditions))

    # --- what sums tell ----------------------------------------------------------------------

    def _bounds(self, new: Amount, conditions: tuple[mf.Formula, ...]) -> Iterator[Interval]:
        """Bounds of the new value by conditions of which the rest never changes."""
        value = _sum(new)
        if value is None:
            return
        for condition in conditions:
            if not isinstance(condition, mf.Compare):
                continue
            for one, other, operator in both_ways(condition):
                if operator not in (">=", ">", "="):
                    continue
                greater, less = _sum(one), _sum(other)
                if greater is None or less is None:
                    continue
                least = _plus(greater, less, Fraction(-1))  # at least zero
                rest = _plus(value, least, Fraction(-1))
                if (low := self._fixed(rest)) is not None:
                    yield low[0], inf
                rest = _plus(value, least, Fraction(1))
                if (most := self._fixed(rest)) is not None:
                    yield -inf, most[1]

    def _fixed(self, value: _Sum) -> Interval | None:
        """The interval of a sum of what never changes; None for others."""
        total: Interval = (Fraction(0), Fraction(0))
        for monomial, factor in value.items():
            part: Interval = (factor, factor)
            for name, _ in monomial:
                if name in self._changing or name not in self._intervals:
                    return None
                part = arithmetic("*", part, self._intervals[name])
            total = arithmetic("+", total, part)
        return total


def _widened(before: Interval, after: Interval) -> Interval:
    """The interval with each end that moved taken away."""
    return (-inf if after[0] < before[0] else after[0]), (inf if after[1] > before[1] else after[1])


def _sum(amount: Amount) -> _Sum | None:
    """An amount as a sum of products; None where it divides by what is no constant, or is too long."""
    match amount:
        case Constant(value):
            return {(): value} if value else {}
        case FunctionValue(function, args):
            return {((function, args),): Fraction(1)}
        case Arithmetic(operator, operands):
            parts = [_sum(each) for each in operands]
            found = parts[0]
            if found is None:
                return None
            if operator == "-" and len(parts) == 1:
                return _plus({}, found, Fraction(-1))
            for part in parts[1:]:
                if part is None:
                    return None
                if operator == "+":
                    found = _plus(found, part, Fraction(1))
                elif operator == "-":
                    found = _plus(found, part, Fraction(-1))
                elif operator == "*":
                    found = _product(found, part)
                elif list(part) == [()]:
                    found = _plus({}, found, 1 / part[()])
                else:
                    return None
                if len(found) > _TERMS:
                    return None
            return found
        case _:
            assert_never(amount)


def _plus(one: _Sum, other: _Sum, factor: Fraction) -> _Sum:
    found = dict(one)
    for monomial, value in other.items():
        found[monomial] = found.get(monomial, Fraction(0)) + factor * value
    return {monomial: value for monomial, value in found.items() if value}


def _product(one: _Sum, other: _Sum) -> _Sum:
    found: _Sum = {}
    for left, a in one.items():
        for right, b in other.items():
            monomial = tuple(sorted((*left, *right)))
            found[monomial] = found.get(monomial, Fraction(0)) + a * b
    return {monomial: value for monomial, value in found.items() if value}
