"""See :mod:`bbtc.replay.script`."""

from __future__ import annotations

from bbtc.replay.script import (
    TIMINGS,
    OffScript,
    Run,
    Script,
    ScriptedWorld,
    Timing,
    Values,
    World,
    run_of,
    script_of,
)

__all__ = [
    "TIMINGS",
    "OffScript",
    "Run",
    "Script",
    "ScriptedWorld",
    "Timing",
    "Values",
    "World",
    "run_of",
    "script_of",
]
