"""Exporter ``mermaid``: a flowchart that code hosts draw where it stands in Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.pictures.diagram import (
    FILL,
    FLOW,
    INK,
    PEN,
    TEMPLATES,
    UNREACHED,
    Item,
    diagram,
    flow_text,
)
from bbtc.tree.nodes import Tree

_SAFE = frozenset(" !'()*+,-./0123456789:=?ABCDEFGHIJKLMNOPQRSTUVWXYZ_abcdefghijklmnopqrstuvwxyz→⇒↻↺…")


@dataclass(frozen=True, slots=True)
class MermaidExporter:
    """A Mermaid flowchart with the colours of the other pictures. Deterministic."""

    name: str = "mermaid"
    description: str = "Mermaid flowchart, drawn by code hosts in Markdown"
    suffix: str = ".mmd"
    options: tuple[Option, ...] = (
        TEMPLATES,
        FLOW,
        Option("fenced", False, "put the chart into a Markdown code block"),
    )

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The tree as a flowchart from top to bottom."""
        items = diagram(tree, figures, expand=options["templates"] == "expanded")
        lines = ["flowchart TD", *(f"  {_node(number, item)}" for number, item in enumerate(items))]
        edges = [(item.parent, number) for number, item in enumerate(items) if item.parent is not None]
        lines += [f"  {_edge(parent, number, items[number])}" for parent, number in edges]
        lines += [f"  {style}" for style in _styles(items, [number for _, number in edges])]
        chart = "".join(f"{line}\n" for line in lines)
        return f"```mermaid\n{chart}```\n" if options["fenced"] else chart


mermaid = MermaidExporter()


def _node(number: int, item: Item) -> str:
    lines = item.lines if item.symbol is None else (item.symbol, *item.lines)
    text = "<br>".join(map(_escaped, lines))
    opening, closing = ("([", "])") if item.kind == "condition" else ("[", "]")
    return f'n{number}{opening}"{text}"{closing}:::{item.kind}'


def _edge(parent: int, number: int, item: Item) -> str:
    if item.flow is None:
        return f"n{parent} --> n{number}"
    arrow = "-.->" if item.flow == 0 else "-->"
    return f'n{parent} {arrow}|"{_escaped(flow_text(item.flow))}"| n{number}'


def _styles(items: tuple[Item, ...], children: list[int]) -> list[str]:
    kinds = sorted({item.kind for item in items})
    styles = [f"classDef {kind} fill:{FILL[kind]},color:{INK[kind]},stroke:{PEN}" for kind in kinds]
    styles += [f"style n{number} stroke-dasharray:4 3" for number, item in enumerate(items) if item.dashed]
    unreached = [str(place) for place, number in enumerate(children) if items[number].flow == 0]
    if unreached:
        styles.append(f"linkStyle {','.join(unreached)} stroke:{UNREACHED},color:{UNREACHED}")
    return styles


def _escaped(text: str) -> str:
    """Text that Mermaid shows as it is: whatever it, Markdown or HTML could read as syntax stands as
    one of Mermaid's character codes (``#35;``)."""
    return "".join(c if c in _SAFE else f"#{ord(c)};" for c in text)
