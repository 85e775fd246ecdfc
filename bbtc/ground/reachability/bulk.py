"""Many ground objects at once, in loops that do not run in Python.

A schema may have a million instances. What follows from some of the arguments only, as an effect that
does not mention the others, is made once and shared; and the fields of objects are filled column by
column, several times as fast as by calling their classes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields
from itertools import repeat
from operator import itemgetter
from typing import Any, Generic, TypeVar

from bbtc.ground.universe import Row

T = TypeVar("T")

CHUNK = 2048
"""So many rows are treated together."""
MOST_SHARED = 200_000
"""So many distinct values are remembered, which bounds the memory that remembering takes."""


def instances(kind: type[T], size: int, *columns: Iterable[object]) -> list[T]:
    """``size`` instances of a frozen slotted dataclass that has no ``__post_init__``: one column for
    every field, in order, of that length at least; the last fields may have none, and get their defaults."""
    made: list[T] = list(map(object.__new__, repeat(kind, size)))
    named = fields(kind)  # type: ignore[arg-type]
    defaults = [repeat(field.default, size) for field in named[len(columns) :]]
    for field, column in zip(named, (*columns, *defaults), strict=True):
        deque(map(getattr(kind, field.name).__set__, made, column), maxlen=0)
    return made


def picker(slots: Sequence[int]) -> Callable[[Iterable[Sequence[int]]], Iterable[Row]]:
    """The function that leaves of each row the given places, in that order."""
    if not slots:
        return lambda rows: (() for _ in rows)
    getter: Any = itemgetter(*slots)
    if len(slots) == 1:
        return lambda rows: zip(map(getter, rows))
    return lambda rows: map(getter, rows)


def chunks(rows: list[Row]) -> Iterator[list[Row]]:
    """The rows, some thousands at a time."""
    return (rows[start : start + CHUNK] for start in range(0, len(rows), CHUNK))


def consumed(rows: list[Row]) -> Iterator[list[Row]]:
    """:func:`chunks`, each of which is gone from the rows once it is handed out: a million rows take
    100 MB that what is made of them soon needs."""
    rows.reverse()
    while rows:
        chunk = rows[: -CHUNK - 1 : -1]
        del rows[-CHUNK:]
        yield chunk


class Shared(Generic[T]):
    """What is made of argument rows where only some of the arguments matter.

    ``make`` gets distinct rows of those arguments (``slots``, of ``arity``) and gives back one value
    for each.
    """

    def __init__(self, slots: Sequence[int], arity: int, make: Callable[[list[Row]], list[T]]) -> None:
        self._make = make
        self._whole = list(slots) == list(range(arity))
        self._pick = picker(slots)
        self._made: dict[Row, T] = {}

    def all(self, rows: list[Row]) -> list[T]:
        """One value for every row."""
        if self._whole:
            return self._make(rows)
        keys = list(self._pick(rows))
        made = self._made
        fresh = [key for key in dict.fromkeys(keys) if key not in made]
        if fresh:
            if len(made) + len(fresh) > MOST_SHARED:
                made = self._made = {}
                fresh = list(dict.fromkeys(keys))
            made.update(zip(fresh, self._make(fresh), strict=True))
        return list(map(made.__getitem__, keys))
