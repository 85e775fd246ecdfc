"""Exporters ``dot``, ``svg`` and ``png``: pictures of a tree.

SVG and PNG are laid out by Graphviz: the program ``dot``, or ``graphviz-pure`` (a Python package) if
that is missing. SVG comes from a layout of our own if neither is there.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape as html_escape
from pathlib import Path

from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.pictures.diagram import (
    FILL,
    FLOW,
    INK,
    PEN,
    SYMBOLS,
    TEMPLATES,
    UNREACHED,
    Item,
    diagram,
    flow_text,
    legend,
    line_width,
    symbols_used,
)
from bbtc.diagnostics import BbtcError
from bbtc.printable import printable
from bbtc.tree.nodes import ControlKind, Tree

FONT = "Helvetica,Arial,sans-serif"

_SECONDS = 60  # that a Graphviz program may take
_PROGRAMS = ("dot", "graphviz-pure")
_STAND_INS: dict[ControlKind, str] = {
    "skipper": "»",
    "retry": "@",
    "retry-until-success": "@@",
}  # the fonts inside graphviz-pure lack these arrows
_PLAIN_ID = re.compile(r"[A-Za-z_][A-Za-z0-9_]*", re.ASCII)

LEGEND = Option("legend", False, "add a legend of colours and symbols")


@dataclass(frozen=True, slots=True)
class DotExporter:
    """Graphviz text. Deterministic."""

    name: str = "dot"
    description: str = "Graphviz text"
    suffix: str = ".dot"
    options: tuple[Option, ...] = (TEMPLATES, LEGEND, FLOW)

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The tree as a Graphviz digraph."""
        items = diagram(tree, figures, expand=options["templates"] == "expanded")
        return dot_text(tree, items, with_legend=bool(options["legend"]))


@dataclass(frozen=True, slots=True)
class SvgExporter:
    """SVG by Graphviz where it is installed, else by our own layout."""

    name: str = "svg"
    description: str = "SVG picture, by Graphviz if that is installed"
    suffix: str = ".svg"
    options: tuple[Option, ...] = (
        TEMPLATES,
        LEGEND,
        FLOW,
        Option("layout", "auto", "who lays the picture out", ("auto", *_PROGRAMS, "bbtc")),
    )

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The tree as an SVG document. Raises :class:`BbtcError` if the program that ``layout``
        names is missing or fails; never with ``auto`` and ``bbtc``."""
        items = diagram(tree, figures, expand=options["templates"] == "expanded")
        with_legend = bool(options["legend"])
        layout = str(options["layout"])
        if layout != "bbtc":
            text = dot_text(tree, items, with_legend=with_legend)
            picture = _run_graphviz(_PROGRAMS if layout == "auto" else (layout,), "svg", text)
            if isinstance(picture, bytes):
                return picture.decode()
            if layout != "auto":
                raise BbtcError.single("BBT0706", f"'{layout}' cannot draw the tree: {picture}")
        from bbtc.backends.pictures.svg import svg_text

        return svg_text(tree, items, with_legend=with_legend)


@dataclass(frozen=True, slots=True)
class PngExporter:
    """PNG by Graphviz."""

    name: str = "png"
    description: str = "PNG picture, by Graphviz"
    suffix: str = ".png"
    options: tuple[Option, ...] = (
        TEMPLATES,
        LEGEND,
        FLOW,
        Option("layout", "auto", "who lays the picture out", ("auto", *_PROGRAMS)),
        Option("dpi", 96, "pixels per inch"),
    )

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> bytes:
        """The tree as a PNG file. Raises :class:`BbtcError` if no program can draw it."""
        dpi = options["dpi"]
        if not isinstance(dpi, int) or not 10 <= dpi <= 1200:
            raise BbtcError.single("BBT0704", "option 'dpi' of format 'png' must be from 10 to 1200")
        items = diagram(tree, figures, expand=options["templates"] == "expanded")
        text = dot_text(tree, items, with_legend=bool(options["legend"]))
        layout = str(options["layout"])
        programs = _PROGRAMS if layout == "auto" else (layout,)
        picture = _run_graphviz(programs, "png", text, f"-Gdpi={dpi}")
        if isinstance(picture, bytes):
            return picture
        raise BbtcError.single(
            "BBT0706",
            f"no PNG without Graphviz: {picture}",
            hint="install Graphviz (https://graphviz.org), or bbtc[svg]; or export to svg",
        )


dot = DotExporter()
svg = SvgExporter()
png = PngExporter()

# --- the text --------------------------------------------------------------------------------


def dot_text(tree: Tree, items: tuple[Item, ...], *, with_legend: bool) -> str:
    """The items as a Graphviz digraph."""
    import graphviz

    graph = graphviz.Digraph(
        name=_escaped([printable(f"{tree.task.domain} {tree.task.problem}")]),
        graph_attr={
            "bgcolor": "white",
            "fontname": FONT,
            "nodesep": "0.25",
            "ordering": "out",
            "rankdir": "TB",
            "ranksep": "0.4",
            "splines": "line",
            **({"label": _legend_table(items), "labelloc": "b"} if with_legend else {}),
        },
        node_attr={
            "color": PEN,
            "fontname": FONT,
            "fontsize": "12",
            "height": "0.4",
            "margin": "0.12,0.06",
            "style": "filled",
        },
        # From below a node to the top of its child: a line to the side would run over the neighbours.
        edge_attr={
            "arrowsize": "0.6",
            "color": PEN,
            "fontname": FONT,
            "fontsize": "10",
            "headport": "n",
            "tailport": "s",
        },
    )
    names = _node_names(items)
    for name, item in zip(names, items, strict=True):
        lines = item.lines if item.symbol is None else (item.symbol, *item.lines)
        graph.node(name, _escaped(lines), **_node_attributes(item))
    for name, item in zip(names, items, strict=True):
        if item.parent is not None:
            graph.edge(names[item.parent], name, **_edge_attributes(item))
    return str(graph.source)


def _node_names(items: tuple[Item, ...]) -> list[str]:
    """The ids of the nodes, or numbers if an id could be misread (``a:b`` names a port)."""
    ids = [item.id for item in items]
    if all(_PLAIN_ID.fullmatch(name) for name in ids) and len(set(ids)) == len(ids):
        return ids
    return [f"node{number}" for number in range(1, len(items) + 1)]


def _node_attributes(item: Item) -> dict[str, str]:
    attributes = {"fillcolor": FILL[item.kind], "fontcolor": INK[item.kind], "tooltip": _escaped([item.note])}
    attributes["shape"] = "ellipse" if item.kind == "condition" else "box"
    if item.kind == "condition":
        attributes["margin"] = "0.04,0.03"
    if item.kind == "control":
        attributes |= {"fontsize": "18", "margin": "0.06,0.02", "width": "0.45"}
    if item.dashed:
        attributes["style"] = "filled,dashed"
    return attributes


def _edge_attributes(item: Item) -> dict[str, str]:
    if item.flow is None:
        return {}
    # Two blanks keep the label off the line.
    attributes = {"label": f"  {flow_text(item.flow)}", "penwidth": f"{line_width(item):.2f}"}
    if item.flow == 0:
        attributes |= {"color": UNREACHED, "fontcolor": UNREACHED, "style": "dashed"}
    return attributes


def _escaped(lines: tuple[str, ...] | list[str]) -> str:
    """Text that Graphviz shows as it is: no escapes, no entities, no HTML."""
    import graphviz

    safe = (line.replace("\\", "\\\\").replace("&", "&amp;") for line in lines)
    text: str = graphviz.nohtml("\\n".join(safe))  # a kind of str that is never read as HTML
    return text


def _legend_table(items: tuple[Item, ...]) -> str:
    entries = [
        (f' bgcolor="{FILL[kind]}" width="28" height="18"', " ", meaning) for kind, meaning in legend(items)
    ]
    entries += [(' width="28"', symbol, meaning) for symbol, meaning in symbols_used(items)]
    cells = (
        f'<td border="1"{look}>{html_escape(text)}</td><td align="left">{html_escape(meaning)}   </td>'
        for look, text, meaning in entries
    )
    return f'<<table border="0" cellspacing="4"><tr>{"".join(cells)}</tr></table>>'


# --- the programs ----------------------------------------------------------------------------


def _run_graphviz(programs: tuple[str, ...], form: str, text: str, *arguments: str) -> bytes | str:
    """The picture by the first of the programs that makes one; else, in words, why there is none."""
    reasons: list[str] = []
    for program in programs:
        path = _find_program(program)
        if path is None:
            reasons.append(f"there is no program '{program}'")
            continue
        drawn = text
        if (program, form) == ("graphviz-pure", "png"):
            for kind, stand_in in _STAND_INS.items():
                drawn = drawn.replace(SYMBOLS[kind], stand_in)
        try:
            run = subprocess.run(  # noqa: S603 (a program of a fixed name, its input on stdin)
                [path, f"-T{form}", *arguments],
                input=drawn.encode(),
                capture_output=True,
                timeout=_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            reasons.append(f"'{program}' took more than {_SECONDS} s")
        except OSError as error:
            reasons.append(f"'{program}' does not run: {error.strerror or error}")
        else:
            if run.returncode == 0 and run.stdout:
                return run.stdout
            first = run.stderr.decode(errors="replace").strip().partition("\n")[0]
            reasons.append(f"'{program}' failed: {first or f'exit status {run.returncode}'}")
    return "; ".join(reasons)


def _find_program(program: str) -> str | None:
    found = shutil.which(program)
    if found is None and program == "graphviz-pure":
        # Installed into this environment, which need not be on the PATH.
        folders = [sysconfig.get_path("scripts"), str(Path(sys.executable).parent)]
        found = next((path for folder in folders if (path := shutil.which(program, path=folder))), None)
    return found
