"""Numeric expressions made ground, and what comparisons of them come to: conditions on single numbers.

A comparison of several numbers is told apart by the values of all but one of them, of which it then says
between which values it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import ceil, floor
from operator import eq, ge, gt, le, lt, ne
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.diagnostics import Report
from bbtc.ground.condition import FALSE, TRUE, Condition, conjunction, disjunction, within
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.task import digit_name
from bbtc.ground.universe import Row
from bbtc.model import formula as mf
from bbtc.model.amount import Amount, Arithmetic, Constant, FunctionValue, functions
from bbtc.rounding import too_long
from bbtc.source import Span

MOST_CASES = 65_536
"""Combinations of values that one comparison, or one change, is told apart by."""

Env: TypeAlias = list[int]
Rows: TypeAlias = Callable[[tuple[str, ...]], Callable[[Env], Row]]
_TESTS: Mapping[mf.Comparator, Callable[[Fraction, Fraction], bool]]
_TESTS = {"<": lt, "<=": le, "=": eq, "!=": ne, ">=": ge, ">": gt}
_ZERO = Fraction(0)


@dataclass(frozen=True, slots=True)
class Number:
    """A number of the state: its digits, its range, and whether actions that may leave that are kept from
    starting; a range that was ``found`` is one that nothing leaves."""

    name: str
    digits: tuple[int, ...]
    low: int
    high: int
    blocks: bool = False
    found: bool = False

    @property
    def size(self) -> int:
        """How many values it has."""
        return self.high - self.low + 1

    def between(self, low: int, high: int) -> Condition:
        """That it is from one value to another; the top of its range is no bound."""
        top = (1 << len(self.digits)) - 1
        return within(self.digits, low - self.low, top if high >= self.high else high - self.low)


@dataclass(frozen=True, slots=True)
class Value:
    """A ground expression: what it reads, and its value where each of that has one. One that is a sum is so
    with ``factors`` of what it reads, beside a constant."""

    reads: tuple[Number, ...]
    of: Callable[[Mapping[Number, int]], Fraction | None]
    """None where it is not defined."""
    factors: Mapping[Number, Fraction] | None = field(default=None)
    constant: Fraction = _ZERO

    @property
    def fixed(self) -> Fraction | None:
        """The value of an expression that reads no number of the state."""
        return None if self.reads else self.of({})


def constant(value: Fraction) -> Value:
    """An expression that is the same in all states."""
    return Value((), lambda _: value, {}, value)


def combined(operator: str, values: Sequence[Value]) -> Value:
    """``+ - * /`` of expressions."""
    first = values[0]
    if operator == "-" and len(values) == 1:
        return combined("-", (constant(_ZERO), first))
    for other in values[1:]:
        first = _joined(operator, first, other)
    return first


def _joined(operator: str, one: Value, other: Value) -> Value:
    reads = tuple(dict.fromkeys((*one.reads, *other.reads)))

    def of(state: Mapping[Number, int]) -> Fraction | None:
        left, right = one.of(state), other.of(state)
        if left is None or right is None:
            return None
        match operator:
            case "+":
                return left + right
            case "-":
                return left - right
            case "*":
                return left * right
            case _:
                return left / right if right else None

    if one.factors is None or other.factors is None:
        return Value(reads, of)
    if operator in "+-":
        sign = 1 if operator == "+" else -1
        factors = {
            each: one.factors.get(each, _ZERO) + sign * other.factors.get(each, _ZERO) for each in reads
        }
        return Value(reads, of, factors, one.constant + sign * other.constant)
    if operator == "*" and not (one.reads and other.reads):
        many, factor = (other, one.constant) if other.reads else (one, other.constant)
        return Value(
            reads,
            of,
            {each: factor * many.factors[each] for each in reads} if many.factors is not None else None,
            factor * many.constant,
        )
    if operator == "/" and not other.reads and other.constant:
        return Value(
            reads,
            of,
            {each: one.factors[each] / other.constant for each in reads},
            one.constant / other.constant,
        )
    return Value(reads, of)


class TooManyCases(Exception):
    """A comparison or a change reads more combinations of values than are told apart."""


def cases(reads: Sequence[Number]) -> Iterator[tuple[Condition, dict[Number, int]]]:
    """Every combination of values of some numbers, with the condition that it is the case. Raises
    :class:`TooManyCases`."""
    count = 1
    for each in reads:
        count *= each.size
    if count > MOST_CASES:
        raise TooManyCases
    if not reads:
        yield TRUE, {}
        return
    first, rest = reads[0], reads[1:]
    for value in range(first.low, first.high + 1):
        here = first.between(value, value)
        for condition, state in cases(rest):
            yield conjunction([here, condition]), {first: value, **state}


def compared(operator: mf.Comparator, left: Value, right: Value) -> Condition:
    """The condition that two expressions compare so. Where one of them is not defined it is false. Raises
    :class:`TooManyCases`."""
    difference = _joined("-", left, right)
    reads = [each for each in difference.reads if difference.factors is None or difference.factors[each]]
    if not reads:
        settled = difference.of({each: each.low for each in difference.reads})
        return TRUE if settled is not None and _TESTS[operator](settled, _ZERO) else FALSE
    last = max(reads, key=lambda each: each.size)
    others = [each for each in reads if each is not last]
    if others:
        # What is alike for neighbouring values of the first is said of all of them at once.
        first, rest = others[0], others[1:]
        count = first.size
        for each in rest:
            count *= each.size
        if count > MOST_CASES:
            raise TooManyCases
        alike: dict[Condition, list[tuple[int, int]]] = {}
        for value in range(first.low, first.high + 1):
            at = _at(difference, first, value)
            condition = compared(operator, at, constant(_ZERO))
            spans = alike.setdefault(condition, [])
            if spans and spans[-1][1] == value - 1:
                spans[-1] = (spans[-1][0], value)
            else:
                spans.append((value, value))
        return disjunction(
            conjunction([disjunction(first.between(*span) for span in spans), condition])
            for condition, spans in alike.items()
        )
    return disjunction(last.between(*span) for span in _spans(operator, difference, last))


def _at(value: Value, number: Number, given: int) -> Value:
    """An expression in which one number has a value."""
    reads = tuple(each for each in value.reads if each is not number)
    factors = None
    more = value.constant
    if value.factors is not None:
        factors = {each: value.factors[each] for each in reads}
        more += value.factors[number] * given
    return Value(reads, lambda state: value.of({**state, number: given}), factors, more)


def _spans(operator: mf.Comparator, value: Value, number: Number) -> Iterator[tuple[int, int]]:
    """The values of a number for which an expression of it compares so with zero."""
    low, high = number.low, number.high
    if value.factors is None:
        if number.size > MOST_CASES:
            raise TooManyCases
        rest = {each: each.low for each in value.reads}
        start: int | None = None
        for at in range(low, high + 2):
            found = value.of({**rest, number: at}) if at <= high else None
            holds = found is not None and _TESTS[operator](found, _ZERO)
            if holds and start is None:
                start = at
            elif not holds and start is not None:
                yield start, at - 1
                start = None
        return
    factor = value.factors[number]
    root = -value.constant / factor
    if factor < 0:
        mirrored: Mapping[mf.Comparator, mf.Comparator]
        mirrored = {"<": ">", "<=": ">=", "=": "=", "!=": "!=", ">=": "<=", ">": "<"}
        operator = mirrored[operator]
    match operator:
        case "<":
            spans = [(low, ceil(root) - 1)]
        case "<=":
            spans = [(low, floor(root))]
        case ">":
            spans = [(floor(root) + 1, high)]
        case ">=":
            spans = [(ceil(root), high)]
        case "=":
            spans = [(int(root), int(root))] if root.denominator == 1 else []
        case "!=":
            spans = [(low, ceil(root) - 1), (floor(root) + 1, high)]
        case _:
            assert_never(operator)
    for least, most in spans:
        if max(least, low) <= min(most, high):
            yield max(least, low), min(most, high)


class Amounts:
    """Makes the numeric expressions of a model ground."""

    def __init__(self, atoms: Atoms, report: Report) -> None:
        self._atoms = atoms
        self._report = report
        self._values: dict[tuple[str, Row], Value] = {}
        self._numbers: dict[tuple[str, Row], Number | None] = {}

    def lower(self, amount: Amount, rows: Rows) -> Callable[[Env], Value]:
        """An expression as a function of the environment; ``rows`` reads arguments there."""
        match amount:
            case Constant(value):
                fixed = constant(value)
                return lambda _env: fixed
            case FunctionValue(function, args, span):
                read = rows(args)
                return lambda env: self._value(function, read(env), span)
            case Arithmetic(operator, operands):
                lowered = [self.lower(operand, rows) for operand in operands]
                return lambda env: combined(operator, [each(env) for each in lowered])
            case _:
                assert_never(amount)

    def depends(self, amount: Amount) -> bool:
        """Does an expression read numbers of the state?"""
        functions_ = self._atoms.model.functions
        return any(functions_[value.function].range is not None for value in functions(amount))

    def changed(self, function: str, row: Row) -> Number | None:
        """The number that a change sets; None for one that never changes, or that nothing reads."""
        return self._number(function, row, asked=False)

    def compare(self, compare: mf.Compare, rows: Rows) -> Callable[[Env], Condition]:
        """A comparison as a function of the environment."""
        left, right = self.lower(compare.left, rows), self.lower(compare.right, rows)

        def condition(env: Env) -> Condition:
            try:
                return compared(compare.operator, left(env), right(env))
            except TooManyCases:
                self._report.error("BBT0440", too_many("comparison"), compare.span, FEWER)
                return FALSE

        return condition

    def _value(self, function: str, row: Row, span: Span | None) -> Value:
        key = function, row
        if key not in self._values:
            number = self._number(function, row, asked=True)
            self._values[key] = (
                constant(self._given(function, row, span)) if number is None else _plain(number)
            )
        return self._values[key]

    def _given(self, function: str, row: Row, span: Span | None) -> Fraction:
        """The value that a number has at the start."""
        args = self._atoms.universe.args(row)
        found = self._atoms.model.init.numbers.get((function, args))
        if found is None:
            shown = " ".join((function, *args))
            self._report.error("BBT0410", f"`:init` gives no value for `({shown})`", span)
            return _ZERO
        return _ZERO if too_long(found) else found

    def _number(self, function: str, row: Row, *, asked: bool) -> Number | None:
        declared = self._atoms.model.functions[function].range
        if declared is None:
            return None
        digits: list[int] = []
        for place in range(declared.digits):
            predicate = digit_name(function, place)
            number = self._atoms.number(predicate, row) if asked else self._atoms.numbers[predicate].get(row)
            if number is None:
                return None
            digits.append(number)
        self._given(function, row, self._atoms.model.functions[function].span)
        name = " ".join((function, *self._atoms.universe.args(row)))
        return Number(
            f"({name})", tuple(digits), declared.low, declared.high, declared.blocks, declared.found
        )


def too_many(what: str) -> str:
    """The message that a comparison or a change reads too many combinations of values."""
    return f"this {what} reads numbers with more than {MOST_CASES:,} combinations of values"


FEWER = "smaller ranges, or fewer numbers at once, have fewer"


def _plain(number: Number) -> Value:
    return Value((number,), lambda state: Fraction(state[number]), {number: Fraction(1)})
