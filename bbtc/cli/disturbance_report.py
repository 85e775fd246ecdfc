"""Figures of disturbed worlds in words."""

from __future__ import annotations

from fractions import Fraction

from bbtc.artefacts.numbers import exact
from bbtc.cli.counting import counted
from bbtc.disturbance.intervals import Interval
from bbtc.disturbance.perturbed import PerturbedRuns
from bbtc.rounding import decimal


def perturbed_lines(found: PerturbedRuns) -> list[str]:
    """What came of the runs of a tree where facts change by chance."""
    won = found.cost_given_success
    given = "" if won is None else f"; {_near(won)} given success"
    ends = [
        ("missed ", found.missed, ": success without the goal"),
        ("failure", found.failures, ""),
        ("blocked", found.blocked, ""),
        ("cut    ", found.cut, f": no end after {counted(found.most_ticks, 'tick')}"),
    ]
    groups = f", {counted(found.groups, 'group')} of exclusive facts" if found.groups else ""
    how = f"{counted(found.runs, 'run')}, seed {found.seed}"
    what = f"{counted(found.facts, 'fact')} may change{groups}"
    unready = f"{found.unready} of {found.starts} started without their precondition"
    return [
        f"perturbed by {exact(found.rate)} a tick: {how}; {what}",
        f"  success   {_near(found.success)} ({_interval(found.interval)})",
        *(f"  {word}   {_near(Fraction(count, found.runs))}{note}" for word, count, note in ends if count),
        f"  actions   {_near(found.actions)} on average; {unready}",
        f"  cost      {_near(found.cost)} on average{given}",
        f"  changes   {_near(Fraction(found.changes, found.runs))} on average",
    ]


def _interval(interval: Interval) -> str:
    return f"95 %: {_near(interval.lower)} to {_near(interval.upper)}"


def _near(value: Fraction) -> str:
    return decimal(value, 6)
