"""Single tasks that grounding must manage in a given time: ``python -m tests.benchmarks.targets``.

The largest task of the corpus, one of many outcomes, and every pair of two probabilistic competitions,
each in a process of its own, from the resolved model to the pruned task. What reading and resolving take
stands in a column of its own; it includes loading the grammar. Memory is what bbtc and its engine take
together at one time, at most. Exits with 1 where a bound on wall-clock time or memory is exceeded.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from tests.benchmarks.grounding import pairs_of, run_bbtc
from tests.conftest import corpus_folder

SATELLITE = ("classical/satellite/domain.pddl", "classical/satellite/p33-HC-pfile13.pddl")
TIREWORLD = ("fond/triangle-tireworld/domain.pddl", "fond/triangle-tireworld/p40.pddl")
COMPETITIONS = ("ippc06-", "ippc08-")


def targets(folder: Path) -> list[tuple[Path, Path, float, float]]:
    """Domain, problem, most seconds, most megabytes."""
    single = [
        (folder / SATELLITE[0], folder / SATELLITE[1], 15.0, 700.0),
        (folder / TIREWORLD[0], folder / TIREWORLD[1], 0.5, float("inf")),
    ]
    pairs = [
        pair for pair in pairs_of(folder, "ppddl", own=True) if pair[1].parent.name.startswith(COMPETITIONS)
    ]
    return [*single, *((domain, problem, 60.0, float("inf")) for domain, problem in pairs)]


def main() -> int:
    """Print a line for each, slowest first within the competitions' summary."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default="", help="problems whose path holds this")
    options = parser.parse_args()
    folder = corpus_folder()
    if folder is None:
        print("needs the corpus")
        return 2
    missed = 0
    print("actions  wall s  processor s  before s     MB  most s  problem")
    for domain, problem, seconds, megabytes in targets(folder):
        if options.only not in str(problem):
            continue
        name = problem.relative_to(folder)
        try:
            found = run_bbtc("ground", domain, problem, timeout=2 * seconds + 60)
        except subprocess.TimeoutExpired:
            print(f"{name}: no end after {2 * seconds + 60:.0f} s", flush=True)
            missed += 1
            continue
        if "error" in found:
            print(
                f"{name}: refused after {found['seconds']:.2f} s: {found['error'].splitlines()[0]}",
                flush=True,
            )
            missed += found["seconds"] > seconds
            continue
        size = found["kilobytes"] / 1024
        missed += found["seconds"] > seconds or size > megabytes
        print(
            f"{found['actions']:>7}{found['seconds']:>8.2f}{found['processor']:>13.2f}{found['before']:>10.2f}"
            f"{size:>7.0f}{seconds:>8.1f}  {name}",
            flush=True,
        )
    print(f"{missed} missed")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
