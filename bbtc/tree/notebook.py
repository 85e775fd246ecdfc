"""How a tree shows in a notebook. Drawing is a later stage: whoever can draw registers here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

Drawing: TypeAlias = Callable[[Any], str]
"""From a tree to its picture, as SVG."""

_drawings: list[Drawing] = []


def register(drawing: Drawing) -> None:
    """Draw trees so from now on."""
    _drawings[:] = [drawing]


def picture(tree: object) -> str | None:
    """The picture of a tree; None where nobody has told how to draw one."""
    return _drawings[0](tree) if _drawings else None
