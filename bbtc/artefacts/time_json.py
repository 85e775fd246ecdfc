"""The time that a tree takes as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bbtc.artefacts.numbers import figure_text
from bbtc.rounding import short_text

if TYPE_CHECKING:
    from bbtc.belief.scenarios import Scenario
    from bbtc.durations import Bounds
    from bbtc.timing.figures import TimeFigures, Times


def times_to_json(times: Times) -> dict[str, Any]:
    """Seconds: expectations (``null``: infinite, or undefined), quantiles, and the curve of success by a
    time; or why they are not told."""
    if times.figures is None:
        return {"time_untold": times.untold}
    return {"time": _figures(times.figures)}


def run_times(times: Times, written: list[dict[str, Any]], runs: Sequence[Scenario]) -> None:
    """Tell of each run its expected time, given that it is this one."""
    from bbtc.timing.chain import time_of_run

    if times.ways:
        for data, run in zip(written, runs, strict=True):
            data["time"] = bounds_to_json(time_of_run(times.ways, run.visited))


def _figures(found: TimeFigures) -> dict[str, Any]:
    curve = found.curve
    return {
        "expected": bounds_to_json(found.expected),
        "given_success": bounds_to_json(found.given_success),
        "quantiles": [
            {
                "share": figure_text(each.share),
                "at_least": figure_text(each.least),
                "at_most": None if each.most is None else figure_text(each.most),
            }
            for each in found.quantiles
        ],
        "success_by": {
            "step": figure_text(curve.step),
            "at_least": [outward(p, up=False) for p in curve.late],
            "at_most": [outward(p, up=True) for p in curve.early],
        },
        **({"untimed": list(found.untimed)} if found.untimed else {}),
    }


def bounds_to_json(bounds: Bounds | None) -> dict[str, str] | None:
    """Two ends; they are the same where the number is exact."""
    if bounds is None:
        return None
    return {"at_least": figure_text(bounds[0]), "at_most": figure_text(bounds[1])}


def outward(probability: float, *, up: bool, places: int = 9) -> str:
    """A bound with so many decimals, rounded to the safe side."""
    grid = 10**places
    exact = Fraction(probability) * grid
    return short_text(min(Fraction(1), Fraction(math.ceil(exact) if up else math.floor(exact), grid)))
