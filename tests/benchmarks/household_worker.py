"""Plans the paper's scenario as often as it is told, for :mod:`tests.benchmarks.household`, with the bbtc
that it finds, which may be of another commit.

Arguments: domain and problem. Each line of the input holds a target, a strategy (``default``: what is taken
without one) and how often to plan; the answer is the processor time of each, in nanoseconds.
"""

from __future__ import annotations

import sys
import time

import bbtc.api


def main() -> None:
    """Answer line by line."""
    task = bbtc.api.compile(*sys.argv[1:])
    for line in sys.stdin:
        target, strategy, often = line.split()
        times = []
        for _ in range(int(often)):
            start = time.process_time_ns()
            bbtc.api.plan(task, target=target, strategy=None if strategy == "default" else strategy)
            times.append(time.process_time_ns() - start)
        print(*times, flush=True)


if __name__ == "__main__":
    main()
