"""Names that are used and declared nowhere: forgotten declarations, which are inferred, or slips of the pen.

Public files leave out declarations that their planners never asked for. What such a name means is plain from
its use, so it is taken as declared, with a warning; but a name that stands in one place only and is spelt
like a declared one is a slip, and an error. So is a type spelt like one that
is declared and that nothing has.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass

from bbtc.syntax import ast
from bbtc.syntax.words import TEST_WORDS

_DIGITS = re.compile(r"\d+")
_LONG = 8
"""Letters from which on two of them may be wrong."""
_LONGEST = 100
"""Longer names are no words that one misspells, and take long to compare."""
_MANY = 2000


@dataclass(frozen=True, slots=True)
class Uses:
    """Where the names of a domain and a problem stand: numbers of sections, by key."""

    names: dict[str, set[int]]
    """Sections that use a name for a predicate or an object."""
    types: dict[str, set[int]]
    """Sections that use a name for a type."""
    bound: frozenset[str]
    """Keys of the types that an object, a parameter or a quantifier has."""
    given: frozenset[str]
    """Keys of the predicates that an effect, an initial fact or a rule gives a value."""


def uses_of(definitions: Iterable[ast.Definition]) -> Uses:
    """The uses of all names in the definitions."""
    names: dict[str, set[int]] = {}
    types: dict[str, set[int]] = {}
    bound: set[str] = set()
    given: set[str] = set()
    numbered = enumerate(section for definition in definitions for section in definition.sections)
    for number, section in numbered:
        if isinstance(section, ast.Derived):
            given.add(section.head.predicate.key)
        for node in _walk(section):
            match node:
                case ast.Name():
                    names.setdefault(node.key, set()).add(number)
                case ast.TypedGroup():
                    for name in node.types:
                        types.setdefault(name.key, set()).add(number)
                    if not isinstance(section, (ast.Predicates, ast.Functions)):
                        bound.update(name.key for name in node.types)
                case _:
                    given.add(node.atom.predicate.key)
                    if node.atom.predicate.key in TEST_WORDS:
                        # `(unknown p)` may be short for `(unknown (p))`.
                        given.update(arg.key for arg in node.atom.args)
    return Uses(names, types, frozenset(bound), frozenset(given))


def _walk(node: object) -> Iterator[ast.Name | ast.TypedGroup | ast.Assign]:
    """The names within a node that are not types, the groups with types, and what it gives a value."""
    if isinstance(node, ast.Name):
        yield node
    elif isinstance(node, tuple):
        for each in node:
            yield from _walk(each)
    elif isinstance(node, ast.TypedGroup):
        yield node
        yield from _walk(node.names)
    elif is_dataclass(node):
        if isinstance(node, ast.Assign):
            yield node
        for field in fields(node):
            if field.compare:  # all but spans
                yield from _walk(getattr(node, field.name))


def slip(key: str, known: Iterable[str]) -> str | None:
    """The known name that a name is a likely misspelling of: all but one letter of it are the same, or in
    long names all but two; neighbours may be swapped. Names that differ in their numbers alone are no
    misspellings, nor are names of one or two letters, or names with a part more, as in `k_open`."""
    if len(key) > _LONGEST:
        return None
    best: tuple[int, str] | None = None
    for name in likely(key, known):
        longest = max(len(key), len(name))
        allowed = 0 if longest < 3 else 1 if longest < _LONG else 2
        if abs(len(key) - len(name)) > allowed or _DIGITS.sub("", key) == _DIGITS.sub("", name):
            continue
        if _has_part_more(key, name) or _has_part_more(name, key):
            continue
        found = distance(key, name, allowed)
        if found <= allowed and (best is None or found < best[0]):
            best = found, name
    return best[1] if best else None


def likely(key: str, known: Iterable[str]) -> list[str]:
    """The names to compare a name with: all, but of very many only those with its first letter and about
    its length, since to compare spellings takes time."""
    names = list(known)
    if len(names) <= _MANY:
        return names
    return [name for name in names if name[:1] == key[:1] and abs(len(name) - len(key)) <= 2][:_MANY]


def _has_part_more(longer: str, shorter: str) -> bool:
    return any(longer.endswith(joint + shorter) or longer.startswith(shorter + joint) for joint in "-_")


def distance(one: str, other: str, limit: int) -> int:
    """Letters to insert, delete, replace or swap with their neighbour to make one word of another (optimal
    string alignment), or a number above ``limit`` if more are."""
    before: list[int] = []
    row = list(range(len(other) + 1))
    for i, letter in enumerate(one, 1):
        before, last, row = row, before, [i]
        for j, against in enumerate(other, 1):
            cost = min(before[j] + 1, row[j - 1] + 1, before[j - 1] + (letter != against))
            if i > 1 and j > 1 and letter == other[j - 2] and one[i - 2] == against:
                cost = min(cost, last[j - 2] + 1)
            row.append(cost)
        if min(row) > limit:
            return limit + 1
    return row[-1]
