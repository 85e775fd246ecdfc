"""Strong cyclic planning: from weak plans and what their steps need to a policy that always gets on.

Every state that the policy may lead to is visited, depth first. Where no pair applies, a weak plan is made, to the
goal or to where the policy applies again, and each of its steps regressed to a pair. Where there is none, a dead end
is learnt from, and what led to it is forbidden. A round in which nothing was added proves the policy: see
:mod:`bbtc.planner.strong_cyclic.proof`.

Sources: Muise, McIlraith, Beck, "Improved non-deterministic planning by exploiting state relevance" (2012);
Muise, McIlraith, Beck, "PRP rebooted: advancing the state of the art in FOND planning" (2024).
"""

from __future__ import annotations

from dataclasses import dataclass, field
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
    contradict,
    satisfied,
    united,
)
from bbtc.planner.strong_cyclic.policy import Covers, Forbidden, Pair, Policy
from bbtc.planner.strong_cyclic.relaxation import Relaxation
from bbtc.planner.strong_cyclic.weak_plan import Exhausted, Searcher, Taken, WeakPlan


@dataclass(slots=True)
class _Node:
    """A visited state. ``pair`` is the number of the pair followed; ``edges`` are its steps and what they lead
    to, looked at up to ``position``. ``why`` is enough for the policy to get from a state to the goal for sure,
    once that is known."""

    state: int
    index: int
    low: int
    pair: int = -1
    edges: list[tuple[Step, int]] = field(default_factory=list)
    position: int = 0
    waiting: bool = True
    lost: bool = False
    why: PartialState | None = None


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

    def run(self) -> Answer:
        """Rounds until one changes nothing. Raises ``LimitReached``."""
        while True:
            self.rounds += 1
            forbidden, pairs = self.forbidden.count, len(self.policy.pairs)
            visit = _Visit(self)
            for state in self.initial:
                if not visit.all_from(state):
                    return Hopeless(state)
            if self.forbidden.count != forbidden:
                self._afresh()
            elif len(self.policy.pairs) == pairs:
                if not visit.trapped:
                    return self._solved(visit)
                if self.strict:
                    raise AssertionError("a policy whose pairs lead ever closer to the goal is trapped")
                self.strict = True
                self._afresh()

    def _afresh(self) -> None:
        """Forget the policy, now that more is forbidden: it might lead there in roundabout ways."""
        self.policy = Policy(self.forbidden)
        self.searcher.forget()

    def _solved(self, visit: _Visit) -> Solved:
        used = {node.pair for node in visit.nodes.values() if node.pair >= 0}
        pairs = tuple(self.policy.pairs[number] for number in self.policy if number in used)
        return Solved(pairs, self.forbidden, tuple(visit.nodes))

    # --- plans ----------------------------------------------------------------------------------

    def arrived(self, state: int) -> bool:
        """Is a state in the goal, or does the policy say what to do?"""
        return satisfied(self.model.goal, state) or self.policy.decide(state) is not None

    def decided(self, state: int) -> int | None:
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
                    if found.seen:
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
        for each in self.forbidden.of_action.get(action, ()):
            if contains(each, state):
                continue
            known = self.exclusion.closed(partial)
            if not contradict(each, known):
                partial = united(partial, self.model.reasons.differs(each, state, known.mask))
        return partial

    # --- why ------------------------------------------------------------------------------------

    def why_followed(self, state: int, number: int) -> PartialState:
        """Enough for the policy to start the same action as by a pair in a state."""
        pair = self.policy.pairs[number]
        found = self._allowed(pair.partial, state, pair.action)
        known = self.exclusion.closed(found)
        last = self.policy.order(number)
        for other_number, other in enumerate(self.policy.pairs):
            if other.action == pair.action or self.policy.order(other_number) > last:
                continue
            if contradict(known, other.partial):
                continue
            reason = None
            if contains(other.partial, state):
                reason = self.forbidden.forbids(state, other.action)
            if reason is None:
                reason = self.model.reasons.differs(other.partial, state, known.mask)
            found = united(found, reason)
            known = self.exclusion.closed(found)
        return found


class _Visit:
    """One round: all states that the policy leads to, but for those of which it is known already that they satisfy
    what got others to the goal."""

    def __init__(self, solver: Solver) -> None:
        self.solver = solver
        self.model, self.exclusion, self.policy = solver.model, solver.exclusion, solver.policy
        self.nodes: dict[int, _Node] = {}
        self.proven = Covers()
        self.trapped = False
        self._stack: list[_Node] = []

    def all_from(self, start: int) -> bool:
        """Visit what can be reached from a state; False if it is a dead end."""
        if start in self.nodes:
            return not self.nodes[start].lost
        if self.proven.first(start) is not None:
            return True
        path = [self._enter(start)]
        while path:
            node = path[-1]
            if node.position < len(node.edges):
                step, target = node.edges[node.position]
                known = self.nodes.get(target)
                if known is None:
                    if self.proven.first(target) is None:
                        path.append(self._enter(target))
                        continue
                elif known.lost:
                    self._blame(node, step, target)
                    continue
                elif known.waiting:
                    node.low = min(node.low, known.index)
                node.position += 1
                continue
            path.pop()
            if path:
                path[-1].low = min(path[-1].low, node.low)
            if node.low == node.index:
                self._finish(node)
        return not self.nodes[start].lost

    def _enter(self, state: int) -> _Node:
        self.solver.limits.check_states(len(self.nodes), "the search for a policy")
        node = self.nodes[state] = _Node(state, len(self.nodes), len(self.nodes))
        self._stack.append(node)
        if satisfied(self.model.goal, state):
            node.why = self.model.reasons.why(self.model.goal, state)
        else:
            self._decide(node)
        return node

    def _decide(self, node: _Node) -> None:
        """Follow the policy from a state, from now on."""
        number = self.solver.decided(node.state)
        node.position = 0
        if number is None:
            node.lost, node.edges = True, []
            return
        node.pair = number
        steps = self.model.actions[self.policy.pairs[number].action].steps
        node.edges = [(step, step.apply(node.state)) for step in steps]

    def _blame(self, node: _Node, step: Step, target: int) -> None:
        """A step leads to a dead end: it is forbidden, and something else done."""
        dead_ends = self.solver.dead_ends
        dead = dead_ends.known.first(target)
        assert dead is not None
        dead_ends.blame(Taken(node.state, self.policy.pairs[node.pair].action, step), dead)
        self._decide(node)

    def _finish(self, root: _Node) -> None:
        """A set of states that all lead to one another is complete: what of them gets to the goal?"""
        at = self._stack.index(root) if self._stack[-1] is not root else len(self._stack) - 1
        members = self._stack[at:]
        del self._stack[at:]
        for node in members:
            node.waiting = False
        if any(node.lost for node in members):
            return
        inside = {node.state for node in members}
        back: dict[int, list[int]] = {}
        arriving: list[int] = []
        for node in members:
            if node.why is not None or any(target not in inside for _, target in node.edges):
                arriving.append(node.state)
            for _, target in node.edges:
                back.setdefault(target, []).append(node.state)
        reached = set(arriving)
        while arriving:
            for source in back.get(arriving.pop(), ()):
                if source not in reached:
                    reached.add(source)
                    arriving.append(source)
        if len(reached) < len(members):
            self.trapped = True
            return
        self._explain(members)

    def _explain(self, members: list[_Node]) -> None:
        """Enough for all of it, for each of some states that lead to one another and to proven ones."""
        for node in members:
            if node.why is None:
                node.why = self.solver.why_followed(node.state, node.pair)
        moved = True
        while moved:
            moved = False
            for node in reversed(members):
                found = node.why
                assert found is not None
                for step, target in node.edges:
                    ahead = self._ahead(target)
                    if ahead is None:  # trapped there
                        continue
                    found = united(found, self.model.before(step, node.state, ahead, found.mask))
                if found != node.why:
                    node.why, moved = found, len(members) > 1
        for node in members:
            assert node.why is not None
            node.why = self.exclusion.shortest(node.why)
            self.proven.add(node.why)

    def _ahead(self, target: int) -> PartialState | None:
        node = self.nodes.get(target)
        if node is not None:
            return node.why
        return self.proven.first(target)
