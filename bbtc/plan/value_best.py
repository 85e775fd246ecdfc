"""P* of a task by whatever means get to it: the whole space where it is small enough, else a search
that expands only what matters."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from bbtc.diagnostics import Diagnostic
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.heuristic_search import search_bounds
from bbtc.plan.space import StateSpace, explore_space
from bbtc.plan.value import Bounds, Reachability, reachability

_SHARE = 1 / 3  # of the time, for the exploration of the whole space


@dataclass(frozen=True, slots=True)
class Best:
    """``found`` holds the values of what was explored, and a policy that attains ``bounds.lower``.
    ``stop`` is the limit that left the bounds apart, if one did."""

    found: Reachability
    bounds: Bounds
    stop: Diagnostic | None = None

    @property
    def space(self) -> StateSpace:
        """What was explored: everything, or what matters."""
        return self.found.space


def best_known(task: Task, limits: Limits, target: Fraction | None = None) -> Best:
    """Bounds on P* that meet if the limits allow it. With a ``target``, where the whole space is too
    large, they need only tell whether it can be reached.

    Raises ``LimitReached`` only if the time is over before anything was found.
    """
    space = explore_space(task, limits.part(_SHARE))
    if space.complete:
        found = reachability(space, limits)
        return Best(found, found.initial)
    del space  # two of them may be too much
    searched = search_bounds(task, limits, target)
    return Best(searched.lower, searched.bounds, searched.stop)
