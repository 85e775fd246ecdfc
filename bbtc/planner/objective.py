"""Which of several trees for a task is best.

A tree that meets the target is better than one that does not; of those that do not, the one of the highest
success probability is best, then of the least expected cost, then of the fewest nodes. Of those that meet it:

======= ============================================================================================
success the highest success probability, then the least expected cost, then the fewest nodes
cost    the least expected cost, then the highest success probability, then the fewest nodes
size    the fewest nodes, then the highest success probability, then the least expected cost
======= ============================================================================================

Of trees that are equal but for their nodes, one that succeeds more often from where others may leave the
world (:mod:`bbtc.planner.elsewhere`) is better, whatever its size; then one that gives up there less often.
Others may change any fact to any value that it can take, so the goal is never out of their reach: where
nothing that a robot can do leads to it, a tree that waits still gets there once others have put things right,
and one that ended in failure does not. Where its own runs end in failure, a tree does not give up: there it
tells that nothing can be done, which its success probability counts already. Both figures are exact, over
the states that were looked at, each as likely as any other.

The first two look no further than at trees within an allowance of nodes over the smallest one that meets the
target (:func:`allowance`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.planner.options import Prefer
from bbtc.planner.result import Plan
from bbtc.rewrite.simplify import size

MORE_NODES = 20
"""So many nodes more than by half as many again a tree may have."""


def allowance(smallest: int) -> int:
    """The most nodes of a tree that is preferred to one of so many."""
    return smallest + smallest // 2 + MORE_NODES


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """What becomes of a tree's runs from where others may leave the world: how probably they succeed, and how
    probably they give up, which is to end in failure in a state in which no run of the undisturbed world
    ends."""

    success: Fraction = Fraction(0)
    given_up: Fraction = Fraction(1)


UNSEEN = Elsewhere()
"""Of a tree whose runs from there were not looked at: the worst."""


@dataclass(frozen=True, slots=True)
class Worth:
    """What counts of a tree; ``cost`` None is infinite; ``elsewhere`` is what it does from where others may
    leave the world."""

    success: Fraction
    cost: Fraction | None
    nodes: int
    elsewhere: Elsewhere = UNSEEN

    @classmethod
    def of(cls, plan: Plan, elsewhere: Elsewhere = UNSEEN) -> Worth:
        """Of a plan's tree."""
        return cls(plan.figures.success, plan.figures.cost, size(plan.tree.root), elsewhere)


_Key: TypeAlias = tuple[Fraction | int | bool, ...]


def best_of(worths: Sequence[Worth], target: Fraction, prefer: Prefer) -> int:
    """The number of the best one; the first, of equal ones."""
    numbers = range(len(worths))
    meeting = [number for number in numbers if worths[number].success >= target]
    if not meeting:
        return min(numbers, key=lambda number: _by_success(worths[number]))
    most = allowance(min(worths[number].nodes for number in meeting))
    within = [number for number in meeting if worths[number].nodes <= most]
    match prefer:
        case "success":
            return min(within, key=lambda number: _by_success(worths[number]))
        case "cost":
            return min(within, key=lambda number: _by_cost(worths[number]))
        case "size":
            return min(within, key=lambda number: (worths[number].nodes, *_by_success(worths[number])))
        case _:
            assert_never(prefer)


def _by_success(worth: Worth) -> _Key:
    return (-worth.success, worth.cost is None, worth.cost or Fraction(0), *_at_last(worth))


def _by_cost(worth: Worth) -> _Key:
    return (worth.cost is None, worth.cost or Fraction(0), -worth.success, *_at_last(worth))


def _at_last(worth: Worth) -> _Key:
    return (-worth.elsewhere.success, worth.elsewhere.given_up, worth.nodes)
