"""Weak plans by novelty: a search that looks at very many states, and measures how far the goal is from few.

Best-first width search, BFWS(f5) of width 1 (Lipovetzky, Geffner, "Best-first width search: exploration and
exploitation in classical planning", 2017): a state comes first if something holds in it, or does not, that
was otherwise in all states before it with as many goals left and as many of the facts reached that a relaxed
plan needs. The relaxed plan is that of the last state on the way in which one goal less was left, or in which
all facts of the one before had been reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Protocol, TypeAlias

from bbtc.limits import Limits
from bbtc.planner.mdp.packing import All, Cube
from bbtc.planner.strong_cyclic.determinised import Determinised
from bbtc.planner.strong_cyclic.partial_state import satisfied
from bbtc.planner.strong_cyclic.policy import Forbidden
from bbtc.planner.strong_cyclic.relaxation import Estimate
from bbtc.planner.strong_cyclic.ways import Taken, WeakPlan, traced

_Bits: TypeAlias = tuple[int, int]

_LOOK = 1024  # expansions between two looks at the limits
_MOST_STATES = 300_000
"""States of one search; with more, it has failed."""


@dataclass(frozen=True, slots=True)
class _Lead:
    """Facts to be reached, as bits that are to be set, and to be clear; ``number`` counts the leads on the
    way."""

    wanted: _Bits
    number: int


class Knowledge(Protocol):
    """What is known of a task: of ``forbidden`` steps, and how far the goal is."""

    model: Determinised
    forbidden: Forbidden
    limits: Limits

    def estimate(self, state: int) -> Estimate | None:
        """How far the goal is, None for a dead end of the relaxation."""
        ...


class ByNovelty:
    """One search, from a state to one that has ``arrived``, by steps that are not forbidden."""

    def __init__(self, known: Knowledge, start: int, arrived: Callable[[int], bool]) -> None:
        self.model, self.forbidden, self.limits = known.model, known.forbidden, known.limits
        self.estimate, self.start, self.arrived = known.estimate, start, arrived
        self.parent: dict[int, Taken | None] = {}
        goal, packing = known.model.goal, known.model.packing
        self._full = sum(map(packing.bits, range(len(packing.unknown))))
        goals = goal.parts if isinstance(goal, All) else (goal,)
        self._goals = [part for part in goals if isinstance(part, Cube)]
        self._others = [part for part in goals if not isinstance(part, Cube)]
        self._seen: dict[tuple[int, int, int], tuple[int, int]] = {}
        self._heap: list[tuple[bool, int, int, int, int, int]] = []
        self._known: dict[int, tuple[_Lead, _Bits]] = {}
        """The lead of each state, and which of its facts were reached on the way."""
        self._expanded = 0

    def go_on(self, expansions: int) -> WeakPlan | None:
        """Expand so many states more, if no plan is found before."""
        if not self.parent:
            self.parent[self.start] = None
            lead = self._lead(self.start, 0)
            if lead is not None:
                self._push(self.start, lead, (0, 0), self._left(self.start))
        for _ in range(expansions):
            if not self._heap:
                return None
            self._expanded += 1
            if self._expanded % _LOOK == 0:
                self.limits.check_states(len(self.parent), "the search for a policy")
                self.limits.check_time("the search for a policy")
            _, left, *_, state = heappop(self._heap)
            end = self._expand(state, left)
            if end is not None:
                return traced(self.parent, end)
            if len(self.parent) > _MOST_STATES:
                self._heap.clear()
        return None

    def _expand(self, state: int, left: int) -> int | None:
        """Find what follows a state; if one of that has arrived, which."""
        lead, reached = self._known.pop(state)
        for number in self.model.applicable(state):
            if self.forbidden.forbids(state, number) is not None:
                continue
            for step in self.model.actions[number].steps:
                after = step.apply(state)
                if after in self.parent:
                    continue
                self.parent[after] = Taken(state, number, step)
                if self.arrived(after):
                    return after
                self._follow(after, lead, reached, left)
        return None

    def _follow(self, state: int, lead: _Lead, before: _Bits, left: int) -> None:
        """A new state after one of this lead, in which so many goals were left."""
        remaining = self._left(state)
        reached = before[0] | state & lead.wanted[0], before[1] | ~state & lead.wanted[1]
        if remaining < left or reached == lead.wanted:
            new = self._lead(state, lead.number + 1)
            if new is None:
                return
            lead, reached = new, (0, 0)
        self._push(state, lead, reached, remaining)

    def _push(self, state: int, lead: _Lead, reached: _Bits, left: int) -> None:
        count = reached[0].bit_count() + reached[1].bit_count()
        key = left, lead.number, count
        true, false = self._seen.get(key, (0, 0))
        absent = ~state & self._full
        known = not (state & ~true or absent & ~false)
        if not known:
            self._seen[key] = true | state, false | absent
        self._known[state] = lead, reached
        heappush(self._heap, (known, left, -lead.number, -count, len(self.parent), state))

    def _lead(self, state: int, number: int) -> _Lead | None:
        """What is to be reached from a state; None for a dead end of the relaxation."""
        found = self.estimate(state)
        if found is None:
            return None
        return _Lead((found.wanted[0] & ~state, found.wanted[1] & state), number)

    def _left(self, state: int) -> int:
        """How much of the goal does not hold."""
        found = sum([((state ^ goal.value) & goal.mask).bit_count() for goal in self._goals])
        return found + sum(not satisfied(goal, state) for goal in self._others)
