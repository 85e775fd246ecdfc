"""Dead ends, and what must not be done because it may lead to one.

A dead end is a state from which no strong cyclic policy reaches the goal. What is known of one holds for
every state that satisfies a partial state of it; regressed through every action that may lead there, it
becomes pairs of partial state and action that are forbidden. Source: Muise, McIlraith, Beck, "Improved
non-deterministic planning by exploiting state relevance" (2012).
"""

from __future__ import annotations

from bbtc.planner.strong_cyclic.determinised import Action, Determinised, Step
from bbtc.planner.strong_cyclic.exclusion import Exclusion
from bbtc.planner.strong_cyclic.partial_state import (
    PartialState,
    contradict,
    literals,
    satisfied,
    united,
    without,
)
from bbtc.planner.strong_cyclic.policy import Covers, Forbidden
from bbtc.planner.strong_cyclic.relaxation import Relaxation
from bbtc.planner.strong_cyclic.ways import Exhausted, Taken

_MOST_WORK = 200_000  # states times actions that are gone through to generalise an exhausted search
_MOST_TOLD = 16  # states of an exhausted search that others learn from


class DeadEnds:
    """What is known of the dead ends of a task; ``forbidden`` and ``relaxation`` learn with it."""

    def __init__(
        self, model: Determinised, exclusion: Exclusion, relaxation: Relaxation, forbidden: Forbidden
    ) -> None:
        self.model, self.exclusion = model, exclusion
        self.relaxation, self.forbidden = relaxation, forbidden
        self.known = Covers()
        self._makers: dict[tuple[int, int], list[tuple[Action, Step]]] = {}
        for action in model.actions:
            for step in action.steps:
                if not step.guarded:
                    for variable, value in step.sets:
                        self._makers.setdefault((variable, int(value)), []).append((action, step))

    def of_relaxation(self, state: int, taken: Taken | None) -> None:
        """Learn from a state from which the goal is out of reach in the relaxation."""
        found = self.known.first(state)
        if found is None:
            found = self.relaxation.generalised(state)
            self._learn(found)
        if taken is not None:
            self.blame(taken, found)

    def of_search(self, exhausted: Exhausted, start: int) -> None:
        """Learn from a state from which an exhaustive search found no way."""
        found = self._generalised(exhausted)
        told = sorted(found, key=lambda state: (state != start, found[state].mask.bit_count()))
        for state in told[:_MOST_TOLD]:
            if self.known.first(state) is None:
                self._learn(found[state])

    def blame(self, taken: Taken, dead: PartialState) -> None:
        """Forbid the step that led to a dead end, where it leads to one for the same reason."""
        before = self.model.before(taken.step, taken.state, dead)
        self._forbid(before, self.model.actions[taken.action])

    def _learn(self, dead: PartialState) -> None:
        """Forbid every action with an outcome that leads there for sure."""
        self.known.add(dead)
        tried: dict[tuple[int, Step], None] = {}
        for literal in literals(self.model.packing, dead):
            variable = self.model.packing.owner((literal.mask & -literal.mask).bit_length() - 1)
            for value in (0, 1, 2):
                for action, step in self._makers.get((variable, value), ()):
                    if (action.number, step) in tried:
                        continue
                    tried[action.number, step] = None
                    changed = ~step.keep
                    if (step.set ^ dead.value) & changed & dead.mask or not changed & dead.mask:
                        continue
                    after = PartialState(dead.mask | changed, dead.value | step.set)
                    if self.exclusion.possible(after):
                        self._forbid(without(dead, changed), action)

    def _forbid(self, before: PartialState, action: Action) -> None:
        if action.needs is not None:
            needs = [
                need
                for need in action.needs
                if not contradict(need, before) and self.exclusion.possible(united(need, before))
            ]
            if not needs:
                return
            if len(action.needs) == 1:
                before = without(before, self.exclusion.closed(needs[0]).mask)
        before = self.exclusion.shortest(before)
        if not self.forbidden.add(before, action.number):
            return
        self.relaxation.forbid(action.number, before)

    def _generalised(self, exhausted: Exhausted) -> dict[int, PartialState]:
        """For states of an exhausted search, enough for the search to find nothing."""
        limits = self.relaxation.limits
        model, seen = self.model, exhausted.seen
        if len(seen) * len(model.actions) > _MOST_WORK:
            full = sum(model.packing.bits(variable) for variable in range(len(model.packing.unknown)))
            return {state: self.exclusion.shortest(PartialState(full, state)) for state in seen[:1]}
        why: dict[int, PartialState] = {}
        for state in seen:
            why[state] = self._no_way(state)
        moved = True
        while moved:
            moved = False
            for state in reversed(seen):
                limits.check_time("the search for a policy")
                found = why[state]
                for number in model.applicable(state):
                    if self.forbidden.forbids(state, number) is None:
                        for step in model.actions[number].steps:
                            after = step.apply(state)
                            ahead = why.get(after) or self.known.first(after)
                            assert ahead is not None
                            found = united(found, model.before(step, state, ahead, found.mask))
                if found != why[state]:
                    why[state] = found
                    moved = True
        return {state: self.exclusion.shortest(found) for state, found in why.items()}

    def _no_way(self, state: int) -> PartialState:
        """Why a state is not in the goal, and the actions that may not start in it may not."""
        model = self.model
        found = model.reasons.why_not(model.goal, state)
        idle: list[PartialState] = []
        others: list[Action] = []
        for action in model.actions:
            reason = self.forbidden.forbids(state, action.number)
            if satisfied(action.test, state):
                if reason is not None:
                    found = united(found, reason)
            elif reason is not None and not reason.mask:
                continue
            elif action.needs is None:
                others.append(action)
            else:
                idle.extend(action.needs)
        found = self.exclusion.refuting(model.reasons, idle, state, found)
        for action in others:
            known = self.exclusion.closed(found).mask
            found = united(found, model.reasons.why_not(action.test, state, known))
        return found
