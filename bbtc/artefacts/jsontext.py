"""Canonical JSON text out, strict JSON text in.

Out: two-space indent, UTF-8 characters as themselves, members in the order they are given, a
newline at the end. In: one JSON value, no member twice, and the place of any part of it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.printable import escaped
from bbtc.source import SourceFile, Span

Path: TypeAlias = tuple[str | int, ...]
"""Member names and element numbers from the top of a JSON text down to one value."""

_INDENT = "  "
_LONGEST_INTEGER = 18


def path_text(path: Path) -> str:
    """``root.children[1].action``; ``the top level`` for the empty path."""
    parts = [f"[{step}]" if isinstance(step, int) else f".{_shown(step)}" for step in path]
    return "".join(parts).lstrip(".") or "the top level"


def _shown(member: str) -> str:
    return member if re.fullmatch(r"[A-Za-z_][\w-]*", member, re.ASCII) else json.dumps(member)


# --- out -------------------------------------------------------------------------------------


def dumps(value: object) -> str:
    """The canonical text of a value made of dicts, lists, strings, ints, bools and None.

    Written without recursion: an artefact may be nested as deeply as its maker likes.
    """
    out: list[str] = []
    stack: list[Iterator[tuple[str, object]]] = [iter([("", value)])]
    closers: list[str] = []
    while stack:
        item = next(stack[-1], None)
        if item is None:
            stack.pop()
            if closers:
                out.append(f"\n{_INDENT * (len(stack) - 1)}{closers.pop()}")
            continue
        lead, part = item
        out.append(lead)
        if isinstance(part, str):
            out.append(_encoded(part))
        elif isinstance(part, Mapping) and part:
            out.append("{")
            closers.append("}")
            stack.append(_members(part, _INDENT * len(stack)))
        elif isinstance(part, Sequence) and part:
            out.append("[")
            closers.append("]")
            stack.append(_elements(part, _INDENT * len(stack)))
        else:
            out.append(_encoded(part))
    out.append("\n")
    return escaped("".join(out))


_encoded = json.JSONEncoder(ensure_ascii=False).encode


def _members(value: Mapping[str, object], indent: str) -> Iterator[tuple[str, object]]:
    comma = ""
    for key, part in value.items():
        yield f"{comma}\n{indent}{_encoded(key)}: ", part
        comma = ","


def _elements(value: Sequence[object], indent: str) -> Iterator[tuple[str, object]]:
    comma = ""
    for part in value:
        yield f"{comma}\n{indent}", part
        comma = ","


# --- in --------------------------------------------------------------------------------------


class _RepeatedMember(Exception):
    """An object has a member twice; where, the slower scan finds out."""


def loads(source: SourceFile) -> object:
    """The value of a JSON text. Raises :class:`BbtcError` for anything that is not strictly JSON
    (``NaN``, a member that stands twice), with the place."""
    try:
        return json.loads(
            source.text, object_pairs_hook=_object, parse_constant=_constant, parse_int=_integer
        )
    except json.JSONDecodeError as error:
        span = Span(source, error.pos, error.pos + 1)
        message = f"not valid JSON: {_lower_first(error.msg)}"
        raise BbtcError.single("BBT0601", message, span, _other_kind(source.text[:1000])) from None
    except RecursionError:
        raise BbtcError.single("BBT0605", "JSON nested too deeply", _top(source)) from None
    except _RepeatedMember:
        raise BbtcError(_repeated_members(source)) from None
    except ValueError as error:
        raise BbtcError.single("BBT0601", f"not valid JSON: {error}", _top(source)) from None


def _other_kind(text: str) -> str | None:
    """What a text may be that is not JSON, and what to do with it."""
    first = text.lstrip()[:1]
    if first == "<":
        return "this seems to be XML: `bbtc import` reads the trees of BehaviorTree.CPP files"
    if first in {"(", ";"}:
        return "this seems to be a domain or a problem: `bbtc plan` makes a tree of them"
    return None


def _object(pairs: list[tuple[str, object]]) -> dict[str, object]:
    members = dict(pairs)
    if len(members) != len(pairs):
        raise _RepeatedMember
    return members


def _constant(word: str) -> object:
    raise ValueError(f"{word} is not a JSON value")


def _integer(digits: str) -> object:
    # No artefact holds large JSON integers, and converting a very long one is slow or refused.
    return int(digits) if len(digits) <= _LONGEST_INTEGER else float("inf")


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]


def _top(source: SourceFile) -> Span:
    return Span(source, 0, 1)


def _repeated_members(source: SourceFile) -> list[Diagnostic]:
    found = [
        Diagnostic("BBT0603", f"member '{part.path[-1]}' stands twice", Span(source, part.start, part.end))
        for part in _scan(source.text)
        if part.repeated
    ]
    return found or [Diagnostic("BBT0603", "a member stands twice", _top(source))]


def locate(source: SourceFile, paths: Sequence[Path]) -> dict[Path, Span]:
    """The span of each value that is there, for a text that :func:`loads` accepted. A composite
    value is located by its opening bracket."""
    wanted = set(paths)
    return {
        part.path: Span(source, part.start, part.end) for part in _scan(source.text) if part.path in wanted
    }


@dataclass(frozen=True, slots=True)
class _Part:
    """A value, or the name of a member that stood before in its object (``repeated``)."""

    path: Path
    start: int
    end: int
    repeated: bool = False


_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[\[\]{}:,]|[^\s\[\]{}:,"]+', re.DOTALL)


def _scan(text: str) -> Iterator[_Part]:
    """Every value of a JSON text, in order. Expects valid JSON, stops early at anything else."""
    path: list[str | int] = []
    members: list[set[str] | None] = []  # names seen in each open object; None for an open array
    expect_name = False
    for token in _TOKEN.finditer(text):
        mark, start, end = token.group(), token.start(), token.end()
        if mark in "]}":
            members.pop()
            path.pop()
            expect_name = False
        elif mark == ",":
            names = members[-1] if members else None
            expect_name = names is not None
            if names is None and path and isinstance(path[-1], int):
                path[-1] += 1
        elif mark == ":":
            expect_name = False
        elif expect_name:
            name = json.loads(mark)
            names = members[-1]
            path[-1] = name
            if names is not None:
                if name in names:
                    yield _Part(tuple(path), start, end, repeated=True)
                names.add(name)
        else:
            yield _Part(tuple(path), start, end)
            if mark == "{":
                members.append(set())
                path.append("")
                expect_name = True
            elif mark == "[":
                members.append(None)
                path.append(0)
