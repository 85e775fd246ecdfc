"""The difference of two trees, as text and as Markdown."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from bbtc.artefacts import task_to_json
from bbtc.belief.simulate import Figures
from bbtc.cli.wording import counted, exact
from bbtc.export.names import printable
from bbtc.export.outline import UNICODE, label, outline
from bbtc.ground.task import Task
from bbtc.tree.difference import Difference, counts, differences
from bbtc.tree.nodes import Node, Tree, actions_of, walk

_FIGURES = ("success", "failure", "blocked", "endless", "cost", "actions")


@dataclass(frozen=True, slots=True)
class Row:
    """A figure of both trees; None is infinite. ``differs`` where they are not equal."""

    name: str
    old: str
    new: str
    change: str

    @property
    def differs(self) -> bool:
        """Are the two not the same?"""
        return self.old != self.new or bool(self.change)


@dataclass(frozen=True, slots=True)
class Comparison:
    """All that is told: rows of figures, sentences on the task, and the alignment of the nodes."""

    old: Tree
    new: Tree
    rows: tuple[Row, ...]
    task: tuple[str, ...]
    nodes: Difference

    @property
    def differs(self) -> bool:
        """Is there any difference, but for the ids of nodes and what they were inserted for?"""
        return any(row.differs for row in self.rows) or bool(self.task) or self.nodes.mark != "same"


def compare(old: tuple[Tree, Figures], new: tuple[Tree, Figures]) -> Comparison:
    """The comparison of two trees with their figures."""
    first, second = old[0], new[0]
    rows = [_row(name, getattr(old[1], name), getattr(new[1], name)) for name in _FIGURES]
    sizes = [Fraction(sum(1 for _ in walk(tree.root))) for tree in (first, second)]
    kinds = [Fraction(len({node.action for node in actions_of(tree.root)})) for tree in (first, second)]
    rows += [
        _row("nodes", *sizes),
        _row("different actions", *kinds),
        _row("target", first.target, second.target),
    ]
    rows.append(Row("status", first.status, second.status, ""))
    nodes = differences(first.root, second.root, _keys(first.task), _keys(second.task))
    return Comparison(first, second, tuple(rows), tuple(_task_changes(first.task, second.task)), nodes)


def _row(name: str, old: Fraction | None, new: Fraction | None) -> Row:
    change = ""
    if old is not None and new is not None and old != new:
        difference = new - old
        change = f"{'+' if difference > 0 else '-'}{float(abs(difference)):.4g}"
    texts = ["infinite" if value is None else exact(value) for value in (old, new)]
    return Row(name, texts[0], texts[1], change)


class _keys:  # noqa: N801 (used as a function)
    """What a node is, but for its id, its reason and its children."""

    def __init__(self, task: Task) -> None:
        self._task = task

    def __call__(self, node: Node) -> Hashable:
        return type(node), label(self._task, node)


def _task_changes(old: Task, new: Task) -> Iterator[str]:
    first: Mapping[str, Any] = task_to_json(old)
    second: Mapping[str, Any] = task_to_json(new)
    for what in ("domain", "problem", "goal_probability", "goal", "metric", "goal_reward"):
        if first.get(what) != second.get(what):
            yield f"{what.replace('_', ' ')} changed"
    if _named(first["variables"]) == _named(second["variables"]) and first["initial"] != second["initial"]:
        yield "initial state changed"
    for noun in ("variable", "action"):
        before, after = _named(first[f"{noun}s"]), _named(second[f"{noun}s"])
        for name in sorted({*before, *after}):
            if name not in after:
                yield f"{noun} {printable(name)} removed"
            elif name not in before:
                yield f"{noun} {printable(name)} added"
            elif before[name] != after[name]:
                parts = [
                    key.replace("_", " ") for key in after[name] if before[name].get(key) != after[name][key]
                ]
                yield f"{noun} {printable(name)} changed: {', '.join(parts) or 'fields left out'}"


def _named(values: list[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    return {str(value["name"]): value for value in values}


# --- text and Markdown -----------------------------------------------------------------------


def text_report(comparison: Comparison) -> list[str]:
    """The comparison for a terminal: a table, sentences, and the tree with ``+`` and ``-``."""
    table = [["", "old", "new", ""], *([r.name, r.old, r.new, r.change] for r in comparison.rows)]
    widths = [max(len(row[column]) for row in table) for column in range(4)]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    ]
    lines += [f"task: {change}" for change in comparison.task]
    return [*lines, f"tree: {_summary(comparison)}", *_tree_lines(comparison)]


def markdown_report(comparison: Comparison) -> list[str]:
    """The comparison for a pull request: a table, a list, and a ``diff`` block."""
    name = printable(f"{comparison.new.task.domain}/{comparison.new.task.problem}")
    lines = [f"### {_code(name)}", "", "| figure | old | new | change |", "|---|---|---|---|"]
    lines += [
        f"| {row.name} | {row.old} | {row.new} | {row.change} |"
        for row in comparison.rows
        if row.differs or row.name in {"success", "nodes"}
    ]
    if comparison.task:
        lines += ["", *(f"- task: {_code(change)}" for change in comparison.task)]
    lines += ["", f"Tree: {_summary(comparison)}."]
    drawn = _tree_lines(comparison)
    if drawn:
        fence = "`" * max(3, 1 + max(map(_backticks, drawn)))
        lines += ["", f"{fence}diff", *drawn, fence]
    return lines


def _backticks(text: str) -> int:
    """The length of the longest run of backticks."""
    return max(map(len, re.findall("`+", text)), default=0)


def _code(text: str) -> str:
    """A Markdown code span, in which nothing is read as syntax."""
    fence = "`" * (1 + _backticks(text))
    blank = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{blank}{text}{blank}{fence}"


def _summary(comparison: Comparison) -> str:
    added, removed, relabelled = counts(comparison.nodes)
    if not (added or removed or relabelled):
        return "the same"
    return f"{counted(added, 'node')} added, {removed} removed, {relabelled} changed"


def _tree_lines(comparison: Comparison) -> list[str]:
    """The merged tree, one line a node, marked ``+`` or ``-``; equal subtrees as one line."""
    if comparison.nodes.mark == "same":
        return []
    lines: list[str] = []
    top = comparison.nodes
    stack = [("", "", each) for each in reversed(top.children if top.old is top.new is None else (top,))]
    while stack:
        lead, below, each = stack.pop()
        lines += _entry(comparison, lead, below, each)
        for position, child in enumerate(reversed(each.children)):
            stroke, under = (UNICODE.branch, UNICODE.through) if position else (UNICODE.last, UNICODE.blank)
            stack.append((below + stroke, below + under, child))
    return lines


def _entry(comparison: Comparison, lead: str, below: str, each: Difference) -> list[str]:
    old = None if each.old is None else label(comparison.old.task, each.old)
    new = None if each.new is None else label(comparison.new.task, each.new)
    if each.mark == "same":
        assert each.new is not None
        size = sum(1 for _ in walk(each.new))
        return [f"  {lead}{new}" + (f"  … {size - 1} more, the same" if size > 1 else "")]
    if each.mark == "changed":
        if each.relabelled:
            return [f"- {lead}{old}", f"+ {lead}{new}"]
        return [f"  {lead}{new}"]
    mark, tree, node = (
        ("+", comparison.new, each.new) if each.new is not None else ("-", comparison.old, each.old)
    )
    assert node is not None
    rows = outline(node)
    return [
        f"{mark} {(below + inner) if inner else lead}{label(tree.task, below_node)}"
        for inner, below_node in rows
    ]
