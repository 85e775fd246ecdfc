"""Expected figures: ``success >= 0.95``."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from types import MappingProxyType

from bbtc.artefacts.cursor import clip, nearest
from bbtc.artefacts.numbers import exact, parse_probability, parse_written
from bbtc.durations import LONGEST
from bbtc.manifest.measured import Measured
from bbtc.rounding import decimal
from bbtc.source import Span
from bbtc.tree.nodes import walk

FIGURES: Mapping[str, Callable[[Measured], Fraction | int | None]] = MappingProxyType(
    {
        "success": lambda found: found.figures.success,
        "failure": lambda found: found.figures.failure,
        "blocked": lambda found: found.figures.blocked,
        "mistaken": lambda found: found.figures.mistaken,
        "endless": lambda found: found.figures.endless,
        "cost": lambda found: found.figures.cost,
        "cost-given-success": lambda found: found.figures.cost_given_success,
        "actions": lambda found: found.figures.actions,
        "actions-given-success": lambda found: found.figures.actions_given_success,
        "nodes": lambda found: sum(1 for _ in walk(found.tree.root)),
        "recovery": lambda found: found.recovery.mean,
        "recovery-worst": lambda found: found.recovery_worst,
        "perturbed-success": lambda found: found.perturbed.success,
        "perturbed-missed": lambda found: Fraction(found.perturbed.missed, found.perturbed.runs),
        "perturbed-unready": lambda found: found.perturbed.unready,
    }
)
"""What can be expected of a tree; None stands for infinite or undefined."""

_OPERATORS: Mapping[str, Callable[[Fraction, Fraction], bool]] = MappingProxyType(
    {">=": operator.ge, "<=": operator.le, "==": operator.eq, ">": operator.gt, "<": operator.lt}
)
_EXPECTATION = re.compile(r"\s*([a-z-]+)\s*(>=|<=|==|>|<)\s*(\S+)\s*")


@dataclass(frozen=True, slots=True)
class Expectation:
    """``figure`` (a key of :data:`FIGURES`) compared with a number; ``text`` as it was written."""

    figure: str
    comparison: str
    number: Fraction
    text: str
    span: Span | None = field(default=None, compare=False)

    seconds: Fraction | None = None
    """Of success by a deadline: how many."""

    @property
    def disturbed(self) -> bool:
        """Is it about a world that others change? Then all actions of the task matter."""
        return self.figure.startswith("recovery") or self.perturbed

    @property
    def perturbed(self) -> bool:
        """Is it about perturbed runs, which have a rate?"""
        return self.figure.startswith("perturbed")

    def unmet(self, found: Measured) -> str | None:
        """What the figure is instead; None where the expectation is met. Exact; a figure that is
        infinite or undefined meets nothing."""
        if self.seconds is not None:
            return self._unmet_in_time(found, self.seconds)
        value = FIGURES[self.figure](found)
        if value is None:
            return f"{self.figure} is infinite or undefined"
        if _OPERATORS[self.comparison](Fraction(value), self.number):
            return None
        return f"{self.figure} is {exact(Fraction(value))}"

    def _unmet_in_time(self, found: Measured, seconds: Fraction) -> str | None:
        """The same, of success by a deadline, of which bounds are known: what is not certain is not met."""
        least, most = found.success_by(seconds)
        if least >= self.number:
            return None
        between = f"between {decimal(least, 9)} and {decimal(most, 9)}"
        return f"success within {decimal(seconds, 12)} s is {between}"


def parse_expectation(text: str, span: Span | None = None) -> Expectation:
    """The expectation that a text states. Raises ``ValueError`` that says what is wrong with it."""
    match = _EXPECTATION.fullmatch(text) if len(text) <= 1000 else None
    if match is None:
        raise ValueError("an expectation is FIGURE COMPARISON NUMBER, such as 'success >= 0.95'")
    figure, comparison, number = match.groups()
    if figure not in FIGURES:
        advice = nearest(figure, tuple(FIGURES)) or f"there are {', '.join(FIGURES)}"
        raise ValueError(f"unknown figure '{clip(figure)}'; {advice}")
    return Expectation(figure, comparison, parse_written(number), text.strip(), span)


def success_in_time(seconds: str, at_least: str, span: Span | None = None) -> Expectation:
    """Success by a deadline, with a probability of that at least. Raises ``ValueError`` that says what is
    wrong with the numbers."""
    time = parse_written(seconds, "a number of seconds such as 120")
    if not 0 < time <= LONGEST:
        raise ValueError(f"{clip(seconds)} is not above 0 and at most {LONGEST} seconds")
    text = f"success_by {seconds} >= {at_least}"
    return Expectation("success_by", ">=", parse_probability(at_least), text, span, time)
