"""The time that a tree takes, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from bbtc.artefacts.numbers import exact
from bbtc.artefacts.time_json import outward
from bbtc.diagnostics import BbtcError
from bbtc.printable import printable
from bbtc.rounding import decimal

if TYPE_CHECKING:
    from bbtc.belief.chain import Chain
    from bbtc.belief.scenarios import Scenario
    from bbtc.belief.simulate import Figures
    from bbtc.durations import Bounds
    from bbtc.limits import Limits
    from bbtc.timing.curve import Curve
    from bbtc.timing.figures import Quantile, Times
    from bbtc.tree.nodes import Tree

_ROWS = 8  # of the curve
_MOST_NAMED = 5


def told_times(
    tree: Tree, figures: Figures, chain: Chain, limits: Limits, step: Fraction | None = None
) -> ToldTimes:
    """The time that a tree takes, by its figures and the chain they come from. Raises ``LimitReached``."""
    from bbtc.timing.chain import timed

    if not timed(tree.task):
        return ToldTimes(tree, None)  # most tasks: nothing more is loaded
    from bbtc.timing.figures import times

    return ToldTimes(tree, times(tree.task, chain, figures.success, limits, step))


@dataclass(frozen=True, slots=True)
class ToldTimes:
    """What a command tells of the time that a tree takes; nothing where no action says how long it takes."""

    tree: Tree
    times: Times | None

    def lines(self) -> list[str]:
        """Lines of a report."""
        return [] if self.times is None else time_lines(self.times)

    def add_to(self, data: dict[str, Any], runs: Sequence[Scenario]) -> None:
        """Add it to the figures in JSON, and to the runs that are listed there."""
        if self.times is not None:
            from bbtc.artefacts.time_json import run_times, times_to_json

            data |= times_to_json(self.times)
            run_times(self.times, data["scenarios"], runs)

    def of(self, run: Scenario) -> str:
        """``, 12.5 s``: the expected time of a run, given that it is this one."""
        if self.times is None or not self.times.ways:
            return ""
        from bbtc.timing.chain import time_of_run

        return f", {seconds(time_of_run(self.times.ways, run.visited))}"

    def picture(self) -> str:
        """The curve of success by a time, as SVG. Raises :class:`BbtcError` where it is not known."""
        found = None if self.times is None else self.times.figures
        if found is None:
            why = "no action of the tree has a `:duration`" if self.times is None else self.times.untold
            raise BbtcError.single("BBT0446", f"there is no curve of success by a time: {why}")
        from bbtc.backends.pictures.curve import curve_svg

        return curve_svg(found.curve, f"{self.tree.task.domain}: {self.tree.task.problem}")


def time_lines(times: Times) -> list[str]:
    """What is known of the time, as lines of a report."""
    found = times.figures
    if found is None:
        return [f"time      not told: {times.untold}"]
    overall = f"{seconds(found.expected)} expected" if found.expected is not None else "infinite"
    given = f"; {seconds(found.given_success)} given success" if found.given_success is not None else ""
    lines = [f"time      {overall}{given}"]
    if found.untimed:
        listed = printable(", ".join(found.untimed[:_MOST_NAMED]))
        left = len(found.untimed) - _MOST_NAMED
        more = f" and {left} more" if left > 0 else ""
        lines.append(f"          {listed}{more}: no duration is said, none is counted")
    lines += [f"  {exact(each.share)} of what succeeds is done {_span(each)}" for each in found.quantiles]
    if found.quantiles:
        lines += [
            f"  success by {decimal(at, 6)} s: {probabilities(found.curve, number)}"
            for number, at in _rows(found.curve)
        ]
    return lines


def seconds(bounds: Bounds) -> str:
    """``12.5 s``, or ``from 12.4 to 12.5 s`` where it is not known exactly."""
    if bounds[0] == bounds[1]:
        return f"{exact(bounds[0])} s"
    return f"from {decimal(bounds[0], 9)} to {decimal(bounds[1], 9)} s"


def probabilities(curve: Curve, number: int) -> str:
    """``from 0.8 to 0.82``: bounds of the probability of success within so many steps."""
    both = (curve.late, False), (curve.early, True)
    least, most = (outward(each[number], up=up, places=6) for each, up in both)
    return least if least == most else f"from {least} to {most}"


def _span(quantile: Quantile) -> str:
    if quantile.most is None:
        return f"after {decimal(quantile.least, 6)} s at the earliest"
    if quantile.least == quantile.most:
        return f"within {decimal(quantile.most, 6)} s"
    return f"within a time from {decimal(quantile.least, 6)} to {decimal(quantile.most, 6)} s"


def _rows(curve: Curve) -> Iterator[tuple[int, Fraction]]:
    """A few round times on the curve, by step."""
    from bbtc.timing.figures import nice

    whole = (len(curve.late) - 1) * curve.step
    apart = nice(whole / _ROWS) if whole else curve.step
    for number in range(1, int(whole / apart) + 1):
        yield int(number * apart / curve.step), number * apart
