"""A tree as lines of text, one a node: what the format ``text``, ``bbtc run`` and ``bbtc diff`` show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from typing_extensions import assert_never

from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node


@dataclass(frozen=True, slots=True)
class Strokes:
    """What the lines of an outline are drawn with; each stroke is three characters wide."""

    branch: str
    last: str
    through: str
    blank: str
    symbols: Mapping[ControlKind, str]


UNICODE = Strokes(
    "├─ ",
    "└─ ",
    "│  ",
    "   ",
    MappingProxyType(
        {"sequence": "→", "fallback": "?", "skipper": "⇒", "retry": "↻", "retry-until-success": "↺"}
    ),
)
ASCII = Strokes(
    "|- ",
    "`- ",
    "|  ",
    "   ",
    MappingProxyType(
        {"sequence": "->", "fallback": "?", "skipper": "=>", "retry": "@", "retry-until-success": "@@"}
    ),
)


def bound(kind: ControlKind, attempts: int) -> str:
    """What the number of attempts of a node says."""
    if kind == "retry":
        return f"at most {attempts}"
    return f"{attempts} attempt{'s' if attempts > 1 else ''}"


def label(task: Task, node: Node, strokes: Strokes = UNICODE) -> str:
    """A node in one line: ``→ find(soda)``, ``(seen(soda))``, ``[detect(soda)]``; an action that may
    run again is ``[detect(soda)]+``, a guarded one ``[?detect(soda)]``. Not its id."""
    match node:
        case ControlNode():
            parts = [strokes.symbols[node.kind]]
            if node.attempts is not None:
                parts.append(bound(node.kind, node.attempts))
            if node.template is not None:
                parts.append(f"<{node.template}>")
        case ConditionNode():
            text = describe(task, node.condition)
            parts = [text if text.startswith("(") and text.endswith(")") else f"({text})"]
        case ActionNode():
            parts = [f"[{'?' * node.guarded}{node.action}]{'+' * (not node.latched)}"]
        case _:
            assert_never(node)
    if node.name is not None:
        parts.append(f'"{node.name}"')
    return printable(" ".join(parts))


def outline(root: Node, strokes: Strokes = UNICODE) -> Iterator[tuple[str, Node]]:
    """Every node, parents before children, with the strokes that stand before its label."""
    stack: list[tuple[str, str, Node]] = [("", "", root)]
    while stack:
        lead, below, node = stack.pop()
        yield lead, node
        if isinstance(node, ControlNode) and node.children:
            *rest, last = node.children
            stack.append((below + strokes.last, below + strokes.blank, last))
            stack.extend((below + strokes.branch, below + strokes.through, child) for child in reversed(rest))
