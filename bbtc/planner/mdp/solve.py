"""P* of a task by whatever means get to it: the whole space where it is small enough, else a search
that expands only what matters."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import count

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.mdp.bounded_search import Advice, search_bounds
from bbtc.planner.mdp.contraction import contracted
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.finite_horizon import Horizon, horizon_values
from bbtc.planner.mdp.fully_observable import fully_observable
from bbtc.planner.mdp.maxprob import Bounds, MaxProb, max_prob
from bbtc.planner.mdp.pomdp.search import Search
from bbtc.planner.mdp.pomdp.solve import closed_in, highest, search_of
from bbtc.planner.mdp.state_space import StateSpace

FEW_STATES = 100_000
"""A space with no more is explored as a whole."""

FEW_BELIEFS = 2_000
"""The same where there may be beliefs without end, whose weights have ever more digits."""

_FEW_IN_ALL = FEW_BELIEFS // 4
"""So many are looked at to see whether they end after all: then the least cost is known, too."""

_SHARE = 1 / 3  # of the time, for the exploration of the whole space
_BEFORE_VALUES = 1 / 2  # of the time, for exploration within a number of actions


@dataclass(frozen=True, slots=True)
class Best:
    """``found`` holds the values of what was explored, and a policy that attains ``bounds.lower``.
    ``stop`` is the limit that left the bounds apart, if one did; ``interrupted`` tells that the user
    did."""

    found: MaxProb
    bounds: Bounds
    stop: Diagnostic | None = None
    interrupted: bool = False

    @property
    def space(self) -> StateSpace:
        """What was explored: everything, or what matters."""
        return self.found.space


class OnlyBounds(LimitReached):
    """A limit was met before a policy was found; these ``bounds`` on P* are known all the same."""

    def __init__(self, diagnostics: Iterable[Diagnostic], bounds: Bounds) -> None:
        self.bounds = bounds
        super().__init__(diagnostics)

    def __reduce__(self) -> tuple[type[OnlyBounds], tuple[tuple[Diagnostic, ...], Bounds]]:
        return type(self), (self.diagnostics, self.bounds)


def best_known(
    task: Task,
    limits: Limits,
    target: Fraction | None = None,
    *,
    whole: bool = False,
    costs: bool = False,
    verdict: bool = False,
    advice: Advice | None = None,
) -> Best:
    """Bounds on P* that meet if the limits allow it. With a ``target``, where the space is too large to be
    explored, a policy that reaches it is enough; with ``verdict``, to know whether there is one. ``costs``
    asks for the whole space, if the limits allow it, so that the least cost can be told. ``advice`` is what
    a search follows first.

    Raises ``LimitReached`` only if the time is over before anything was found (:class:`OnlyBounds` where
    bounds are known then), or with ``whole`` if the limits do not allow to explore the whole space.
    """
    if task.endless_beliefs:
        return _of_endless(task, limits, target, advice, whole=whole, verdict=verdict)
    few = limits if whole or costs else replace(limits, states=min(limits.states, FEW_STATES))
    space = explore_space(task, few if whole else few.part(_SHARE))
    if space.complete:
        found = max_prob(space, limits)
        return Best(found, found.initial)
    if whole:
        space.require_complete()
    del space  # two of them may be too much
    searched = search_bounds(task, limits, target, verdict=verdict, advice=advice)
    return Best(searched.lower, searched.bounds, searched.stop, searched.interrupted)


def _of_endless(
    task: Task, limits: Limits, target: Fraction | None, advice: Advice | None, *, whole: bool, verdict: bool
) -> Best:
    """The same, where there may be beliefs without end."""
    small = _small(task, limits.part(_SHARE))
    if small is not None and small.bounds.exact is not None:
        return small
    search = search_of(task, limits.part(_SHARE))
    most = _seeing_all(task, limits.part(_SHARE))
    most = most if search is None else min(most, highest(search))
    try:
        return _policy_of_endless(
            task, limits, target, advice, found=small, search=search, most=most, whole=whole, verdict=verdict
        )
    except LimitReached as reached:
        raise OnlyBounds(reached.diagnostics, Bounds(Fraction(0), most)) from reached


def _policy_of_endless(
    task: Task,
    limits: Limits,
    target: Fraction | None,
    advice: Advice | None,
    *,
    found: Best | None,
    search: Search | None,
    most: Fraction,
    whole: bool,
    verdict: bool,
) -> Best:
    """The same, with an upper bound, what was found in few beliefs, and a search that has not begun."""
    if found is None and target is not None and target <= most:
        found = _nearest(task, limits.part(_SHARE), target)
    if found is None and whole:
        replace(limits, states=FEW_BELIEFS).check_states(FEW_BELIEFS + 1, "exploration")
    if found is None:
        # Where the goal can be reached in every case, few beliefs may do, and what costs least among them.
        few = (
            limits if search is None else replace(limits.part(_SHARE), states=min(limits.states, FEW_BELIEFS))
        )
        searched = search_bounds(task, few, target, verdict=verdict, advice=advice)
        found = Best(searched.lower, searched.bounds, searched.stop, searched.interrupted)
    if search is not None and found.stop is not None:
        with contextlib.suppress(LimitReached):
            closed = closed_in(search, limits, target, verdict=verdict)
            most = min(most, found.bounds.upper, closed.bounds.upper)
            better = closed.bounds.lower > found.bounds.lower
            kept = (closed.found, closed.bounds) if better else (found.found, found.bounds)
            found = Best(*kept, closed.stop, closed.interrupted)
    bounds = Bounds(found.bounds.lower, max(found.bounds.lower, min(found.bounds.upper, most)))
    return replace(found, bounds=bounds)


def _seeing_all(task: Task, limits: Limits) -> Fraction:
    """An upper bound on P*: that of a robot that sees everything."""
    seeing = fully_observable(task)
    if seeing is None:
        return Fraction(1)
    try:
        return best_known(seeing, limits).bounds.upper
    except LimitReached:
        return Fraction(1)


def _small(task: Task, limits: Limits) -> Best | None:
    """All of a small space; None where it is not small."""
    space = explore_space(task, replace(limits, states=min(limits.states, _FEW_IN_ALL)))
    if not space.complete:
        return None
    found = max_prob(space, limits)
    return Best(found, found.initial)


def _nearest(task: Task, limits: Limits, target: Fraction) -> Best | None:
    """The least of the space, by the number of actions, in which a policy reaches the target. None where that
    is not within reach: with beliefs without end, P* may be what no policy attains."""
    few = replace(limits, states=min(limits.states, FEW_BELIEFS))
    for depth in count(1):
        space = explore_space(task, few, depth)
        if space.stop is not None:
            return None
        found = max_prob(space, limits)
        if space.complete:
            return Best(found, found.initial)
        if found.initial.lower >= target:
            upper = max_prob(space, limits, space.goal | space.fringe).initial.upper
            return Best(found, Bounds(found.initial.lower, upper))
    raise AssertionError("unreachable")


@dataclass(frozen=True, slots=True)
class BestWithin:
    """The values with a number of actions left, in what was explored, and bounds on the task's."""

    horizon: Horizon
    bounds: Bounds
    stop: Diagnostic | None


def best_within(task: Task, limits: Limits, max_actions: int) -> BestWithin:
    """Bounds on the best probability with at most so many actions. Raises ``LimitReached`` if the
    time is over before anything was found."""
    space = contracted(explore_space(task, limits.part(_BEFORE_VALUES), max_actions), limits)
    horizon = horizon_values(space, max_actions, limits)
    if space.stop is None:
        return BestWithin(horizon, horizon.initial[-1], None)
    upper = Fraction(1)
    with contextlib.suppress(LimitReached):
        upper = horizon_values(space, max_actions, limits, space.goal | space.fringe).initial[-1].upper
    return BestWithin(horizon, Bounds(horizon.initial[-1].lower, upper), space.stop)
