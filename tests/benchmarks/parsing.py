"""Parsing beside Fast Downward's parser: ``python -m tests.benchmarks.parsing``.

Every classical pair of the corpus that both accept, read once by each, from file to finished tree; each
side in a process of its own, after one pair to warm up. Printed are the total times and their ratio.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from bbtc.diagnostics import BbtcError, Report
from bbtc.files.sources import read_source
from bbtc.syntax.parser import parse
from tests import downward
from tests.benchmarks.grounding import pairs_of
from tests.conftest import corpus_folder

ROUNDS = 3


def seconds_of(pair: tuple[Path, Path]) -> float | None:
    """The seconds that parsing a pair takes; None for one that is refused."""
    report = Report()
    start = time.perf_counter()
    try:
        for file in pair:
            parse(read_source(str(file)), report)
    except BbtcError:
        return None
    return None if report.errors else time.perf_counter() - start


def main() -> int:
    """Print the totals of the best of some rounds of each, one after the other."""
    folder = corpus_folder()
    if folder is None or downward.translator() is None:
        print("needs the corpus and the package up-fast-downward")
        return 2
    pairs = pairs_of(folder, "classical")
    ours, theirs = [], []
    for _ in range(ROUNDS):
        seconds_of(pairs[0])
        ours.append([seconds_of(pair) for pair in pairs])
        theirs.append(downward.parse_seconds([pairs[0], *pairs])[1:])
    both = [n for n in range(len(pairs)) if ours[0][n] is not None and theirs[0][n] is not None]
    size = sum(file.stat().st_size for n in both for file in pairs[n]) / 1e6
    best = [min(sum(each[n] or 0 for n in both) for each in side) for side in (ours, theirs)]
    print(f"{len(both)} of {len(pairs)} pairs, {size:.1f} MB")
    for name, total in zip(("bbtc", "Fast Downward"), best, strict=True):
        print(f"{name:<15}{total:>7.2f} s {size / total:>6.2f} MB/s")
    print(f"ratio of the times: {best[0] / best[1]:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
