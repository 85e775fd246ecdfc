"""Grounding beside Fast Downward's ``instantiate.explore``: ``python -m tests.benchmarks.grounding``.

Every classical pair of the corpus that both read is grounded by both, one after the other, each in a
process of its own; those with at least ``--actions`` ground actions count. Printed are the times, the
peaks of memory, and their ratios. Times are processor seconds, the engine's own process included, so
that a busy machine does not blur them. Needs ``up-fast-downward`` and the corpus.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from tests import downward
from tests.conftest import REPOSITORY, corpus_folder
from tests.corpus import read_corpus


def run_bbtc(how: str, domain: Path, problem: Path, timeout: float = 600) -> dict[str, Any]:
    """What the worker measured; ``error`` instead where it was refused."""
    command = [sys.executable, "-m", "tests.benchmarks.ground_worker", how, str(domain), str(problem)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=timeout, cwd=REPOSITORY
    )
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def pairs_of(folder: Path, family: str, *, own: bool = False) -> list[tuple[Path, Path]]:
    """Domain and problem of each pair of a family; with ``own``, also files that hold both."""
    corpus = read_corpus(folder)
    return [
        (folder / domain, folder / problem)
        for problem in corpus.families[family]
        for domain in corpus.partners.get(problem, (problem,) if own and problem in corpus.both else ())
    ]


def main() -> int:
    """Print a line for each pair, and the means."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--actions", type=int, default=10_000, help="smallest number of ground actions")
    parser.add_argument("--most", type=int, default=10_000_000, help="largest number of ground actions")
    parser.add_argument("--only", default="", help="pairs whose path holds this")
    parser.add_argument("--each", type=int, default=1000, help="most pairs of one domain")
    parser.add_argument("--timeout", type=float, default=300, help="seconds for one run")
    options = parser.parse_args()
    folder = corpus_folder()
    if folder is None or downward.translator() is None:
        print("needs the corpus and the package up-fast-downward")
        return 2
    counted: Counter[Path] = Counter()
    logs: list[tuple[float, float]] = []
    print("actions  ours s  theirs s  ratio   ours MB  theirs MB  ratio  problem")
    for domain, problem in pairs_of(folder, "classical"):
        if options.only not in str(problem) or counted[problem.parent] >= options.each:
            continue
        try:
            ours = run_bbtc("instantiate", domain, problem, options.timeout)
            if "error" in ours or not options.actions <= ours["actions"] <= options.most:
                continue
            theirs = downward.explore(domain, problem, timeout=options.timeout)
        except subprocess.SubprocessError as error:
            print(f"{problem.relative_to(folder)}: {type(error).__name__}", flush=True)
            continue
        faster, smaller = theirs.processor / ours["processor"], ours["kilobytes"] / theirs.kilobytes
        counted[problem.parent] += 1
        logs.append((math.log(faster), math.log(smaller)))
        print(
            f"{ours['actions']:>7}{ours['processor']:>8.2f}{theirs.processor:>10.2f}{faster:>7.2f}"
            f"{ours['kilobytes'] / 1024:>10.0f}{theirs.kilobytes / 1024:>11.0f}{smaller:>7.2f}"
            f"  {problem.relative_to(folder)}"
            + ("" if ours["actions"] == theirs.actions else f" (theirs: {theirs.actions} actions)"),
            flush=True,
        )
    if logs:
        means = [math.exp(sum(each) / len(logs)) for each in zip(*logs, strict=True)]
        print(
            f"{len(logs)} pairs, geometric means: {means[0]:.2f} times as fast, {means[1]:.2f} of the memory"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
