"""Expected figures: ``success >= 0.95``."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from types import MappingProxyType

from bbtc.artefacts.cursor import clip, nearest
from bbtc.artefacts.numbers import exact, parse_written
from bbtc.belief.simulate import Figures
from bbtc.source import Span
from bbtc.tree.nodes import Tree, walk

FIGURES: Mapping[str, Callable[[Tree, Figures], Fraction | int | None]] = MappingProxyType(
    {
        "success": lambda _, figures: figures.success,
        "failure": lambda _, figures: figures.failure,
        "blocked": lambda _, figures: figures.blocked,
        "endless": lambda _, figures: figures.endless,
        "cost": lambda _, figures: figures.cost,
        "cost-given-success": lambda _, figures: figures.cost_given_success,
        "actions": lambda _, figures: figures.actions,
        "actions-given-success": lambda _, figures: figures.actions_given_success,
        "nodes": lambda tree, _: sum(1 for _ in walk(tree.root)),
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

    def unmet(self, tree: Tree, figures: Figures) -> str | None:
        """What the figure is instead; None where the expectation is met. Exact; a figure that is
        infinite or undefined meets nothing."""
        value = FIGURES[self.figure](tree, figures)
        if value is None:
            return f"{self.figure} is infinite or undefined"
        if _OPERATORS[self.comparison](Fraction(value), self.number):
            return None
        return f"{self.figure} is {exact(Fraction(value))}"


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
