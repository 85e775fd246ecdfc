"""Exporter ``text``: a tree for terminals, mails and diffs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.pictures.diagram import FLOW, flow_text
from bbtc.backends.pictures.outline import ASCII, UNICODE, label, outline
from bbtc.printable import printable
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class TextExporter:
    """One line a node. Deterministic."""

    name: str = "text"
    description: str = "indented text, one line a node"
    suffix: str = ".txt"
    options: tuple[Option, ...] = (
        Option("style", "unicode", "what lines and symbols are made of", ("unicode", "ascii")),
        Option("ids", False, "write the id of every node at the end of its line"),
        FLOW,
    )

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The tree as indented text; ``ascii`` replaces what is not ASCII by backslash escapes."""
        strokes = ASCII if options["style"] == "ascii" else UNICODE
        lines = []
        for lead, node in outline(tree.root, strokes):
            line = lead + label(tree.task, node, strokes)
            if figures is not None:
                line += f"  {flow_text(figures.get(node.id, Fraction(0)))}"
            if options["ids"]:
                line += f"  #{printable(node.id)}"
            lines.append(line)
        text = "".join(f"{line}\n" for line in lines)
        return text.encode("ascii", "backslashreplace").decode() if strokes is ASCII else text


text = TextExporter()
