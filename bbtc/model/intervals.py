"""Between which values numeric expressions are, given that of what they read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from math import inf
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.model import formula as mf
from bbtc.model.amount import Amount, Arithmetic, Constant, FunctionValue

Interval: TypeAlias = tuple[Fraction | float, Fraction | float]
"""Floats are infinite."""


def interval(amount: Amount, of: Callable[[FunctionValue], Interval]) -> Interval:
    """The values that an expression may have."""
    match amount:
        case Constant(value):
            return value, value
        case FunctionValue():
            return of(amount)
        case Arithmetic(operator, operands):
            parts = [interval(each, of) for each in operands]
            found = parts[0]
            if operator == "-" and len(parts) == 1:
                return -found[1], -found[0]
            for part in parts[1:]:
                found = arithmetic(operator, found, part)
            return found
        case _:
            assert_never(amount)


def never(condition: mf.Formula, of: Callable[[Amount], Interval]) -> bool:
    """Is a condition a comparison that no values within the intervals make true?"""
    if not isinstance(condition, mf.Compare):
        return False
    left, right = of(condition.left), of(condition.right)
    match condition.operator:
        case "<":
            return left[0] >= right[1]
        case "<=":
            return left[0] > right[1]
        case ">":
            return left[1] <= right[0]
        case ">=":
            return left[1] < right[0]
        case "=":
            return left[1] < right[0] or left[0] > right[1]
        case "!=":
            return left == right and left[0] == left[1]
        case _:
            assert_never(condition.operator)


def both_ways(condition: mf.Compare) -> Iterator[tuple[Amount, Amount, mf.Comparator]]:
    """A comparison, and the same seen from its other side."""
    mirrored: Mapping[mf.Comparator, mf.Comparator]
    mirrored = {"<": ">", "<=": ">=", "=": "=", "!=": "!=", ">=": "<=", ">": "<"}
    yield condition.left, condition.right, condition.operator
    yield condition.right, condition.left, mirrored[condition.operator]


def arithmetic(operator: str, one: Interval, other: Interval) -> Interval:
    """``+ - * /`` of two intervals."""
    match operator:
        case "+":
            return _add(one[0], other[0]), _add(one[1], other[1])
        case "-":
            return _add(one[0], -other[1]), _add(one[1], -other[0])
        case "*":
            products = [_times(a, b) for a in one for b in other]
            return min(products), max(products)
        case _:
            if other[0] <= 0 <= other[1] or not all(isinstance(each, Fraction) for each in other):
                return -inf, inf
            quotients = [_times(a, 1 / b) for a in one for b in other]
            return min(quotients), max(quotients)


def _add(one: Fraction | float, other: Fraction | float) -> Fraction | float:
    if isinstance(one, float):
        return one
    return other if isinstance(other, float) else one + other


def _times(one: Fraction | float, other: Fraction | float) -> Fraction | float:
    if not one or not other:
        return Fraction(0)
    if isinstance(one, float) or isinstance(other, float):
        return inf if (one > 0) == (other > 0) else -inf
    return one * other
