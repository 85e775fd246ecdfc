"""Strong cyclic planning: from weak plans and what their steps need to a policy that always gets on.

Every state that the policy may lead to is visited, depth first. Where no pair applies, a weak plan is made,
to the goal or to where the policy applies again, and each of its steps regressed to a pair. Where there is
none, a dead end is learnt from, and what led to it is forbidden. A round in which nothing was added proves
the policy: see :mod:`bbtc.planner.strong_cyclic.visit`.

Sources: Muise, McIlraith, Beck, "Improved non-deterministic planning by exploiting state relevance" (2012);
Muise, McIlraith, Beck, "PRP rebooted: advancing the state of the art in FOND planning" (2024).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from bbtc.belief.state import initial_belief
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.strong_cyclic.dead_ends import DeadEnds
from bbtc.planner.strong_cyclic.determinised import Determinised, Step
from bbtc.planner.strong_cyclic.exclusion import Exclusion
from bbtc.planner.strong_cyclic.partial_state import (
    PartialState,
    contains,
    entails,
    satisfied,
    united,
)
from bbtc.planner.strong_cyclic.policy import Forbidden, Pair, Policy
from bbtc.planner.strong_cyclic.relaxation import Relaxation
from bbtc.planner.strong_cyclic.visit import Node, Visit
from bbtc.planner.strong_cyclic.ways import Exhausted, Taken, WeakPlan
from bbtc.planner.strong_cyclic.weak_plan import Searcher


@dataclass(frozen=True, slots=True)
class Solved:
    """A policy that reaches the goal with probability 1 from every initial state: its pairs, in the order in
    which they are followed; all that was forbidden; the states visited to prove it."""

    pairs: tuple[Pair, ...]
    forbidden: Forbidden
    visited: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Hopeless:
    """No policy reaches the goal with probability 1 from the initial state ``state``."""

    state: int


Answer: TypeAlias = Solved | Hopeless


class Solver:
    """The search for a strong cyclic policy. To make it raises ``LimitReached``."""

    def __init__(self, task: Task, limits: Limits) -> None:
        self.task, self.limits = task, limits
        self.model = Determinised(task, limits)
        self.exclusion = Exclusion(self.model, limits)
        self.relaxation = Relaxation(self.model, self.exclusion, limits)
        self.forbidden = Forbidden()
        self.dead_ends = DeadEnds(self.model, self.exclusion, self.relaxation, self.forbidden)
        self.searcher = Searcher(self.model, self.relaxation, self.forbidden, limits)
        self.policy = Policy(self.forbidden)
        self.strict = False
        """Does every pair say why no later action of its plan is forbidden?"""
        self.initial = [self.model.packing.pack(values) for values in initial_belief(task)]
        self.rounds = 0
        self._proven: set[int] = set()
        """The pairs that, wherever they are followed, lead to explained states by what was seen in this
        round. All are trusted to be, until a round does not bear it out: then they are doubted."""
        self._doubted: set[int] = set()
        self._doubts: list[tuple[int, int]] = []

    def run(self) -> Answer:
        """Rounds until one changes nothing. Raises ``LimitReached``."""
        while True:
            self.rounds += 1
            forbidden, pairs = self.forbidden.count, len(self.policy.pairs)
            self._proven = set()
            visit = Visit(self)
            for state in self.initial:
                if not visit.all_from(state):
                    return Hopeless(state)
            if self.forbidden.count != forbidden:
                self._afresh()
            elif len(self.policy.pairs) == pairs:
                used = {node.choice for node in visit.nodes.values() if node.why_final is None}
                if self._doubt(used - self._proven):
                    continue
                if not visit.trapped and (self.strict or used <= self._doubted or self._closer(visit)):
                    self.policy.keep(used)
                    return self._solved(visit)
                if self.strict:
                    raise AssertionError("a policy whose pairs lead ever closer to the goal is trapped")
                self.strict = True
                self._afresh()

    def leave_out(self, state: int) -> None:
        """Search for a policy from the other initial states only, by all that was learnt."""
        self.initial.remove(state)
        self._afresh()

    def _doubt(self, pairs: set[int]) -> bool:
        """Some pairs were not settled; True if they were trusted to be."""
        wrong = pairs - self._doubted
        if wrong:
            self._doubted |= wrong
            self._doubts = sorted(map(self.policy.order, self._doubted))
        return bool(wrong)

    def _afresh(self) -> None:
        """Forget the policy, now that more is forbidden: it might lead there in roundabout ways."""
        self.policy = Policy(self.forbidden)
        self._doubted, self._doubts = set(), []
        self.searcher.forget()

    def _closer(self, visit: Visit) -> bool:
        """Does every choice lead closer to the goal by one of its steps, whatever settled pair is followed
        on the way?"""

        def distance(node: Node) -> int:
            return 0 if node.why_final is not None else self.policy.pairs[node.choice].distance

        return all(
            any(
                distance(visit.nodes[visit.representative(target)]) < distance(node)
                for _, target in node.edges
            )
            for node in visit.nodes.values()
            if node.why_final is None
        )

    def _solved(self, visit: Visit) -> Solved:
        pairs = tuple(self.policy.pairs[number] for number in self.policy)
        return Solved(pairs, self.forbidden, tuple(visit.nodes))

    # --- what a visit asks ----------------------------------------------------------------------

    def final(self, state: int) -> PartialState | None:
        """Why a state is in the goal, if it is."""
        goal = self.model.goal
        return self.model.reasons.why(goal, state) if satisfied(goal, state) else None

    def action(self, choice: int) -> int:
        """The number of the action of a pair."""
        return self.policy.pairs[choice].action

    def blame(self, state: int, choice: int, step: Step, dead: int) -> None:
        """Forbid what led to a dead end."""
        why = self.dead_ends.known.first(dead)
        assert why is not None
        self.dead_ends.blame(Taken(state, self.action(choice), step), why)

    # --- plans ----------------------------------------------------------------------------------

    def arrived(self, state: int) -> bool:
        """Is a state in the goal, or does the policy say what to do?"""
        return satisfied(self.model.goal, state) or self.policy.decide(state) is not None

    def decide(self, state: int) -> int | None:
        """The number of the pair for a state, made if need be; None for a dead end."""
        while True:
            number = self.policy.decide(state)
            if number is not None:
                return number
            if self.dead_ends.known.first(state) is not None:
                return None
            found = self.searcher.search(state, self.arrived, self.dead_ends.of_relaxation)
            match found:
                case WeakPlan():
                    self._add_pairs(found)
                case Exhausted():
                    if self.searcher.estimate_anew(state) is None:
                        self.dead_ends.of_relaxation(state, None)
                    else:
                        self.dead_ends.of_search(found, state)
                    return None

    def _add_pairs(self, plan: WeakPlan) -> None:
        """Each step of a plan, regressed to what it needs."""
        number = None
        if satisfied(self.model.goal, plan.end):
            wanted, distance = self.model.reasons.why(self.model.goal, plan.end), 0
        else:
            number = self.policy.decide(plan.end)
            if number is None:
                return  # what led there was forbidden meanwhile
            pair = self.policy.pairs[number]
            wanted, distance = pair.partial, pair.distance
        for taken in reversed(plan.steps):
            wanted, distance = self._regressed(taken, wanted), distance + 1
            self.policy.add(Pair(wanted, taken.action, distance))

    def _regressed(self, taken: Taken, wanted: PartialState) -> PartialState:
        found = self.model.needed(taken.action, taken.step, taken.state, wanted)
        if self.strict:
            found = self._allowed(found, taken.state, taken.action)
        return self.exclusion.shortest(found)

    def _allowed(self, partial: PartialState, state: int, action: int) -> PartialState:
        """With enough for an action not to be forbidden that is not in the state."""
        against = [each for each in self.forbidden.of_action.get(action, ()) if not contains(each, state)]
        return self.exclusion.refuting(self.model.reasons, against, state, partial)

    # --- why ------------------------------------------------------------------------------------

    def why(self, state: int, choice: int) -> PartialState:
        """Enough for a pair to apply, and its action not to be forbidden."""
        pair = self.policy.pairs[choice]
        return self._allowed(pair.partial, state, pair.action)

    def alone(self, state: int, choice: int, known: PartialState) -> PartialState:
        """With enough for no doubted pair of another action to come before a pair."""
        pair, last = self.policy.pairs[choice], self.policy.order(choice)
        against: list[PartialState] = []
        for order in self._doubts:
            if order >= last:
                break
            other = self.policy.pairs[order[1]]
            if other.action == pair.action:
                continue
            if not contains(other.partial, state):
                against.append(other.partial)
                continue
            reason = self.forbidden.forbids(state, other.action)
            if reason is not None:
                known = united(known, reason)
            # Else it was added since the state was decided: this round is not the last one.
        return self.exclusion.refuting(self.model.reasons, against, state, known)

    def note(self, choice: int, needed: PartialState) -> None:
        """A pair is settled if what it needs implies what its steps need."""
        if choice not in self._proven and entails(
            self.exclusion.closed(self.policy.pairs[choice].partial), needed
        ):
            self._proven.add(choice)
