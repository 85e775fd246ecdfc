"""See :mod:`bbtc.replay.ticks`."""

from __future__ import annotations

from bbtc.replay.ticks import (
    Tick,
    TickScript,
    TickWorld,
    random_script,
)

__all__ = [
    "Tick",
    "TickScript",
    "TickWorld",
    "random_script",
]
