"""Reading JSON values as what they should be, with a fault that knows its path where they are not."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import TypeAlias, TypeVar

from bbtc.artefacts.jsontext import Path, locate, path_text
from bbtc.artefacts.numbers import MAX_LENGTH, parse_number
from bbtc.diagnostics import BbtcError, Diagnostic, Unreadable
from bbtc.printable import printable
from bbtc.rounding import too_long
from bbtc.source import SourceFile, Span

_T = TypeVar("_T")


_MOST_FAULTS = 50
_MOST_COMPARED = 2000  # names a misspelt one is compared with
_SURROGATE = re.compile("[\ud800-\udfff]")
_PRIVATE = "x-"
_LONGEST_SHOWN = 60


Locate: TypeAlias = Callable[[Sequence[Diagnostic]], Sequence["Span | None"]]
"""Finds the places that paths lead to."""


def _places(source: SourceFile, faults: Sequence[Diagnostic]) -> list[Span | None]:
    spans = locate(source, [fault.path for fault in faults])
    return [spans.get(fault.path) for fault in faults]


class Stop(Exception):
    """The faults on record make further reading pointless."""


@dataclass(slots=True)
class Faults:
    """Collects the faults of an artefact, so that one run reports them all."""

    _found: list[Diagnostic] = field(default_factory=list)

    def attempt(self, read: Callable[[], _T], default: _T) -> _T:
        """The result of ``read``; if it raises a fault, that goes on record and the default
        stands in, so that reading goes on."""
        try:
            return read()
        except Unreadable as fault:
            self.add(fault.diagnostic)
            return default

    def require(self, read: Callable[[], _T]) -> _T:
        """The result of ``read``; if it raises a fault, that goes on record and reading stops."""
        try:
            return read()
        except Unreadable as fault:
            self.add(fault.diagnostic)
            raise Stop from None

    def each(self, items: Sequence[At], read: Callable[[At], _T]) -> list[_T]:
        """``read`` of every item that has no fault."""
        results: list[_T] = []
        for item in items:
            try:
                results.append(read(item))
            except Unreadable as fault:
                self.add(fault.diagnostic)
        return results

    def add(self, fault: Diagnostic) -> None:
        """Put a fault on record; raises :class:`Stop` when there are very many."""
        self._found.append(fault)
        if len(self._found) >= _MOST_FAULTS:
            raise Stop

    def stop_if_any(self) -> None:
        """Raise :class:`Stop` if what follows would only repeat the faults on record."""
        if self._found:
            raise Stop

    def error(self, places: Locate | None) -> BbtcError:
        """The faults as diagnostics, with places if these are known."""
        spans = places(self._found) if places else [None] * len(self._found)
        return BbtcError(
            replace(fault, message=f"at {path_text(fault.path)}: {fault.message}", span=span, path=())
            for fault, span in zip(self._found, spans, strict=True)
        )


def run_reader(read: Callable[[Faults], _T], source: SourceFile | None, places: Locate | None = None) -> _T:
    """The result of ``read``. Raises :class:`BbtcError` with every fault it met; ``source`` is the JSON
    text for their places, unless ``places`` finds them."""
    faults = Faults()
    try:
        result = faults.require(lambda: read(faults))
        faults.stop_if_any()
    except Stop:
        if places is None and source is not None:
            places = partial(_places, source)
        raise faults.error(places) from None
    return result


@dataclass(frozen=True, slots=True)
class At:
    """A JSON value and its path. The methods return it as what it should be, or raise
    :class:`~bbtc.diagnostics.Unreadable`."""

    value: object
    path: Path = ()

    def found(self, code: str, message: str, hint: str | None = None) -> Diagnostic:
        """What is wrong at this place."""
        return Diagnostic(code, message, hint=hint, path=self.path)

    def fault(self, code: str, message: str, hint: str | None = None) -> Unreadable:
        """The same, to be raised."""
        return Unreadable(self.found(code, message, hint))

    def members(self, required: Sequence[str], optional: Sequence[str] = ()) -> dict[str, At]:
        """The members of an object. Those whose name starts with ``x-`` are anyone's and ignored."""
        members = self._mapping()
        missing = [name for name in required if name not in members]
        if missing:
            raise self.fault("BBT0603", f"field '{missing[0]}' is missing")
        found: dict[str, At] = {}
        for name, value in members.items():
            if name in required or name in optional:
                found[name] = At(value, (*self.path, name))
            elif not name.startswith(_PRIVATE):
                raise At(value, (*self.path, name)).fault(
                    "BBT0603", f"unknown field '{clip(name)}'", nearest(name, [*required, *optional])
                )
        return found

    def entries(self) -> Iterator[tuple[str, At]]:
        """The members of an object whose names are data."""
        return ((name, At(value, (*self.path, name))) for name, value in self._mapping().items())

    def _mapping(self) -> Mapping[str, object]:
        if not isinstance(self.value, dict):
            raise self._wrong("an object")
        return self.value

    def elements(self) -> list[At]:
        """The elements of an array."""
        if not isinstance(self.value, list):
            raise self._wrong("an array")
        return [At(value, (*self.path, index)) for index, value in enumerate(self.value)]

    def strings(self) -> tuple[str, ...]:
        """The elements of an array of strings."""
        return tuple(element.string() for element in self.elements())

    def string(self) -> str:
        """A string that can be written as UTF-8."""
        if not isinstance(self.value, str):
            raise self._wrong("a string")
        if _SURROGATE.search(self.value):
            raise self.fault("BBT0604", "half a surrogate pair is not a character")
        return self.value

    def flag(self) -> bool:
        """``true`` or ``false``."""
        if not isinstance(self.value, bool):
            raise self._wrong("true or false")
        return self.value

    def count(self) -> int:
        """A whole number from 1 to a million."""
        if not isinstance(self.value, int) or isinstance(self.value, bool) or not 1 <= self.value <= 10**6:
            raise self._wrong("a whole number from 1 to 1000000")
        return self.value

    def integer(self) -> int:
        """A whole number, which may be below 0."""
        if isinstance(self.value, bool) or not isinstance(self.value, int):
            raise self._wrong("a whole number")
        return self.value

    def word(self, *choices: str) -> str:
        """One of a few strings."""
        text = self.string()
        if text not in choices:
            listed = ", ".join(f"'{choice}'" for choice in choices)
            message = f"must be one of {listed}, not '{clip(text)}'"
            raise self.fault("BBT0604", message, nearest(text, choices))
        return text

    def number(self) -> Fraction:
        """An exact number, written as a string."""
        if isinstance(self.value, (int, float)) and not isinstance(self.value, bool):
            raise self.fault("BBT0604", 'numbers are strings, to stay exact: "0.95" or "7/8"')
        text = self.string()
        try:
            return parse_number(text)
        except ValueError:
            more = f" (longer than {MAX_LENGTH} characters)" if len(text) > MAX_LENGTH else ""
            raise self.fault(
                "BBT0604", f"not a number: '{clip(text)}'{more}", 'write it as "0.95", "7/8" or "2"'
            ) from None

    def given(self) -> Fraction:
        """A number that all is computed from, which is to be short."""
        value = self.number()
        if too_long(value):
            raise self.fault("BBT0604", f"the number {clip(self.string())} has too many digits")
        return value

    def probability(self, zero: bool = True) -> Fraction:
        """A number from 0 to 1; above 0 unless ``zero``."""
        return self._within(self.number(), zero)

    def given_probability(self, zero: bool = True) -> Fraction:
        """A short one, as :meth:`given`."""
        return self._within(self.given(), zero)

    def _within(self, value: Fraction, zero: bool) -> Fraction:
        if value > 1 or value < 0 or (value == 0 and not zero):
            low = "from 0 to" if zero else "above 0, up to"
            raise self.fault("BBT0604", f"a probability is {low} 1, not {clip(self.string())}")
        return value

    def _wrong(self, expected: str) -> Unreadable:
        return self.fault("BBT0604", f"must be {expected}, not {_kind(self.value)}")


def _kind(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "a truth value"
        case int() | float():
            return "a number"
        case str():
            return f"the string '{clip(value)}'"
        case list():
            return "an array"
        case dict():
            return "an object"
        case _:
            return type(value).__name__


def clip(text: str) -> str:
    """Text of a stranger for a message: printable and not too long."""
    return printable(text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}…")


def nearest(name: str, known: Sequence[str]) -> str | None:
    """A hint with the nearest known name, if one is near."""
    if len(known) > _MOST_COMPARED:
        return None
    from difflib import get_close_matches

    near = get_close_matches(name[:_LONGEST_SHOWN], known, n=1)
    return f"did you mean '{near[0]}'?" if near else None


def optional(members: Mapping[str, At], name: str) -> list[At]:
    """The elements of a list that may be missing."""
    return members[name].elements() if name in members else []


def check_distinct(at: At, names: Sequence[str]) -> None:
    """Raise a fault if two neighbours of a sorted list of names are equal."""
    for name, following in itertools.pairwise(names):
        if name == following:
            raise at.fault("BBT0607", f"'{clip(name)}' stands twice")
