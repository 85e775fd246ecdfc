"""What a picture of a tree shows, whoever draws it: items with a kind, text and colours.

The look is the paper's: →, ? and ⇒ in boxes, conditions in orange ellipses, actions in green
rectangles, templates in purple where their body is drawn and in yellow where it is not (section
"Experimental Validation", colour legend).
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from types import MappingProxyType
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.backends.exporter import Figures, Option
from bbtc.backends.pictures.outline import UNICODE, bound
from bbtc.ground.describe import describe
from bbtc.printable import printable
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree

Kind: TypeAlias = Literal["control", "condition", "action", "expanded", "collapsed"]

SYMBOLS: Mapping[ControlKind, str] = UNICODE.symbols

TEMPLATES = Option(
    "templates", "expanded", "draw templates with their body, or as one node", ("expanded", "collapsed")
)
FLOW = Option("flow", False, "write the probability that a run reaches a node beside it")

FILL: Mapping[Kind, str] = MappingProxyType(
    {
        "control": "#ffffff",
        "condition": "#ffa500",
        "action": "#5fd35f",
        "expanded": "#9262d1",
        "collapsed": "#fde910",
    }
)
"""Background of an item."""

INK: Mapping[Kind, str] = MappingProxyType(
    {
        "control": "#1a1a1a",
        "condition": "#1a1a1a",
        "action": "#1a1a1a",
        "expanded": "#ffffff",
        "collapsed": "#1a1a1a",
    }
)
"""Text on that background."""

PEN = "#404040"
UNREACHED = "#a0a0a0"
"""Colour of a line that no run takes."""

LEGEND: Mapping[Kind, str] = MappingProxyType(
    {
        "condition": "condition",
        "action": "action",
        "expanded": "template (expanded)",
        "collapsed": "template (not expanded)",
    }
)

_LINE = 30  # characters after which a text is broken
_LONGEST_WORD = 60
_LINES = 8
_EXACT_UP_TO = 64  # denominators a fraction is shown with


@dataclass(frozen=True, slots=True)
class Item:
    """A drawn node. ``symbol`` is that of a control node, ``lines`` its text; ``note`` says more, for
    a tool tip; ``parent`` is the number of the item above it; ``flow`` the probability that a run
    reaches it; a ``dashed`` one is an action that may run again."""

    id: str
    kind: Kind
    symbol: str | None
    lines: tuple[str, ...]
    note: str
    parent: int | None
    flow: Fraction | None = None
    dashed: bool = False


def diagram(tree: Tree, figures: Figures | None, *, expand: bool) -> tuple[Item, ...]:
    """The items of a tree, parents before children, from left to right. Without ``expand`` a
    template is one item."""
    items: list[Item] = []
    stack: list[tuple[Node, int | None]] = [(tree.root, None)]
    while stack:
        node, parent = stack.pop()
        kind = _kind(node, expand)
        flow = None if figures is None else figures.get(node.id, Fraction(0))
        dashed = isinstance(node, ActionNode) and not node.latched
        symbol = SYMBOLS[node.kind] if isinstance(node, ControlNode) and kind != "collapsed" else None
        lines, note = _lines(tree, node), _note(tree, node)
        items.append(Item(node.id, kind, symbol, lines, note, parent, flow, dashed))
        if isinstance(node, ControlNode) and kind != "collapsed":
            stack.extend((child, len(items) - 1) for child in reversed(node.children))
    return tuple(items)


def _kind(node: Node, expand: bool) -> Kind:
    match node:
        case ControlNode(template=None):
            return "control"
        case ControlNode():
            return "expanded" if expand else "collapsed"
        case ConditionNode():
            return "condition"
        case ActionNode():
            return "action"
        case _:
            assert_never(node)


def _lines(tree: Tree, node: Node) -> tuple[str, ...]:
    labels = [label for label in (node.name, node.template) if label is not None]
    match node:
        case ControlNode():
            if node.attempts is not None:
                labels.append(bound(node.kind, node.attempts))
        case ConditionNode():
            labels.append(describe(tree.task, node.condition))
        case ActionNode():
            labels.append(node.action)
        case _:
            assert_never(node)
    return tuple(line for label in labels for line in wrap(label))


def _note(tree: Tree, node: Node) -> str:
    text: str
    match node:
        case ControlNode():
            text = node.kind
            if node.attempts is not None:
                text += f", {bound(node.kind, node.attempts)}{' actions' if node.kind == 'retry' else ''}"
        case ConditionNode():
            text = f"condition {describe(tree.task, node.condition)}"
        case ActionNode():
            text = f"action {node.action}" + ("" if node.latched else ", may run again")
        case _:
            assert_never(node)
    template = "" if node.template is None else f", template {node.template}"
    reason = "" if node.reason is None else f", for {node.reason}"
    return printable(f"{node.id}: {text}{template}{reason}")


def wrap(text: str) -> list[str]:
    """The text in a few lines of moderate length; what does not print is replaced."""
    lines = [
        line[start : start + _LONGEST_WORD]
        for line in textwrap.wrap(printable(text), _LINE, break_long_words=False, break_on_hyphens=False)
        for start in range(0, len(line), _LONGEST_WORD)
    ]
    return [*lines[: _LINES - 1], "…"] if len(lines) > _LINES else lines


def flow_text(flow: Fraction) -> str:
    """A probability for a picture: ``7/8``, ``0.968``, ``<0.001``; exact where that is short."""
    if flow.denominator == 1 or flow.denominator <= _EXACT_UP_TO:
        return str(flow)
    if flow < Fraction(1, 1000):
        return "<0.001"
    return ">0.999" if flow > Fraction(999, 1000) else f"{float(flow):.3f}"


def legend(items: tuple[Item, ...]) -> list[tuple[Kind, str]]:
    """The kinds that occur, with their meaning."""
    kinds = {item.kind for item in items}
    return [(kind, meaning) for kind, meaning in LEGEND.items() if kind in kinds]


def symbols_used(items: tuple[Item, ...]) -> list[tuple[str, str]]:
    """The symbols of control nodes that occur, with their meaning."""
    shown = {item.symbol for item in items}
    return [(symbol, kind) for kind, symbol in SYMBOLS.items() if symbol in shown]


def line_width(item: Item) -> float:
    """Width of the line to an item, in points: the likelier, the wider."""
    return 1.0 if item.flow is None else 0.6 + 1.9 * float(item.flow)
