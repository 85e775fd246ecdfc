"""What is solved of public FOND and probabilistic problems, beside dedicated planners:
``python -m tests.benchmarks.coverage``.

Each problem of the table is planned in a process of its own, within ``--seconds`` of processor time (start-up
included; it is also what the planner takes for the time, so that other work on the machine costs it nothing)
and 4 GB. The peers' figures (PRP and probfd, measured with the same limits) are read from the
table: ``coverage.tsv`` in the folder ``planning`` beside the corpus, or ``--peers``. A FOND problem counts
as solved where the tree succeeds with probability 1, another one where it attains what probfd found, to
1e-6. Size is nodes plus literals in conditions, for each pair of the peer's policy.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from tests.benchmarks.grounding import pairs_of
from tests.conftest import REPOSITORY, corpus_folder

_CLOSE = 1e-6
_MEMORY = 4 << 30
_SPARE = 5  # seconds beyond the limit that are for writing the best tree
_PROGRAM = "import time; time.monotonic = time.process_time; from bbtc.cli.main import main; main()"


@dataclass(frozen=True)
class Ours:
    """``success`` and ``bounds`` of the tree written, None where none was; its ``nodes`` and ``literals``."""

    seconds: float
    status: int
    success: float | None = None
    bounds: tuple[float, float] | None = None
    nodes: int = 0
    literals: int = 0


@dataclass(frozen=True)
class Theirs:
    """``seconds`` where the peer solved the problem, ``best`` what it found, ``pairs`` of its policy."""

    seconds: float | None
    best: float | None
    pairs: int | None


def peer(row: dict[str, str]) -> Theirs:
    """What the table says of a problem."""
    if row["family"] == "fond":
        solved = row["prp_strong_cyclic"] == "True"
        pairs = int(row["prp_pairs"]) if solved else None
        return Theirs(float(row["prp_cpu_s"]) if solved else None, 1.0 if solved else None, pairs)
    solved = bool(row["probfd_P"])
    pairs = int(row["probfd_policy"]) if solved and row["probfd_policy"] else None
    seconds = float(row["probfd_cpu_s"]) if solved else None
    return Theirs(seconds, float(row["probfd_P"]) if solved else None, pairs)


def run(files: tuple[Path, ...], seconds: int, options: list[str]) -> Ours:
    """Plan a problem in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "tree.json"
        command = [sys.executable, "-c", _PROGRAM, "plan", *map(str, files), "--target", "1", "-q"]
        command += ["--retries", "unbounded", "--time-limit", str(seconds), "-o", str(output), *options]

        def limited() -> None:
            resource.setrlimit(resource.RLIMIT_CPU, (seconds + _SPARE, seconds + _SPARE))
            resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))

        process = subprocess.Popen(
            command,
            cwd=REPOSITORY,
            preexec_fn=limited,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            _, wait_status, usage = os.wait4(process.pid, 0)
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        process.returncode = os.waitstatus_to_exitcode(wait_status)
        spent = usage.ru_utime + usage.ru_stime
        if not output.exists():
            return Ours(spent, process.returncode)
        tree = json.loads(output.read_text(encoding="utf-8"))
    bounds = tree.get("bounds")
    return Ours(
        spent,
        process.returncode,
        float(Fraction(tree["success_probability"])),
        None if bounds is None else (float(Fraction(bounds["lower"])), float(Fraction(bounds["upper"]))),
        *_size(tree["root"]),
    )


def _size(node: dict[str, Any]) -> tuple[int, int]:
    """Nodes, and literals in conditions."""
    nodes, literals = 1, _literals(node["condition"]) if "condition" in node else 0
    for child in node.get("children", ()):
        more = _size(child)
        nodes, literals = nodes + more[0], literals + more[1]
    return nodes, literals


def _literals(condition: Any) -> int:
    """How often a condition, as it is written in a tree's JSON, names a fact."""
    match condition:
        case ["is" | "known", *_]:
            return 1
        case [_, *parts]:
            return sum(map(_literals, parts))
        case _:
            return 0


def solved(family: str, ours: Ours, theirs: Theirs) -> bool:
    """Is the tree as good as can be, as far as is known?"""
    if ours.success is None:
        return False
    if family == "fond" or theirs.best is None:
        met = ours.bounds is not None and ours.success >= ours.bounds[1] - _CLOSE
        return ours.success >= 1 or (family != "fond" and met)
    return ours.success >= theirs.best - _CLOSE


def main() -> int:
    """Print a line for each problem, and what it comes to; 1 where a claim disagrees with a peer's."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--peers", type=Path, help="the table of what the peers needed")
    parser.add_argument("--only", default="", help="problems whose family, domain and name hold this")
    parser.add_argument("--seconds", type=int, default=60, help="of processor time, for each")
    parser.add_argument("--strategy", help="how to plan; default: bbtc's own")
    options = parser.parse_args()
    folder = corpus_folder()
    if folder is None:
        print("needs the corpus")
        return 2
    peers: Path = options.peers or folder.parent / "planning" / "coverage.tsv"
    if not peers.is_file():
        print("needs the table of what the peers needed: --peers")
        return 2
    with peers.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    files = {
        (family, problem.parent.name, problem.name): (domain, problem) if domain != problem else (domain,)
        for family in ("fond", "ppddl")
        for domain, problem in pairs_of(folder, family, own=True)
    }
    more = ["--strategy", options.strategy] if options.strategy else []
    table = _Table()
    print("ours s  theirs s  success  nodes  literals  pairs  size  problem")
    for row in rows:
        name = f"{row['family']}/{row['domain']}/{row['problem']}"
        key = row["family"], row["domain"], row["problem"]
        if options.only in name and key in files:
            table.add(name, row["family"], run(files[key], options.seconds, more), peer(row))
    return table.finish()


class _Table:
    """The lines, and what they come to."""

    def __init__(self) -> None:
        self.tried = self.ours = self.theirs = self.disagree = 0
        self.ratios: list[float] = []
        self.sizes: list[float] = []

    def add(self, name: str, family: str, ours: Ours, theirs: Theirs) -> None:
        """Print a line."""
        won = solved(family, ours, theirs)
        self.tried += 1
        self.ours += won
        self.theirs += theirs.best is not None
        size = None
        if won and theirs.seconds is not None:
            self.ratios.append(math.log(ours.seconds / theirs.seconds))
            if theirs.pairs:
                size = (ours.nodes + ours.literals) / theirs.pairs
                self.sizes.append(size)
        wrong = theirs.best is not None and (
            (ours.bounds is not None and theirs.best > ours.bounds[1] + _CLOSE)
            or (family != "fond" and ours.success is not None and ours.success > theirs.best + _CLOSE)
        )
        self.disagree += wrong
        beside = ["-" if each is None else f"{each:.2f}" for each in (theirs.seconds, ours.success)]
        print(
            f"{ours.seconds:>6.2f}{beside[0]:>10}{beside[1]:>9}{ours.nodes:>7}{ours.literals:>10}"
            f"{theirs.pairs or '-':>7}{'-' if size is None else f'{size:.1f}':>6}  {name}"
            f"{'' if won else ' (not solved)'}{' DISAGREES' if wrong else ''}",
            flush=True,
        )

    def finish(self) -> int:
        """Print the sums."""
        print(f"of {self.tried} solved: {self.ours}, by the peers {self.theirs}; {self.disagree} disagree")
        if self.ratios:
            mean = math.exp(statistics.fmean(self.ratios))
            print(f"where both solve, geometric mean of our processor time over theirs: {mean:.2f}")
        if self.sizes:
            print(f"nodes and literals for each of their pairs, median: {statistics.median(self.sizes):.2f}")
        return int(self.disagree > 0)


if __name__ == "__main__":
    sys.exit(main())
