"""A tree as SVG without any other program."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from types import MappingProxyType
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from bbtc.backends.pictures.diagram import (
    FILL,
    INK,
    PEN,
    SYMBOLS,
    UNREACHED,
    Item,
    flow_text,
    legend,
    line_width,
    symbols_used,
)
from bbtc.backends.pictures.layout import Box, tidy
from bbtc.printable import printable
from bbtc.tree.nodes import Tree

_FONT = "Helvetica, Arial, sans-serif"
_SIZE = 12.0  # of text, in pixels
_SYMBOL = 18.0
_SMALL = 10.0
_LINE = 1.25  # line height, in text sizes
_MARGIN = 12.0
_GAP = 16.0
_LEVEL_GAP = 34.0
_ARROW = 6.0

# Widths of Helvetica's characters in thousandths of the text size, from " " to "~" (the font's
# published metrics). Arial's are the same.
_WIDTHS = (
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778,
    722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278,
    278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556,
    556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
)  # fmt: skip
_WIDE = MappingProxyType({"W": 1000, "F": 1000, "A": 700, "N": 600, "Na": 600, "H": 600})


def svg_text(tree: Tree, items: tuple[Item, ...], *, with_legend: bool) -> str:
    """The items as an SVG document. Deterministic; positions are rounded to a tenth of a pixel."""
    boxes = [_box(item) for item in items]
    layout = tidy(boxes, [item.parent for item in items], _GAP, _LEVEL_GAP)
    entries = _legend_entries(items) if with_legend else []
    legend_width = sum(_entry_width(meaning) for _, _, _, meaning in entries)
    width = max(layout.width, legend_width) + 2 * _MARGIN
    height = layout.height + 2 * _MARGIN + (2.6 * _SIZE if entries else 0)
    root = Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "width": _px(width),
            "height": _px(height),
            "viewBox": f"0 0 {_px(width)} {_px(height)}",
            "role": "img",
            "aria-labelledby": "title desc",
            "font-family": _FONT,
            "font-size": _px(_SIZE),
            "text-anchor": "middle",
        },
    )
    SubElement(root, "title", {"id": "title"}).text = printable(f"{tree.task.domain}: {tree.task.problem}")
    SubElement(root, "desc", {"id": "desc"}).text = f"Belief behavior tree of {len(items)} nodes"
    SubElement(root, "rect", {"width": "100%", "height": "100%", "fill": "#ffffff"})
    left = (width - layout.width) / 2
    body = SubElement(root, "g", {"transform": f"translate({_px(left)} {_px(_MARGIN)})"})
    for number, item in enumerate(items):
        if item.parent is not None:
            start = layout.x[item.parent], layout.y[item.parent] + boxes[item.parent].height / 2
            end = layout.x[number], layout.y[number] - boxes[number].height / 2
            _draw_line(body, item, start, end)
    for number, item in enumerate(items):
        _draw_item(body, item, boxes[number], layout.x[number], layout.y[number])
    _draw_legend(root, entries, (width - legend_width) / 2, height - _MARGIN - 0.6 * _SIZE)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


# --- sizes -----------------------------------------------------------------------------------


def text_width(text: str, size: float) -> float:
    """Estimated width of a text in pixels."""
    total = 0
    for character in text:
        code = ord(character) - ord(" ")
        if 0 <= code < len(_WIDTHS):
            total += _WIDTHS[code]
        elif not unicodedata.combining(character):
            total += _WIDE[unicodedata.east_asian_width(character)]
    return total * size / 1000


def _box(item: Item) -> Box:
    symbol = 0.0 if item.symbol is None else _SYMBOL
    width = max((text_width(line, _SIZE) for line in item.lines), default=symbol)
    height = (symbol + _SIZE * len(item.lines)) * _LINE
    if item.kind == "condition":
        # An ellipse around a rectangle of w x h measures 1.42 w x 1.42 h; text leaves its corners free.
        return Box(1.2 * width + 18, max(1.35 * height + 4, 28.0))
    return Box(max(width + 16, 34.0), max(height + (10 if item.lines else 4), 28.0))


def _px(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


# --- drawing ---------------------------------------------------------------------------------


def _draw_item(parent: Element, item: Item, box: Box, x: float, y: float) -> None:
    group = SubElement(parent, "g", {"class": item.kind, "data-id": printable(item.id)})
    SubElement(group, "title").text = item.note
    look = {"fill": FILL[item.kind], "stroke": PEN}
    if item.dashed:
        look["stroke-dasharray"] = "5 3"
    if item.kind == "condition":
        radii = {"rx": _px(box.width / 2), "ry": _px(box.height / 2)}
        SubElement(group, "ellipse", {"cx": _px(x), "cy": _px(y), **radii, **look})
    else:
        corner = {"x": _px(x - box.width / 2), "y": _px(y - box.height / 2)}
        SubElement(
            group, "rect", {**corner, "width": _px(box.width), "height": _px(box.height), "rx": "2", **look}
        )
    top = y - (len(item.lines) * _SIZE + (0 if item.symbol is None else _SYMBOL)) * _LINE / 2
    if item.symbol is not None:
        _draw_symbol(group, item.symbol, x, top + _SYMBOL * _LINE / 2, INK[item.kind])
        top += _SYMBOL * _LINE
    for line in item.lines:
        top += _SIZE * _LINE
        place = {"x": _px(x), "y": _px(top - 0.38 * _SIZE), "fill": INK[item.kind]}
        SubElement(group, "text", place).text = line


def _draw_symbol(parent: Element, symbol: str, x: float, y: float, ink: str) -> None:
    """The symbol of a control node; arrows as lines, because many fonts lack the double one."""
    if symbol == SYMBOLS["fallback"]:
        size = _px(_SYMBOL)
        place = {"class": "symbol", "x": _px(x), "y": _px(y + 0.35 * _SYMBOL), "font-size": size, "fill": ink}
        SubElement(parent, "text", place).text = symbol
        return
    if symbol == SYMBOLS["sequence"]:
        path = f"M {_px(x - 8)} {_px(y)} h 16 m -5 -4 l 5 4 l -5 4"
    elif symbol == SYMBOLS["retry"]:
        path = f"M {_px(x + 4)} {_px(y - 4)} a 6 6 0 1 0 2 5 m -6 -5 h 5 v -5"
    elif symbol == SYMBOLS["retry-until-success"]:
        path = f"M {_px(x - 4)} {_px(y - 4)} a 6 6 0 1 1 -2 5 m 6 -5 h -5 v -5"
    else:
        path = f"M {_px(x - 8)} {_px(y - 2)} h 13 m -13 4 h 13 m -3 -7 l 6 5 l -6 5"
    SubElement(parent, "path", {"d": path, "fill": "none", "stroke": ink, "stroke-width": "1.3"})


def _draw_line(parent: Element, item: Item, start: tuple[float, float], end: tuple[float, float]) -> None:
    (x1, y1), (x2, y2) = start, end
    colour = UNREACHED if item.flow == 0 else PEN
    group = SubElement(parent, "g", {"class": "line"})
    look = {"stroke": colour, "stroke-width": f"{line_width(item):.2f}"}
    if item.flow == 0:
        look["stroke-dasharray"] = "4 3"
    ends = {"x1": _px(x1), "y1": _px(y1), "x2": _px(x2), "y2": _px(y2 - _ARROW)}
    SubElement(group, "line", {**ends, **look})
    tip = f"{_px(x2)},{_px(y2)} {_px(x2 - 3)},{_px(y2 - _ARROW)} {_px(x2 + 3)},{_px(y2 - _ARROW)}"
    SubElement(group, "polygon", {"points": tip, "fill": colour})
    if item.flow is not None:
        place = {
            "x": _px((x1 + 2 * x2) / 3 + 4),
            "y": _px((y1 + 2 * y2) / 3),
            "font-size": _px(_SMALL),
            "text-anchor": "start",
        }
        # A white rim first, so that the text is read where it stands on a line.
        rim = {"stroke": "#ffffff", "stroke-width": "3", "aria-hidden": "true"}
        text = flow_text(item.flow)
        SubElement(group, "text", {**place, **rim}).text = text
        SubElement(group, "text", {**place, "fill": colour}).text = text


# --- legend ----------------------------------------------------------------------------------


def _legend_entries(items: tuple[Item, ...]) -> list[tuple[str, str, str, str]]:
    """Shape, fill, symbol and meaning of each entry."""
    entries = [
        ("ellipse" if kind == "condition" else "rect", FILL[kind], "", meaning)
        for kind, meaning in legend(items)
    ]
    return entries + [("rect", FILL["control"], symbol, meaning) for symbol, meaning in symbols_used(items)]


def _entry_width(meaning: str) -> float:
    return 30 + text_width(meaning, _SIZE) + 18


def _draw_legend(parent: Element, entries: list[tuple[str, str, str, str]], x: float, y: float) -> None:
    for shape, fill, symbol, meaning in entries:
        group = SubElement(parent, "g", {"class": "legend"})
        look: Mapping[str, str] = {"fill": fill, "stroke": PEN}
        if shape == "ellipse":
            SubElement(group, "ellipse", {"cx": _px(x + 12), "cy": _px(y), "rx": "12", "ry": "8", **look})
        else:
            SubElement(
                group,
                "rect",
                {"x": _px(x), "y": _px(y - 8), "width": "24", "height": "16", "rx": "2", **look},
            )
        if symbol:
            _draw_symbol(group, symbol, x + 12, y, INK["control"])
        place = {"x": _px(x + 30), "y": _px(y + 4), "text-anchor": "start"}
        SubElement(group, "text", place).text = meaning
        x += _entry_width(meaning)
