"""Planning in a world that moves: ``python -m tests.benchmarks.moving``.

The messenger of ``domains/building`` with a battery from 0 to 100 in place of 0 to 10, and its five kinds of
events by the second: compiled and planned within 20 s of processor time; exits with 1 otherwise.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from bbtc.diagnostics import Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.strategies import DEFAULT
from bbtc.rewrite.simplify import size
from bbtc.source import SourceFile

MOST = 20.0
"""Seconds of processor time."""
FINER = {
    "(int 0 10)": "(int 0 100)",
    "(< (battery) 10)": "(< (battery) 100)",
    "(>= (battery) 1)": "(>= (battery) 3)",
    "(decrease (battery) 1)": "(decrease (battery) 3)",
    "(increase (battery) 4)": "(increase (battery) 25)",
    "(= (battery) 6)": "(= (battery) 60)",
}
"""What the text says of the battery, and what it says here."""

_DOMAIN = Path(__file__).resolve().parents[2] / "domains" / "building"


def finer(name: str) -> SourceFile:
    """A file of the domain with a battery in hundredths."""
    text = (_DOMAIN / name).read_text(encoding="utf-8")
    for coarse, fine in FINER.items():
        text = text.replace(coarse, fine)
    return SourceFile(name, text)


def main() -> int:
    """Print the time, and what came of it."""
    before = time.process_time()
    task = compile_sources([finer("domain.pddl"), finer("letter-upstairs.pddl")], Report(), Limits())
    plan = plan_task(task, None, DEFAULT, Limits(), lambda _: None)
    spent = time.process_time() - before
    (battery,) = task.numbers
    assert (battery.low, battery.high) == (0, 100)
    kinds = len({event.schema for event in task.events})
    print(
        f"battery {battery.low} to {battery.high}, {kinds} kinds of events: {spent:.1f} s of {MOST:.0f}, "
        f"{size(plan.tree.root)} nodes, success {float(plan.tree.success_probability):g}"
    )
    return 0 if spent <= MOST else 1


if __name__ == "__main__":
    sys.exit(main())
