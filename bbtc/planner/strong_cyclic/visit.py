"""All states that decisions lead to, where states that are alike in all that matters are visited once.

States are visited depth first. When all states that some states lead to are done, each of them is
explained: what of it is enough for the same actions to be started from there on, whatever their outcomes.
Any other state that satisfies such an explanation, by the same action and outcomes, gets to states that
satisfy the explanations of those this one gets to; so it need not be visited.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from bbtc.limits import Limits
from bbtc.planner.strong_cyclic.determinised import Determinised, Step
from bbtc.planner.strong_cyclic.exclusion import Exclusion
from bbtc.planner.strong_cyclic.partial_state import ANY_STATE, PartialState, united
from bbtc.planner.strong_cyclic.policy import Covers

_STATES_AT_ONCE = 16  # between two looks at the time


class Decisions(Protocol):
    """What to do in each state, and why."""

    model: Determinised
    exclusion: Exclusion
    limits: Limits

    def final(self, state: int) -> PartialState | None:
        """Enough for nothing to be started in a state, where that is so."""
        ...

    def decide(self, state: int) -> int | None:
        """The number of a choice in a state that is not final; None if it is a dead end."""
        ...

    def action(self, choice: int) -> int:
        """The number of the action that a choice starts."""
        ...

    def why(self, state: int, choice: int) -> PartialState:
        """Enough for the same action to be started as in a state, but for what :meth:`alone` adds."""
        ...

    def alone(self, state: int, choice: int, known: PartialState) -> PartialState:
        """``known``, which holds in a state, with enough for nothing to be decided there but this choice, or
        others whose steps lead to explained states wherever they are taken."""
        ...

    def note(self, choice: int, needed: PartialState) -> None:
        """Where a choice is taken and ``needed`` holds, its steps lead to explained states."""
        ...

    def blame(self, state: int, choice: int, step: Step, dead: int) -> None:
        """A step of a choice leads to a dead end; :meth:`decide` must decide otherwise from now on."""
        ...


@dataclass(slots=True)
class Node:
    """A visited state. ``choice`` is what was decided; ``edges`` are the steps of its action and what they
    lead to, looked at up to ``position``. ``why`` explains it, ``why_final`` why nothing is started."""

    state: int
    index: int
    low: int
    choice: int = -1
    edges: list[tuple[Step, int]] = field(default_factory=list)
    position: int = 0
    waiting: bool = True
    lost: bool = False
    why_final: PartialState | None = None
    why: PartialState | None = None


class Visit:
    """One visit. ``explained`` are the explanations found, and ``owners`` the states that they are of;
    ``trapped`` tells whether there are states from which decisions never lead to a final one."""

    def __init__(self, decisions: Decisions) -> None:
        self.decisions = decisions
        self.model, self.exclusion = decisions.model, decisions.exclusion
        self.nodes: dict[int, Node] = {}
        self.explained = Covers()
        self.owners: list[int] = []
        self.trapped = False
        self._stack: list[Node] = []

    def representative(self, state: int) -> int:
        """The visited state that a state is like."""
        if state in self.nodes:
            return state
        found = self.explained.number(state)
        assert found is not None
        return self.owners[found]

    def all_from(self, start: int) -> bool:
        """Visit what can be reached from a state; False if it is a dead end."""
        if start in self.nodes:
            return not self.nodes[start].lost
        if self.explained.number(start) is not None:
            return True
        path = [self._enter(start)]
        while path:
            node = path[-1]
            if node.position < len(node.edges):
                step, target = node.edges[node.position]
                known = self.nodes.get(target)
                if known is None:
                    if self.explained.number(target) is None:
                        path.append(self._enter(target))
                        continue
                elif known.lost:
                    self.decisions.blame(node.state, node.choice, step, target)
                    self._decide(node)
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

    def _enter(self, state: int) -> Node:
        limits = self.decisions.limits
        limits.check_states(len(self.nodes), "the search for a policy")
        if len(self.nodes) % _STATES_AT_ONCE == 0:
            limits.check_time("the search for a policy", len(self.nodes))
        node = self.nodes[state] = Node(state, len(self.nodes), len(self.nodes))
        self._stack.append(node)
        node.why = node.why_final = self.decisions.final(state)
        if node.why is None:
            self._decide(node)
        return node

    def _decide(self, node: Node) -> None:
        number = self.decisions.decide(node.state)
        node.position = 0
        if number is None:
            node.lost, node.edges = True, []
            return
        node.choice = number
        steps = self.model.actions[self.decisions.action(number)].steps
        node.edges = [(step, step.apply(node.state)) for step in steps]

    def _finish(self, root: Node) -> None:
        """A set of states that all lead to one another is complete."""
        at = len(self._stack) - 1
        while self._stack[at] is not root:
            at -= 1
        members = self._stack[at:]
        del self._stack[at:]
        for node in members:
            node.waiting = False
        if any(node.lost for node in members):
            return
        self.trapped = self.trapped or not _leaves(members)
        self._explain(members)

    def _explain(self, members: list[Node]) -> None:
        taken = [node for node in members if node.why_final is None]
        for node in taken:
            node.why = self.decisions.why(node.state, node.choice)
        self._spread(members)
        for node in taken:
            assert node.why is not None
            node.why = self.decisions.alone(node.state, node.choice, node.why)
        self._spread(members)
        for node in members:
            assert node.why is not None
            node.why = self.exclusion.shortest(node.why)
            self.explained.add(node.why)
            self.owners.append(node.state)
        for node in taken:
            self.decisions.note(node.choice, self._before(node, ANY_STATE))

    def _spread(self, members: list[Node]) -> None:
        """What is needed of states for those that they lead to to be explained."""
        moved = True
        while moved:
            moved = False
            for node in reversed(members):
                assert node.why is not None
                found = self._before(node, node.why)
                if found != node.why:
                    node.why, moved = found, len(members) > 1

    def _before(self, node: Node, known: PartialState) -> PartialState:
        """``known`` with enough for the steps of a state to lead to explained ones."""
        for step, target in node.edges:
            ahead = self._ahead(target)
            if ahead is not None:  # else it has a dead end among those around it
                known = united(known, self.model.before(step, node.state, ahead, known.mask))
        return known

    def _ahead(self, target: int) -> PartialState | None:
        known = self.nodes.get(target)
        if known is not None:
            return known.why
        found = self.explained.first(target)
        assert found is not None
        return found


def _leaves(members: list[Node]) -> bool:
    """Can decisions lead from each of some states, that lead to one another, out of them or to a final
    one?"""
    inside = {node.state for node in members}
    back: dict[int, list[int]] = {}
    leaving: list[int] = []
    for node in members:
        if node.why_final is not None or any(target not in inside for _, target in node.edges):
            leaving.append(node.state)
        for _, target in node.edges:
            back.setdefault(target, []).append(node.state)
    reached = set(leaving)
    while leaving:
        for source in back.get(leaving.pop(), ()):
            if source not in reached:
                reached.add(source)
                leaving.append(source)
    return len(reached) == len(members)
