"""Ground conditions as JSON: ``["is", variable, value]``, ``["and", …]`` and so on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from bbtc.artefacts.cursor import At, clip, nearest
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, within
from bbtc.ground.describe import condition_as_lists
from bbtc.ground.task import NumberVariable, Variable
from bbtc.kleene import Truth

NO_NUMBERS: Mapping[str, NumberVariable] = MappingProxyType({})
MAX_DEPTH = 256
"""Levels of ``and``, ``or`` and ``not`` a condition may have in an artefact."""


def condition_to_json(condition: Condition, variables: Sequence[Variable]) -> list[object]:
    """The condition as nested lists. Raises :class:`~bbtc.diagnostics.BbtcError` for one with more levels
    than would be read."""
    inner: list[Condition] = [condition]
    for _ in range(MAX_DEPTH + 1):
        inner = [part for each in inner if type(each) is not Is for part in _parts(each)]  # leaves have none
        if not inner:
            return condition_as_lists(condition, variables)
    raise BbtcError.single("BBT0605", f"a condition has at most {MAX_DEPTH} levels", hint="nest it less")


def _parts(condition: Condition) -> tuple[Condition, ...]:
    if isinstance(condition, And | Or):
        return condition.parts
    return (condition.part,) if isinstance(condition, Not) else ()


def condition_from_json(
    at: At, index: Mapping[str, int], numbers: Mapping[str, NumberVariable] = NO_NUMBERS, depth: int = 0
) -> Condition:
    """Inverse of :func:`condition_to_json`; ``index`` numbers the variables by name, ``numbers`` are those
    of the task. Raises :class:`~bbtc.diagnostics.Unreadable`."""
    if depth > MAX_DEPTH:
        raise at.fault("BBT0605", f"a condition has at most {MAX_DEPTH} levels")
    elements = at.elements()
    if not elements:
        raise at.fault("BBT0604", "an empty array is not a condition", 'always true is ["true"]')
    kind = elements[0].word("is", "known", "within", "and", "or", "not", "true", "false")
    rest = elements[1:]
    expected = {"is": 2, "known": 1, "within": 3, "not": 1, "true": 0, "false": 0}.get(kind, len(rest))
    if len(rest) != expected:
        raise at.fault("BBT0604", f"'{kind}' is followed by {expected} elements, not {len(rest)}")
    match kind:
        case "is":
            value = Truth.from_word(rest[1].word("true", "false", "unknown"))
            return Is(variable_from_json(rest[0], index), value)
        case "known":
            return Known(variable_from_json(rest[0], index))
        case "within":
            return _within(rest, numbers)
        case "and":
            return And(tuple(condition_from_json(part, index, numbers, depth + 1) for part in rest))
        case "or":
            return Or(tuple(condition_from_json(part, index, numbers, depth + 1) for part in rest))
        case "not":
            return Not(condition_from_json(rest[0], index, numbers, depth + 1))
        case _:
            return Constant(kind == "true")


def _within(rest: Sequence[At], numbers: Mapping[str, NumberVariable]) -> Condition:
    name = rest[0].string()
    if name not in numbers:
        raise rest[0].fault("BBT0606", f"no number is called '{clip(name)}'", nearest(name, list(numbers)))
    number = numbers[name]
    low, high = rest[1].integer(), rest[2].integer()
    top = (1 << len(number.digits)) - 1
    return within(number.digits, low - number.low, top if high >= number.high else high - number.low)


def variable_from_json(at: At, index: Mapping[str, int]) -> int:
    """The number of the variable that a string names."""
    return number_of(at, at.string(), index)


def number_of(at: At, name: str, index: Mapping[str, int]) -> int:
    """The number of the variable called ``name``, which stands at ``at``."""
    if name not in index:
        raise at.fault("BBT0606", f"no variable is called '{clip(name)}'", nearest(name, list(index)))
    return index[name]
