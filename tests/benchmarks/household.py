"""How long planning the paper's scenario takes, and how its belief states grow.

Run: ``python -m tests.benchmarks.household``. Source of the figures to compare with: the authors'
own program needs 1.2 s at target 0.9 and 254 s at 0.9998 for the same scenario on a machine of
the same kind.
"""

from __future__ import annotations

import time
from fractions import Fraction
from pathlib import Path

from bbtc.diagnostics import Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.planner.chaining.refine import refine
from bbtc.syntax.reader import read_source

DOMAIN = Path(__file__).parents[2] / "domains" / "household"
RUNS = 20


def main() -> None:
    """Print one line per target: insertions, states, best and median time in milliseconds."""
    sources = [read_source(str(DOMAIN / name)) for name in ("domain.pddl", "look-for-soda.pddl")]
    task = compile_sources(sources, Report(), Limits())
    print("target      insertions  states  states/insertion  best ms  median ms")
    for target in ("0.9", "0.99", "0.9998", "0.9999999"):
        times = []
        for _ in range(RUNS):
            start = time.perf_counter()
            plan = refine(task, Fraction(target), Limits(), lambda _: None)
            times.append(time.perf_counter() - start)
        times.sort()
        insertions = len(plan.refinements)
        states = plan.figures.states
        print(
            f"{target:<12}{insertions:>10}{states:>8}{states / insertions:>18.2f}"
            f"{times[0] * 1e3:>9.2f}{times[RUNS // 2] * 1e3:>11.2f}"
        )


if __name__ == "__main__":
    main()
