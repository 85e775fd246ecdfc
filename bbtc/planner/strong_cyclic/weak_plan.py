"""Weak plans: a sequence of steps, each one of several outcomes of an action, that leads to the goal or to
where a policy goes on.

Greedy best-first search with deferred evaluation, a second queue for what helpful actions lead to (Helmert,
"The Fast Downward planning system", 2006; Richter, Westphal, "The LAMA planner", 2010), and a third, first
come first served, for what comes of states in which something is true that was in no other state equally
far from the goal (Lipovetzky, Geffner, "Best-first width search", 2017), which gets out of local minima.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from typing import TypeAlias

from bbtc.limits import Limits
from bbtc.planner.strong_cyclic.determinised import Determinised
from bbtc.planner.strong_cyclic.novelty import ByNovelty
from bbtc.planner.strong_cyclic.partial_state import satisfied
from bbtc.planner.strong_cyclic.policy import Forbidden
from bbtc.planner.strong_cyclic.relaxation import Estimate, Relaxation
from bbtc.planner.strong_cyclic.ways import Exhausted, Taken, WeakPlan, traced

_HELPFUL, _NOVEL, _ALL = 1, 2, 0
_QUEUES = (_HELPFUL, _NOVEL, _ALL)  # in this order where their priorities are equal
_BOOST = 1000  # expansions that helpful actions are preferred for after progress
_STALLED = 250  # expansions without progress, after which the third queue is used, too
PATIENCE = 100
"""Expansions without progress, after which the search by novelty is tried beside this one."""
_AT_THE_COST = 50  # operators of the relaxation: to expand a state takes as long as they do in an estimate
_SHORT_WAY = 2  # steps of a relaxed plan that are worth following; single ones are tried anyway
_LOOK = 64  # evaluations between two looks at the limits


_Entry: TypeAlias = tuple[tuple[int, int], int, int]


class Searcher:
    """Searches in one task, with what was found out about states kept from search to search."""

    def __init__(
        self, model: Determinised, relaxation: Relaxation, forbidden: Forbidden, limits: Limits
    ) -> None:
        self.model, self.relaxation, self.forbidden, self.limits = model, relaxation, forbidden, limits
        self.evaluations = 0
        self._estimates: dict[int, Estimate | None] = {}

    @property
    def _worth(self) -> int:
        """How many states are expanded in about the time that an estimate takes."""
        return self.relaxation.size // _AT_THE_COST

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
        """A plan from a state to one that has ``arrived``, by steps that are not forbidden. ``on_dead_end``
        is told every dead end of the relaxation, and the step that led to it."""
        near = self._near(start, arrived)
        if near is not None:
            return near
        parent: dict[int, Taken | None] = {start: None}
        depth = {start: 0}
        frontier = _Frontier(start)
        dead: dict[int, None] = {}
        ahead: int | None = None
        beside = ByNovelty(self, start, arrived)
        while frontier:
            plan = beside.go_on(self._worth) if frontier.idle >= PATIENCE else None
            if plan is not None:
                return plan
            state = frontier.pop() if ahead is None else ahead
            ahead = None
            if state in frontier.expanded or state in dead:
                continue
            found = self.estimate(state)
            if found is None:
                dead[state] = None
                on_dead_end(state, parent[state])
                continue
            self.limits.check_states(len(parent), "the search for a policy")
            novel = frontier.expand(state, found.steps)
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
                    depth[after] = depth[state] + 1
                    if arrived(after):
                        return traced(parent, after)
                    frontier.push(after, (found.steps, depth[after]), number in helpful, novel)
            for taken, after in self._followed(state, found, arrived) if frontier.progress else ():
                ahead = after
                if after not in parent:
                    parent[after], depth[after] = taken, depth[taken.state] + 1
                    frontier.push(after, (found.steps, depth[after]), True, novel)
            if ahead is not None and arrived(ahead):
                return traced(parent, ahead)
        return Exhausted(tuple(frontier.expanded), tuple(dead))

    def _near(self, start: int, arrived: Callable[[int], bool]) -> WeakPlan | None:
        """A plan of the fewest steps, if one is found in the time that it takes to tell one distance."""
        parent: dict[int, Taken | None] = {start: None}
        states = [start]
        for state in states:  # grows while it is read
            for number in self.model.applicable(state):
                for step in self.model.actions[number].steps:
                    after = step.apply(state)
                    if after in parent or self.forbidden.forbids(state, number) is not None:
                        continue
                    parent[after] = Taken(state, number, step)
                    if arrived(after):
                        return traced(parent, after)
                    if len(states) <= self._worth:
                        states.append(after)
        return None

    def _followed(
        self, start: int, found: Estimate, arrived: Callable[[int], bool]
    ) -> list[tuple[Taken, int]]:
        """The steps of a relaxed plan, as far as they can be taken one after the other, and where they lead,
        if that is as much closer to the goal as there are steps. Idea: Vidal, "A lookahead strategy for
        heuristic search planning" (2004), without the repair of plans."""
        way: list[tuple[Taken, int]] = []
        state, seen, left = start, {start}, found.plan
        count = -1
        while len(left) != count:
            count, rest = len(left), []
            for number, step in left:
                after = step.apply(state)
                if (
                    after in seen
                    or not satisfied(self.model.actions[number].test, state)
                    or self.forbidden.forbids(state, number) is not None
                ):
                    rest.append((number, step))
                    continue
                way.append((Taken(state, number, step), after))
                state = after
                seen.add(state)
                if arrived(state):
                    return way
            left = tuple(rest)
        if len(way) < _SHORT_WAY:
            return []
        ahead = self.estimate(state)
        return [] if ahead is None or ahead.steps + len(way) > found.steps else way


class _Frontier:
    """The states to expand, in three queues: all, by what is left to the goal from the state before, then
    by the steps so far; those that helpful actions lead to; those that novel states lead to, in the order
    of arrival, used only while nothing else gets closer to the goal."""

    def __init__(self, start: int) -> None:
        self.expanded: dict[int, None] = {}
        self._queues: tuple[list[_Entry], ...] = ([((0, 0), 0, start)], [], [])
        self._priority = [0, 0, 0]
        self._count = 0
        self._best: int | None = None
        self._progress = 0
        self.progress = False
        """Is the state expanded last closer to the goal than all before?"""
        self._seen: dict[int, int] = {}

    def __bool__(self) -> bool:
        return bool(self._queues[_ALL] or self._queues[_HELPFUL])

    @property
    def idle(self) -> int:
        """The number of expansions without progress."""
        return len(self.expanded) - self._progress

    def pop(self) -> int:
        """The next state; it may have been expanded before."""
        if self.idle == _STALLED:
            self._priority[_NOVEL] = min(self._priority)
        stalled = self.idle >= _STALLED
        usable = [each for each in _QUEUES if self._queues[each] and (stalled or each != _NOVEL)]
        which = min(usable, key=lambda number: self._priority[number])
        self._priority[which] += 1
        return heappop(self._queues[which])[-1]

    def expand(self, state: int, steps: int) -> bool:
        """A state is expanded; is something true in it that was not in others as far from the goal?"""
        self.expanded[state] = None
        self.progress = self._best is None or steps < self._best
        if self.progress:
            if self._best is not None:
                self._priority[_HELPFUL] -= _BOOST
            self._best, self._progress = steps, len(self.expanded)
        seen = self._seen.get(steps, 0)
        self._seen[steps] = seen | state
        return bool(state & ~seen)

    def push(self, state: int, rank: tuple[int, int], helpful: bool, novel: bool) -> None:
        """One more state."""
        self._count += 1
        heappush(self._queues[_ALL], (rank, self._count, state))
        if helpful:
            heappush(self._queues[_HELPFUL], (rank, self._count, state))
        if novel:
            heappush(self._queues[_NOVEL], ((self._count, 0), self._count, state))
