"""Ground conditions as JSON: ``["is", variable, value]``, ``["and", …]`` and so on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bbtc.artefacts.cursor import At, clip, nearest
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or
from bbtc.ground.describe import condition_as_lists
from bbtc.ground.task import Variable
from bbtc.kleene import Truth

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


def condition_from_json(at: At, index: Mapping[str, int], depth: int = 0) -> Condition:
    """Inverse of :func:`condition_to_json`; ``index`` numbers the variables by name. Raises
    :class:`~bbtc.diagnostics.Unreadable`."""
    if depth > MAX_DEPTH:
        raise at.fault("BBT0605", f"a condition has at most {MAX_DEPTH} levels")
    elements = at.elements()
    if not elements:
        raise at.fault("BBT0604", "an empty array is not a condition", 'always true is ["true"]')
    kind = elements[0].word("is", "known", "and", "or", "not", "true", "false")
    rest = elements[1:]
    expected = {"is": 2, "known": 1, "not": 1, "true": 0, "false": 0}.get(kind, len(rest))
    if len(rest) != expected:
        raise at.fault("BBT0604", f"'{kind}' is followed by {expected} elements, not {len(rest)}")
    match kind:
        case "is":
            value = Truth.from_word(rest[1].word("true", "false", "unknown"))
            return Is(variable_from_json(rest[0], index), value)
        case "known":
            return Known(variable_from_json(rest[0], index))
        case "and":
            return And(tuple(condition_from_json(part, index, depth + 1) for part in rest))
        case "or":
            return Or(tuple(condition_from_json(part, index, depth + 1) for part in rest))
        case "not":
            return Not(condition_from_json(rest[0], index, depth + 1))
        case _:
            return Constant(kind == "true")


def variable_from_json(at: At, index: Mapping[str, int]) -> int:
    """The number of the variable that a string names."""
    return number_of(at, at.string(), index)


def number_of(at: At, name: str, index: Mapping[str, int]) -> int:
    """The number of the variable called ``name``, which stands at ``at``."""
    if name not in index:
        raise at.fault("BBT0606", f"no variable is called '{clip(name)}'", nearest(name, list(index)))
    return index[name]
