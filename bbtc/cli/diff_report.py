"""The difference of two trees, as text and as Markdown."""

from __future__ import annotations

import re
from dataclasses import dataclass

from bbtc.artefacts.numbers import exact
from bbtc.backends.pictures.outline import UNICODE, label, outline
from bbtc.cli.counting import counted
from bbtc.comparison import Comparison, FigureChange
from bbtc.printable import printable
from bbtc.rounding import decimal
from bbtc.tree.difference import Difference, counts
from bbtc.tree.nodes import walk


@dataclass(frozen=True, slots=True)
class _Row:
    name: str
    old: str
    new: str
    change: str
    differs: bool


def _rows(comparison: Comparison) -> list[_Row]:
    old, new = comparison.old.status, comparison.new.status
    return [*map(_row, comparison.figures), _Row("status", old, new, "", old != new)]


def _row(figure: FigureChange) -> _Row:
    change = ""
    if figure.old is not None and figure.new is not None and figure.differs:
        difference = figure.new - figure.old
        change = f"{'+' if difference > 0 else '-'}{decimal(abs(difference), 4)}"
    old, new = ("infinite" if value is None else exact(value) for value in (figure.old, figure.new))
    return _Row(figure.name, old, new, change, figure.differs)


def text_report(comparison: Comparison) -> list[str]:
    """The comparison for a terminal: a table, sentences, and the tree with ``+`` and ``-``."""
    table = [["", "old", "new", ""], *([r.name, r.old, r.new, r.change] for r in _rows(comparison))]
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
        for row in _rows(comparison)
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
