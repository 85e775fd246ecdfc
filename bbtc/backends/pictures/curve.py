"""Success by a time as a picture: both bounds, and the band between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from bbtc.printable import printable
from bbtc.rounding import decimal
from bbtc.timing.curve import Curve
from bbtc.timing.figures import nice

_WIDTH, _HEIGHT = 640.0, 360.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 16.0, 28.0, 44.0
_INK, _GRID, _BAND, _LOWER, _UPPER = "#222222", "#dddddd", "#cfe3f5", "#1f6fb2", "#7fb2dc"


def curve_svg(curve: Curve, title: str) -> str:
    """The curve as an SVG document. Deterministic; positions are rounded to a tenth of a pixel."""
    last = max(1, len(curve.late) - 1)
    root = Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "width": _px(_WIDTH),
            "height": _px(_HEIGHT),
            "viewBox": f"0 0 {_px(_WIDTH)} {_px(_HEIGHT)}",
            "role": "img",
            "aria-labelledby": "title desc",
            "font-family": "Helvetica, Arial, sans-serif",
            "font-size": "12",
            "fill": _INK,
        },
    )
    SubElement(root, "title", {"id": "title"}).text = printable(title)
    SubElement(root, "desc", {"id": "desc"}).text = "Bounds of the probability of success, by seconds"
    SubElement(root, "rect", {"width": "100%", "height": "100%", "fill": "#ffffff"})
    _text(root, _WIDTH / 2, 16, printable(title), "middle")
    for tenth in range(0, 11, 2):
        y = _y(tenth / 10)
        _line(root, [(_LEFT, y), (_WIDTH - _RIGHT, y)], _GRID)
        _text(root, _LEFT - 6, y + 4, f"{tenth / 10:g}", "end")
    whole = last * curve.step
    apart = nice(whole / 8)
    for number in range(int(whole / apart) + 1):
        x = _x(float(number * apart / whole))
        _line(root, [(x, _y(0)), (x, _y(0) + 4)], _INK)
        _text(root, x, _y(0) + 18, decimal(number * apart, 6), "middle")
    _text(root, _WIDTH / 2, _HEIGHT - 8, "seconds", "middle")
    lower, upper = list(_stairs(curve.late, last)), list(_stairs(curve.early, last))
    points = " ".join(f"{_px(x)},{_px(y)}" for x, y in [*lower, *reversed(upper)])
    SubElement(root, "polygon", {"points": points, "fill": _BAND})
    _line(root, upper, _UPPER)
    _line(root, lower, _LOWER)
    _line(root, [(_LEFT, _y(1)), (_LEFT, _y(0)), (_WIDTH - _RIGHT, _y(0))], _INK)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _stairs(values: Sequence[float], last: int) -> Iterator[tuple[float, float]]:
    """The corners of a function that keeps its value until the next step."""
    before: float | None = None
    for number, value in enumerate(values):
        if before is not None and value != before:
            yield _x(number / last), _y(before)
        if value != before or number == len(values) - 1:
            yield _x(number / last), _y(value)
        before = value


def _x(share: float) -> float:
    return _LEFT + share * (_WIDTH - _LEFT - _RIGHT)


def _y(probability: float) -> float:
    return _TOP + (1 - probability) * (_HEIGHT - _TOP - _BOTTOM)


def _line(root: Element, points: Sequence[tuple[float, float]], colour: str) -> None:
    listed = " ".join(f"{_px(x)},{_px(y)}" for x, y in points)
    SubElement(root, "polyline", {"points": listed, "fill": "none", "stroke": colour})


def _text(root: Element, x: float, y: float, text: str, anchor: str) -> None:
    SubElement(root, "text", {"x": _px(x), "y": _px(y), "text-anchor": anchor}).text = text


def _px(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")
