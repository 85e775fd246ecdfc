"""Grounds one pair in a process of its own, for :mod:`tests.benchmarks.grounding`; prints JSON.

Arguments: ``instantiate`` (everything reachable) or ``ground`` (what matters to the goal, too), domain,
problem. Time counts from the resolved model to the finished task; memory is the peak of this process and
that of the engine's, if it ran apart, added up although they hardly coincide.
"""

from __future__ import annotations

import json
import resource
import sys
import time

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.instantiate import ground, instantiate
from bbtc.limits import Limits
from bbtc.pipeline import parse_all, resolve_model, select
from bbtc.syntax.reader import read_source


def _processor_seconds() -> float:
    """What this process and those it has waited for have used."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


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
        start, used = time.perf_counter(), _processor_seconds()
        task = (ground if how == "ground" else instantiate)(model, report, Limits())
        end, used = time.perf_counter(), _processor_seconds() - used
    except BbtcError as error:
        print(json.dumps({"error": str(error), "seconds": time.perf_counter() - start}))
        return
    own, engine = (
        resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    print(
        json.dumps(
            {
                "actions": len(task.actions),
                "names": [action.name for action in task.actions] if how == "names" else [],
                "seconds": end - start,
                "processor": used,
                "before": start - began,
                "kilobytes": own + engine,
                "own": own,
            }
        )
    )


if __name__ == "__main__":
    main()
