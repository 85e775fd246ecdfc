"""Python expressions as data, laid out the way Black and Ruff do. Text enters only through
:func:`literal`, so nothing that comes from a domain can become code."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

WIDTH = 100
_STEP = 4


@dataclass(frozen=True)
class Group:
    """``head`` and bracketed items: a call, a list, a dict. ``head`` ends with the bracket."""

    head: str
    items: tuple[Code, ...]
    tail: str = ")"
    flat: str = field(init=False)
    """The text on one line: made with the group, from the inside out, since expressions are deep."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "flat", f"{self.head}{', '.join(map(flat, self.items))}{self.tail}")


@dataclass(frozen=True)
class Prefixed:
    """``name=code``, ``key: code`` or ``lambda: code``."""

    prefix: str
    code: Code
    flat: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "flat", f"{self.prefix}{flat(self.code)}")


Code: TypeAlias = str | Group | Prefixed
"""A string is code that is written as it stands: a name or a literal."""


def literal(value: str) -> str:
    """A string literal, in double quotes where that needs no escapes."""
    text = repr(value)
    return f'"{text[1:-1]}"' if text[0] == "'" and '"' not in value else text


def call(function: str, *items: Code) -> Group:
    """``function(items…)``."""
    return Group(f"{function}(", items)


def sequence(items: Iterable[Code]) -> Group:
    """``[items…]``."""
    return Group("[", tuple(items), "]")


def mapping(items: Iterable[tuple[str, Code]]) -> Group:
    """``{key: value…}``; the keys are code."""
    return Group("{", tuple(Prefixed(f"{key}: ", value) for key, value in items), "}")


def flat(code: Code) -> str:
    """The code on one line."""
    return code if isinstance(code, str) else code.flat


def layout(code: Code, prefix: str = "", suffix: str = "", level: int = 0) -> list[str]:
    """The code as lines: on one line where it fits, otherwise its items on lines of their own.
    ``level`` is the depth of indentation; the first line begins with ``prefix``, the last ends
    with ``suffix``."""
    pad = " " * (_STEP * level)
    if isinstance(code, Prefixed):
        return layout(code.code, prefix + code.prefix, suffix, level)
    line = f"{pad}{prefix}{flat(code)}{suffix}"
    if isinstance(code, str) or not code.items or len(line) <= WIDTH:
        return [line]
    lines = [f"{pad}{prefix}{code.head}"]
    for item in code.items:
        lines += layout(item, "", ",", level + 1)
    return [*lines, f"{pad}{code.tail}{suffix}"]
