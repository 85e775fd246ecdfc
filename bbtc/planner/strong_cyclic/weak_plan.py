"""Weak plans: a sequence of steps, each one of several outcomes of an action, that leads to the goal or to where
a policy goes on.

Greedy best-first search with deferred evaluation, a second queue for what helpful actions lead to (Helmert, "The Fast
Downward planning system", 2006; Richter, Westphal, "The LAMA planner", 2010), and a third, first come first served,
for what comes of states in which something is true that was in no other state equally far from the goal (Lipovetzky,
Geffner, "Best-first width search", 2017), which gets out of local minima.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import NamedTuple

from bbtc.limits import Limits
from bbtc.planner.strong_cyclic.determinised import Determinised, Step
from bbtc.planner.strong_cyclic.policy import Forbidden
from bbtc.planner.strong_cyclic.relaxation import Estimate, Relaxation

_HELPFUL, _NOVEL, _ALL = _QUEUES = (1, 2, 0)
_BOOST = 1000  # expansions that helpful actions are preferred for after progress
_STALLED = 250  # expansions without progress, after which the third queue is used, too
_LOOK = 64  # evaluations between two looks at the limits


class Taken(NamedTuple):
    """A step of a plan: the state before, the action, the outcome."""

    state: int
    action: int
    step: Step


@dataclass(frozen=True, slots=True)
class WeakPlan:
    """The steps, and the state that they lead to."""

    steps: tuple[Taken, ...]
    end: int


@dataclass(frozen=True, slots=True)
class Exhausted:
    """There is no weak plan. ``seen`` are all states that can be reached, in order, but for what follows dead ends
    of the relaxation, which are ``dead``."""

    seen: tuple[int, ...]
    dead: tuple[int, ...]


class Searcher:
    """Searches in one task, with what was found out about states kept from search to search."""

    def __init__(
        self, model: Determinised, relaxation: Relaxation, forbidden: Forbidden, limits: Limits
    ) -> None:
        self.model, self.relaxation, self.forbidden, self.limits = model, relaxation, forbidden, limits
        self.evaluations = 0
        self._estimates: dict[int, Estimate | None] = {}

    def estimate(self, state: int) -> Estimate | None:
        """How far the goal is, None for a dead end of the relaxation."""
        if state in self._estimates:
            return self._estimates[state]
        self.evaluations += 1
        if self.evaluations % _LOOK == 0:
            self.limits.check_time("the search for a policy")
        found = self._estimates[state] = self.relaxation.estimate(state)
        return found

    def estimate_anew(self, state: int) -> Estimate | None:
        """How far the goal is by all that is forbidden now."""
        if self._estimates.get(state) is not None:
            del self._estimates[state]
        return self.estimate(state)

    def forget(self) -> None:
        """Guess anew, since more is forbidden; dead ends stay dead."""
        self._estimates = {each: found for each, found in self._estimates.items() if found is None}

    def search(
        self, start: int, arrived: Callable[[int], bool], on_dead_end: Callable[[int, Taken | None], None]
    ) -> WeakPlan | Exhausted:
        """A plan from a state to one that has ``arrived``, by steps that are not forbidden. ``on_dead_end`` is
        told every dead end of the relaxation, and the step that led to it."""
        parent: dict[int, Taken | None] = {start: None}
        queues: tuple[list[tuple[int, int, int]], ...] = ([(0, 0, start)], [], [])
        priority = [0, 0, 0]
        expanded: dict[int, None] = {}
        dead: dict[int, None] = {}
        novel: dict[int, int] = {}
        best: int | None = None
        count = progress = 0
        while queues[_ALL] or queues[_HELPFUL]:
            if len(expanded) - progress == _STALLED:
                priority[_NOVEL] = min(priority)
            stalled = len(expanded) - progress >= _STALLED
            usable = [number for number in _QUEUES if queues[number] and (stalled or number != _NOVEL)]
            which = min(usable, key=lambda number: priority[number])
            priority[which] += 1
            _, _, state = heappop(queues[which])
            if state in expanded or state in dead:
                continue
            found = self.estimate(state)
            if found is None:
                dead[state] = None
                on_dead_end(state, parent[state])
                continue
            expanded[state] = None
            self.limits.check_states(len(parent), "the search for a policy")
            if best is None or found.steps < best:
                if best is not None:
                    priority[_HELPFUL] -= _BOOST
                best, progress = found.steps, len(expanded)
            seen = novel.get(found.steps, 0)
            new = state & ~seen
            novel[found.steps] = seen | state
            helpful = set(found.helpful)
            actions = self.model.applicable(state)
            actions.sort(key=lambda number: (number not in helpful, number))
            for number in actions:
                if self.forbidden.forbids(state, number) is not None:
                    continue
                for step in self.model.actions[number].steps:
                    after = step.apply(state)
                    if after in parent:
                        continue
                    parent[after] = Taken(state, number, step)
                    if arrived(after):
                        return _traced(parent, after)
                    count += 1
                    entry = (found.steps, count, after)
                    heappush(queues[_ALL], entry)
                    if number in helpful:
                        heappush(queues[_HELPFUL], entry)
                    if new:
                        heappush(queues[_NOVEL], (count, count, after))
        return Exhausted(tuple(expanded), tuple(dead))


def _traced(parent: dict[int, Taken | None], end: int) -> WeakPlan:
    steps: list[Taken] = []
    taken = parent[end]
    while taken is not None:
        steps.append(taken)
        taken = parent[taken.state]
    return WeakPlan(tuple(reversed(steps)), end)
