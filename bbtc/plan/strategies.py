"""The planning strategies by name."""

from __future__ import annotations

from bbtc.diagnostics import BbtcError
from bbtc.plan.refine import refine
from bbtc.plan.result import Strategy

STRATEGIES: dict[str, Strategy] = {"refine": refine}
DEFAULT = "refine"


def load_strategy(name: str) -> Strategy:
    """The strategy of a name. Raises :class:`BbtcError` for an unknown one."""
    if name not in STRATEGIES:
        raise BbtcError.single(
            "BBT0501", f"unknown strategy '{name}'", hint=f"known: {', '.join(STRATEGIES)}"
        )
    return STRATEGIES[name]
