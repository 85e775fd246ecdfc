"""Ground conditions in words: one wording for messages, labels and reasons."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from typing_extensions import assert_never

from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, number_in
from bbtc.ground.task import Digit, Task, Variable, ground_name, numbers_of
from bbtc.kleene import Truth


def describe(task: Task, condition: Condition, name_of: Callable[[Variable], str] | None = None) -> str:
    """``seen(soda)``, ``not seen(soda)``, ``unknown seen(soda)``, ``known seen(soda)``,
    ``(a() and not b())``: the condition in words, on one line. ``name_of`` names the variables where
    their own names will not do."""

    def named(variable: int) -> str:
        read = task.variables[variable]
        return read.name if name_of is None else name_of(read)

    match condition:
        case Is(variable, Truth.TRUE):
            return named(variable)
        case Is(variable, Truth.FALSE):
            return f"not {named(variable)}"
        case Is(variable, _):
            return f"unknown {named(variable)}"
        case Known(variable):
            return f"known {named(variable)}"
        case Within(digits, low, high):
            return _compared(task.variables, digits, low, high, name_of)
        case And(parts):
            return f"({' and '.join(describe(task, part, name_of) for part in parts)})"
        case Or(parts):
            return f"({' or '.join(describe(task, part, name_of) for part in parts)})"
        case Not(part):
            return f"not {describe(task, part, name_of)}"
        case Constant(value):
            return Truth.of(value).word
        case _:
            assert_never(condition)


def condition_as_lists(condition: Condition, variables: Sequence[Variable]) -> list[object]:
    """``["is", "seen(soda)", "true"]``, ``["and", …]``: the condition as nested lists of words,
    which is its form in artefacts."""
    match condition:
        case Is(variable, value):
            return ["is", variables[variable].name, value.word]
        case Known(variable):
            return ["known", variables[variable].name]
        case Within(digits, low, high):
            return ["within", number_name(variables, digits), *bounds(variables, digits, low, high)]
        case And(parts):
            return ["and", *(condition_as_lists(part, variables) for part in parts)]
        case Or(parts):
            return ["or", *(condition_as_lists(part, variables) for part in parts)]
        case Not(part):
            return ["not", condition_as_lists(part, variables)]
        case Constant(value):
            return [Truth.of(value).word]
        case _:
            assert_never(condition)


def digit_of(variables: Sequence[Variable], digits: Sequence[int]) -> Digit:
    """What the first digit of a number says of it."""
    found = variables[digits[0]].digit
    assert found is not None
    return found


def number_name(variables: Sequence[Variable], digits: Sequence[int]) -> str:
    """``function(arg,…)`` of the number with these digits."""
    return ground_name(digit_of(variables, digits).function, variables[digits[0]].args)


def bounds(variables: Sequence[Variable], digits: Sequence[int], low: int, high: int) -> tuple[int, int]:
    """The values between which a condition says that a number is, as in its range."""
    digit = digit_of(variables, digits)
    return digit.low + low, min(digit.low + high, max(digit.high, digit.low + low))


def _compared(
    variables: Sequence[Variable],
    digits: tuple[int, ...],
    low: int,
    high: int,
    name_of: Callable[[Variable], str] | None,
) -> str:
    digit = digit_of(variables, digits)
    name = number_name(variables, digits)
    if name_of is not None:
        name = name_of(replace(variables[digits[0]], predicate=digit.function))
    least, most = bounds(variables, digits, low, high)
    if least == most:
        return f"{name} = {least}"
    if most == digit.high:
        return f"{name} >= {least}"
    return f"{name} <= {most}" if least == digit.low else f"{least} <= {name} <= {most}"


def values_in_words(variables: Sequence[Variable], values: Sequence[int]) -> dict[str, str | int]:
    """The value of each variable, and of each number, by name, in the order of the variables."""
    numbers = {number.digits[0]: number for number in numbers_of(variables)}
    found: dict[str, str | int] = {}
    for index, (variable, value) in enumerate(zip(variables, values, strict=False)):
        if variable.digit is None:
            found[variable.name] = Truth(value).word
        elif index in numbers:
            found[numbers[index].name] = numbers[index].low + number_in(numbers[index].digits, values)
    return found


def differences(
    variables: Sequence[Variable], before: Sequence[int], after: Sequence[int]
) -> dict[str, str | int]:
    """What differs between two states, with its value in the second."""
    one, other = values_in_words(variables, before), values_in_words(variables, after)
    return {name: value for name, value in other.items() if one[name] != value}
