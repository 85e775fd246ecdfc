"""How long planning the paper's scenario takes, and how its belief states grow.

Run: ``python -m tests.benchmarks.household``. Source of the figures to compare with: the authors'
own program needs 1.2 s at target 0.9 and 254 s at 0.9998 for the same scenario on a machine of
the same kind.

With ``--against COMMIT``, planning is compared with that of another commit, by ``refine`` and by default:
both plan in turn, some times each, and of each turn the ratio of the medians of processor time counts. Exits
with 1 where the median of these ratios is above ``--most``.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from statistics import median

from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.planner.chaining.refine import refine

REPOSITORY = Path(__file__).parents[2]
FILES = [REPOSITORY / "domains" / "household" / name for name in ("domain.pddl", "look-for-soda.pddl")]
WORKER = Path(__file__).with_name("household_worker.py")
RUNS = 20
TURNS = 20


def alone() -> None:
    """Print one line per target: insertions, states, best and median time in milliseconds."""
    task = compile_sources([read_source(str(file)) for file in FILES], Report(), Limits())
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


def beside(commit: str, most: float) -> int:
    """Print one line per target and strategy: processor time of both in milliseconds, and the ratio."""
    missed = 0
    with ExitStack() as stack:
        other = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        archive = subprocess.run(["git", "archive", commit], cwd=REPOSITORY, capture_output=True, check=True)
        subprocess.run(["tar", "-x"], cwd=other, input=archive.stdout, check=True)
        workers = [stack.enter_context(_worker(folder)) for folder in (REPOSITORY, other)]
        print(f"target  strategy  here ms  {commit} ms  ratio  least  most")
        for target in ("0.9", "0.9998"):
            for strategy in ("refine", "default"):
                asked = f"{target} {strategy} {RUNS}"
                rounds = [_turn(workers, asked, turn) for turn in range(TURNS + 1)][1:]
                ratios = [here / there for here, there in rounds]
                here, there = (median(each) for each in zip(*rounds, strict=True))
                print(
                    f"{target:<8}{strategy:<10}{here:>7.2f}{there:>{len(commit) + 5}.2f}"
                    f"{median(ratios):>7.2f}{min(ratios):>7.2f}{max(ratios):>6.2f}",
                    flush=True,
                )
                missed += median(ratios) > most
    return int(missed > 0)


def _worker(folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, str(WORKER), *map(str, FILES)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env={"PYTHONPATH": str(folder)})


def _turn(workers: list[subprocess.Popen[str]], asked: str, turn: int) -> tuple[float, float]:
    """The median of each in milliseconds, one after the other; who begins takes turns."""
    found = [0.0, 0.0]
    for number in (0, 1) if turn % 2 else (1, 0):
        worker = workers[number]
        assert worker.stdin is not None
        assert worker.stdout is not None
        worker.stdin.write(asked + "\n")
        worker.stdin.flush()
        found[number] = median(map(int, worker.stdout.readline().split())) / 1e6
    return found[0], found[1]


def main() -> int:
    """Measure alone, or beside another commit."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--against", metavar="COMMIT")
    parser.add_argument("--most", type=float, default=1.1, help="the highest ratio")
    options = parser.parse_args()
    if options.against:
        return beside(options.against, options.most)
    alone()
    return 0


if __name__ == "__main__":
    sys.exit(main())
