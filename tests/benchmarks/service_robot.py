"""How long planning takes as a flat fills with items, and how large the trees are.

Run: ``python -m tests.benchmarks.service_robot``. Problems with three goals, of about a thousand and
about seven thousand ground actions, must be planned in 0.3 and 2 seconds of processor time, start-up and
grounding apart, in trees of less than a hundred nodes; exits with 1 otherwise. Source of the figures to
compare with: the best public planner of behavior trees needs about 1 s and 18 s at those sizes, and writes
trees of 4,000 and 31,000 lines.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from pathlib import Path
from types import ModuleType

from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.rewrite.simplify import size
from bbtc.source import SourceFile

FOLDER = Path(__file__).parents[2] / "domains" / "service-robot"
RUNS = 5
MOST_NODES = 100
SIZES = [(8, 4, None), (30, 4, None), (120, 4, 0.3), (345, 10, 2.0)]
"""Items, places of an item, most seconds."""


def generator() -> ModuleType:
    """The domain's generator, which is a script and no module of ours."""
    spec = importlib.util.spec_from_file_location("generate", FOLDER / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main() -> int:
    """Print a line for each size; the time is the best of some runs."""
    domain = read_source(str(FOLDER / "domain.pddl"))
    problem = generator().problem
    missed = 0
    print("items  actions  variables  seconds  most  nodes  states  success")
    for items, places, most in SIZES:
        task = compile_sources(
            [domain, SourceFile("problem.pddl", problem(items, places))], Report(), Limits()
        )
        seconds = float("inf")
        for _ in range(RUNS):
            start = time.process_time()
            plan = plan_task(task, None, "auto", Limits(), lambda _: None)
            seconds = min(seconds, time.process_time() - start)
        nodes = size(plan.tree.root)
        print(
            f"{items:>5}{len(task.actions):>9}{len(task.variables):>11}{seconds:>9.3f}{most or '':>6}"
            f"{nodes:>7}{plan.figures.states:>8}{float(plan.tree.success_probability):>9.4f}"
        )
        missed += (most is not None and seconds > most) or nodes > MOST_NODES
        missed += plan.tree.status != "target-reached"
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
