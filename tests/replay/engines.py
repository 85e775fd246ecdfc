"""See :mod:`bbtc.replay.engines`."""

from __future__ import annotations

from bbtc.replay.engines import (
    BtcppReplay,
    Engine,
    PyTreesReplay,
    Replay,
    replay_btcpp,
    replay_py_trees,
)

__all__ = [
    "BtcppReplay",
    "Engine",
    "PyTreesReplay",
    "Replay",
    "replay_btcpp",
    "replay_py_trees",
]
