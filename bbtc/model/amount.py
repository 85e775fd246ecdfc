"""Numeric expressions, as written: constants, values of functions, and arithmetic over them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.source import Span


@dataclass(frozen=True, slots=True)
class Constant:
    """A number."""

    value: Fraction


@dataclass(frozen=True, slots=True)
class FunctionValue:
    """The value of a function, e.g. ``(distance ?a ?b)``."""

    function: str
    args: tuple[str, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Arithmetic:
    """``+ - * /`` over amounts."""

    operator: str
    operands: tuple[Amount, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


Amount: TypeAlias = Constant | FunctionValue | Arithmetic


def functions(amount: Amount) -> Iterator[FunctionValue]:
    """The values that an amount reads, repeats included, from left to right."""
    match amount:
        case Constant():
            return
        case FunctionValue():
            yield amount
        case Arithmetic(_, operands):
            for operand in operands:
                yield from functions(operand)
        case _:
            assert_never(amount)


def substitute(amount: Amount, binding: dict[str, str]) -> Amount:
    """The amount with free parameters replaced."""
    match amount:
        case Constant():
            return amount
        case FunctionValue(function, args, span):
            return FunctionValue(function, tuple(binding.get(a, a) for a in args), span)
        case Arithmetic(operator, operands, span):
            return Arithmetic(operator, tuple(substitute(each, binding) for each in operands), span)
        case _:
            assert_never(amount)
