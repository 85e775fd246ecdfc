"""Types: a hierarchy under ``object``, parameters and objects with their types.

All names are keys (lower case); the text as written is reached through the spans.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from bbtc.source import Span

OBJECT = "object"


@dataclass(frozen=True, slots=True)
class Type:
    """A type and its direct supertypes (several for ``(either …)`` or repeated declarations)."""

    name: str
    parents: tuple[str, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Parameter:
    """A variable, question mark included, and its types: it takes an object of any of them."""

    name: str
    types: tuple[str, ...] = (OBJECT,)
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Object:
    """A constant of the domain or an object of the problem; it is of each of its types."""

    name: str
    types: tuple[str, ...] = (OBJECT,)
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class TypeHierarchy:
    """The declared types, ``object`` included. Raises ``KeyError`` for names not declared."""

    types: Mapping[str, Type]

    @cached_property
    def _known(self) -> dict[str, frozenset[str]]:
        """The ancestors that were asked for: all of them would be very many where types form a long chain."""
        return {}

    def ancestors(self, name: str) -> frozenset[str]:
        """Every type that a type is a subtype of, itself and ``object`` included."""
        if name not in self._known:
            # Depth first without recursion: a hierarchy may be deeper than the Python stack.
            seen = {name, OBJECT}
            todo = [name]
            while todo:
                for parent in self.types[todo.pop()].parents:
                    if parent not in seen:
                        if parent in self._known:
                            seen |= self._known[parent]
                        else:
                            seen.add(parent)
                            todo.append(parent)
            self._known[name] = frozenset(seen)
        return self._known[name]

    def is_subtype(self, name: str, of: Iterable[str]) -> bool:
        """Whether every object of the type is of one of the other types."""
        return not self.ancestors(name).isdisjoint(of)

    def fits(self, parameter: Iterable[str], wanted: Iterable[str]) -> bool:
        """Whether everything a parameter of the given types takes is of one of ``wanted``."""
        wanted = tuple(wanted)
        return all(self.is_subtype(name, wanted) for name in parameter)

    def contains(self, wanted: Iterable[str], thing: Object) -> bool:
        """Whether the object is of one of the types."""
        wanted = tuple(wanted)
        return any(self.is_subtype(name, wanted) for name in thing.types)

    def overlaps(self, given: Iterable[str], wanted: Iterable[str]) -> bool:
        """Whether some object could be of both, as far as the declarations tell: one type is
        a subtype of the other, or they have a declared subtype in common."""
        first, second = tuple(given), tuple(wanted)
        return any(self.is_subtype(name, first) and self.is_subtype(name, second) for name in self.types)
