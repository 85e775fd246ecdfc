"""Grounds one pair in a process of its own, for :mod:`tests.benchmarks.grounding`; prints JSON.

Arguments: ``instantiate`` (everything reachable) or ``ground`` (what matters to the goal, too), domain,
problem. Time counts from the resolved model to the finished task. Memory is what this process and the
engine's, if it runs apart, take together at one time, at most; it is looked up every few milliseconds
(what the system tells of ended processes counts the image they were started from, too, a copy of this one).
"""

from __future__ import annotations

import json
import resource
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from bbtc.diagnostics import BbtcError, Report
from bbtc.files.sources import read_source
from bbtc.ground.instantiate import ground, instantiate
from bbtc.limits import Limits
from bbtc.pipeline import parse_all, resolve_model, select


def _processor_seconds() -> float:
    """What this process and those it has waited for have used."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


class _Memory(threading.Thread):
    """Follows the memory of this process and its children, all together."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.most = 0
        self.most_of_engine = 0

    def run(self) -> None:
        """Look every few milliseconds."""
        while True:
            engine = sum(map(self._kilobytes, self._children()))
            self.most_of_engine = max(self.most_of_engine, engine)
            if engine:
                self.most = max(self.most, engine + self._kilobytes(Path("/proc/self")))
            time.sleep(0.005)

    @staticmethod
    def _children() -> list[Path]:
        found = []
        for listed in Path("/proc/self/task").glob("*/children"):
            with suppress(OSError):
                found += [Path("/proc", number) for number in listed.read_text().split()]
        return found

    @staticmethod
    def _kilobytes(process: Path) -> int:
        with suppress(OSError, ValueError):
            # A child that still runs our command has not started its own: it shares our memory.
            ours = Path("/proc/self/cmdline").read_bytes()
            if process.name == "self" or (process / "cmdline").read_bytes() != ours:
                for line in (process / "status").read_text().splitlines():
                    if line.startswith("VmRSS"):
                        return int(line.split()[1])
        return 0


def main() -> None:
    """Do what the arguments say."""
    how, *files = sys.argv[1:]
    began = start = time.perf_counter()
    report = Report()
    try:
        inputs = select(parse_all([read_source(file) for file in dict.fromkeys(files)], report), report)
        report.raise_errors()
        assert inputs is not None
        model = resolve_model(inputs, report, checks=False)
        memory = _Memory()
        memory.start()
        start, used = time.perf_counter(), _processor_seconds()
        task = (ground if how == "ground" else instantiate)(model, report, Limits())
        end, used = time.perf_counter(), _processor_seconds() - used
    except BbtcError as error:
        print(json.dumps({"error": str(error), "seconds": time.perf_counter() - start}))
        return
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        json.dumps(
            {
                "actions": len(task.actions),
                "names": [action.name for action in task.actions] if how == "names" else [],
                "seconds": end - start,
                "processor": used,
                "before": start - began,
                "kilobytes": max(own, memory.most),
                "engine": memory.most_of_engine,
                "own": own,
            }
        )
    )


if __name__ == "__main__":
    main()
