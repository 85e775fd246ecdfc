"""Numbers of a task as JSON: ranges, values, and how outcomes change them. What that does to their digits is
not written, but worked out again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

from bbtc.artefacts.conditions import condition_to_json
from bbtc.artefacts.cursor import At, clip, nearest
from bbtc.ground.condition import Condition
from bbtc.ground.describe import digit_of, number_name
from bbtc.ground.task import (
    Case,
    Digit,
    Effect,
    NumberChange,
    NumberVariable,
    Variable,
    digit_name,
    split_name,
)
from bbtc.kleene import Truth

Json: TypeAlias = dict[str, object]
LARGEST = 2**31
"""So large a bound may be, above and below zero."""


def number_to_json(number: NumberVariable) -> Json:
    """A number with its range."""
    bounds = "block" if number.blocks else "saturate"
    return {"name": number.name, "low": number.low, "high": number.high, "bounds": bounds}


def digits_from_json(at: At) -> list[Variable]:
    """Inverse of :func:`number_to_json`: the digits of the number."""
    members = at.members(["name", "low", "high"], ["bounds"])
    function, args = split_name(members["name"].string())
    low, high = members["low"].integer(), members["high"].integer()
    if low > high or max(abs(low), abs(high)) > LARGEST:
        raise members["high"].fault(
            "BBT0604", "a range goes from a number to one that is no less, within 2^31"
        )
    blocks = "bounds" in members and members["bounds"].word("saturate", "block") == "block"
    count = max(1, (high - low).bit_length())
    return [
        Variable(digit_name(function, place), args, False, digit=Digit(function, place, low, high, blocks))
        for place in range(count)
    ]


def digits_of_value(at: At, number: NumberVariable) -> Iterator[tuple[int, Truth]]:
    """The digits of a value."""
    value = at.integer()
    if not number.low <= value <= number.high:
        raise at.fault("BBT0604", f"must be from {number.low} to {number.high}")
    for place, digit in enumerate(number.digits):
        yield digit, Truth.of(bool(value - number.low >> place & 1))


def without_digits(effects: Iterable[Effect], variables: Sequence[Variable]) -> Iterator[Effect]:
    """Effects without what they set of digits."""
    for effect in effects:
        sets = tuple(
            (variable, value) for variable, value in effect.sets if variables[variable].digit is None
        )
        if sets or not effect.sets:
            yield replace(effect, sets=sets)


def changes_to_json(changes: Iterable[NumberChange], variables: Sequence[Variable]) -> Json:
    """By number: its cases."""
    return {number_name(variables, each.digits): cases_to_json(each, variables) for each in changes}


def cases_to_json(change: NumberChange, variables: Sequence[Variable]) -> list[Json]:
    """What a number becomes, in each case."""
    low = digit_of(variables, change.digits).low
    return [
        {
            "when": None if case.when is None else condition_to_json(case.when, variables),
            case.kind: case.amount + (low if case.kind == "assign" else 0),
        }
        for case in change.cases
    ]


def changes_from_json(
    at: At, numbers: Mapping[str, NumberVariable], condition: Callable[[At], Condition]
) -> tuple[NumberChange, ...]:
    """Inverse of :func:`cases_to_json`, for all numbers that an outcome changes."""
    found = []
    for name, value in at.entries():
        if name not in numbers:
            raise value.fault("BBT0606", f"no number is called '{clip(name)}'", nearest(name, list(numbers)))
        cases = tuple(_case(each, numbers[name], condition) for each in value.elements())
        found.append(NumberChange(numbers[name].digits, cases))
    return tuple(sorted(found, key=lambda change: change.digits))


def _case(at: At, number: NumberVariable, condition: Callable[[At], Condition]) -> Case:
    members = at.members(["when"], ["assign", "add"])
    if ("assign" in members) == ("add" in members):
        raise at.fault("BBT0603", "either 'assign' or 'add' must be there, not both")
    when = None if members["when"].value is None else condition(members["when"])
    kind: Literal["assign", "add"] = "assign" if "assign" in members else "add"
    amount = members[kind].integer()
    return Case(when, kind, amount - number.low if kind == "assign" else amount)
