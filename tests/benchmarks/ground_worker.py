"""Grounds one pair in a process of its own, for :mod:`tests.benchmarks.grounding`; prints JSON.

Arguments: ``instantiate`` (everything reachable) or ``ground`` (what matters to the goal, too), domain,
problem. Time counts from the resolved model to the finished task; memory is the peak of this process and
that of the engine's, if it ran apart, added up although they hardly coincide. The engine's is looked up
while it runs: what the system tells of ended processes counts the image they were started from, too,
which is a copy of this one.
"""

from __future__ import annotations

import json
import resource
import sys
import threading
import time
from pathlib import Path

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.instantiate import ground, instantiate
from bbtc.limits import Limits
from bbtc.pipeline import parse_all, resolve_model, select
from bbtc.syntax.reader import read_source


def _processor_seconds() -> float:
    """What this process and those it has waited for have used."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


class _Engine(threading.Thread):
    """Follows the peak of memory of this process's children."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.kilobytes = 0

    def run(self) -> None:
        """Look every few milliseconds."""
        while True:
            for child in Path("/proc/self/task").glob("*/children"):
                try:
                    for process in child.read_text().split():
                        self._look(Path("/proc", process))
                except (OSError, ValueError):
                    continue
            time.sleep(0.005)

    def _look(self, process: Path) -> None:
        if (process / "cmdline").read_bytes() == Path("/proc/self/cmdline").read_bytes():
            return  # not started yet
        for line in (process / "status").read_text().splitlines():
            if line.startswith("VmHWM"):
                self.kilobytes = max(self.kilobytes, int(line.split()[1]))


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
        engine = _Engine()
        engine.start()
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
                "kilobytes": own + engine.kilobytes,
                "own": own,
            }
        )
    )


if __name__ == "__main__":
    main()
