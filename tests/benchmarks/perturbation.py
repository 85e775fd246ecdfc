"""How trees fare in worlds that others change: those that bbtc plans, beside trees written by hand.

Run: ``python -m tests.benchmarks.perturbation [--runs N] [--seed S] [--only TEXT] [--no-recovery]``. For
each problem with a tree in ``tests/perturbation/by_hand``: nodes, expected cost in the undisturbed world,
success where before every tick something changes by itself with probability 0, 1/100, 5/100 and 10/100,
starts without precondition and goals missed in all of these runs, and from how many of the states that can
be reached (or of a sample) it attains the best that is possible. Exits with 1 where a planned tree falls
short of the one by hand: success more than half a percentage point lower (and more than chance explains), a
start without precondition, a goal missed, a higher cost, or more than 1.5 times the nodes.
"""

from __future__ import annotations

import argparse
import sys
import time
from fractions import Fraction

from tests.domains.problems import Problem
from tests.perturbation.rivals import (
    AUTHORS,
    CONTESTED,
    RATES,
    Author,
    figures_of,
    nodes_of,
    recovery_of,
    runs_of,
    shortfalls,
)

ALL_RATES = (Fraction(0), *RATES)


def row(problem: Problem, author: Author, runs: int, seed: int, *, recovers: bool) -> str:
    """A line of the table."""
    start = time.process_time()
    found = [runs_of(problem, author, rate, runs, seed) for rate in ALL_RATES]
    cost = figures_of(problem, author).cost
    recovered = "-"
    if recovers:
        recovery = recovery_of(problem, author)
        recovered = f"{recovery.attained}/{recovery.hopeful}"
    return (
        f"{problem!s:<28}{author:<9}{nodes_of(problem, author):>5}"
        f"{'inf' if cost is None else f'{float(cost):.3f}':>9}"
        + "".join(f"{float(each.success):>8.4f}" for each in found)
        + f"{sum(each.unready for each in found):>9}{sum(each.missed for each in found):>8}"
        + f"{recovered:>12}{time.process_time() - start:>9.1f}"
    )


def main() -> int:
    """Print a line for each tree, and below where a planned one falls short."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--runs", type=int, default=10_000, help="for each tree and rate")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", metavar="TEXT", help="problems whose names contain it")
    parser.add_argument("--no-recovery", action="store_true")
    options = parser.parse_args()
    print(
        f"{'problem':<28}{'tree':<9}{'nodes':>5}{'cost':>9}"
        + "".join(f"{f'at {float(rate):.0%}':>8}" for rate in ALL_RATES)
        + f"{'unready':>9}{'missed':>8}{'recovers':>12}{'seconds':>9}"
    )
    short: list[str] = []
    for problem in CONTESTED:
        if options.only in str(problem):
            for author in AUTHORS:
                line = row(problem, author, options.runs, options.seed, recovers=not options.no_recovery)
                print(line, flush=True)
            short += (f"{problem}: {each}" for _, each in shortfalls(problem, options.runs, options.seed))
    print()
    print(*(short or ["no planned tree falls short of the one by hand"]), sep="\n")
    return int(bool(short))


if __name__ == "__main__":
    sys.exit(main())
