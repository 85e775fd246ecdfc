"""A depth-first search for a policy that attains P*, guided by optimism and a heuristic.

LAO* as improved by Hansen and Zilberstein (2001) with what was learnt since: values are upper bounds, 1 until
something better is known, 0 in dead ends of the delete relaxation; the greedy policy is followed, what it
leads to and was not seen before is expanded, and values are backed up on the way back. Sets of states that
lead to one another and to nothing else (traps) are merged to single states with the choices that leave them
(find, revise, eliminate traps: Kolobov, Mausam, Weld, Geffner 2011). States whose values rest, and whose
choices lead to nothing else but what is settled, are settled and never visited again (labels: Bonet and
Geffner 2003). Of choices only those are looked at that may be best now (in the spirit of CG-iLAO*: Schmalz
and Trevizan 2024).

Values here are floats and only guide; :mod:`bbtc.planner.mdp.bounded_search` proves what was found.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bbtc.planner.mdp.explore import Choices

_EQUAL = 1e-12  # values closer than this count as equal
_REST = 1e-11  # values that move by less are at rest
_SWEEPS = 200  # backups of a set of states in one visit, at most
_AT_ONCE = 16  # states expanded at a time by :meth:`Guided.probe`
_MOST_IDLE = 20  # passes that expand and merge nothing, one after the other
_FAR = 1e4  # what a dead end counts as, in actions

Expand = Callable[[list[int]], Choices]
"""Expand states, given in order; tells what was found."""

Rank = Callable[[Choices], list[int]]
"""For each choice, how little it is advised: of choices that seem as good, those with the least are taken."""


@dataclass(slots=True)
class _Node:
    """An expanded state, or several that are merged: for each choice, probabilities and successors, a bound
    on its value, and its rank; ``chosen`` is the choice that is followed."""

    choices: list[tuple[tuple[float, ...], tuple[int, ...]]]
    bounds: list[float]
    ranks: list[int]
    chosen: int = -1


@dataclass(slots=True)
class _Visit:
    """A state on the way of a depth-first search."""

    state: int
    successors: list[int]
    position: int = 0
    low: int = 0
    open: bool = False
    """May what it leads to change yet?"""


class Guided:
    """The search. States are numbered by what expands them."""

    def __init__(
        self,
        expand: Expand,
        probability: Callable[[], Sequence[float]],
        initial: Sequence[int],
        rank: Rank,
    ) -> None:
        self._expand, self._probability, self.initial = expand, probability, initial
        self._rank = rank
        self.value: list[float] = []
        self.guess: list[float] = []
        self.settled = bytearray()
        self.nodes: dict[int, _Node] = {}
        self._merged: dict[int, int] = {}

    def note(self, guesses: Sequence[float], goals: Sequence[bool]) -> None:
        """Some more states: the guessed actions to the goal, infinite in dead ends, and which are in it."""
        for guess, goal in zip(guesses, goals, strict=True):
            dead = guess == float("inf")
            self.value.append(0.0 if dead else 1.0)
            self.guess.append(0.0 if goal else min(guess, _FAR))
            self.settled.append(dead or goal)

    def run(self, more: Callable[[], bool]) -> bool:
        """Search until all is settled (then the result is True), ``more`` says that it is enough, or values
        change for long and nothing is to be expanded."""
        idle = 0
        while True:
            merged = len(self._merged)
            tips, changed = self._pass()
            if not tips and not changed:
                return all(self.settled[self._of(state)] for state in self.initial)
            idle = 0 if tips or len(self._merged) > merged else idle + 1
            if idle > _MOST_IDLE:
                return False
            while tips:
                if not more():
                    return False
                self._open(tips)
                tips = self._ahead(tips)
            if not more():
                return False

    def bound(self, values: Sequence[float]) -> None:
        """Upper bounds of the first states, known otherwise."""
        lower = map(min, self.value, values)
        self.value[: len(values)] = list(lower)

    def probe(self, more: Callable[[], bool]) -> bool:
        """Expand what the heuristic thinks closest to the goal, whatever the policy is, until a state of the
        goal is found (then the result is True), nothing is left, or ``more`` says that it is enough."""
        known = 0
        heap: list[tuple[float, int]] = []
        while more():
            for state in range(known, len(self.value)):
                if not self.settled[state]:
                    if state not in self.nodes and state not in self._merged:
                        heapq.heappush(heap, (self.guess[state], state))
                elif known and self.value[state]:
                    return True
            known = len(self.value)
            if not heap:
                break
            self._open([heapq.heappop(heap)[1] for _ in range(min(_AT_ONCE, len(heap)))])
        return False

    # --- states ----------------------------------------------------------------------------------

    def _of(self, state: int) -> int:
        """The state that it was merged into."""
        merged = self._merged
        if state not in merged:
            return state
        root = merged[state]
        while root in merged:
            root = merged[root]
        while merged[state] != root:
            merged[state], state = root, merged[state]
        return root

    def _open(self, tips: list[int]) -> None:
        tips.sort()
        found = self._expand(tips)
        for tip in tips:
            self.nodes[tip] = _Node([], [], [])
        probability = self._probability()
        weights = [probability[draw] for draw in found.draw.tolist()]
        successors = found.successor.tolist()
        at = 0
        ranks = self._rank(found)
        for owner, count, rank in zip(found.owner.tolist(), found.edges.tolist(), ranks, strict=True):
            node = self.nodes[owner]
            node.ranks.append(rank)
            node.choices.append((tuple(weights[at : at + count]), tuple(successors[at : at + count])))
            node.bounds.append(1.0)
            at += count
        for tip in tips:
            self._backup(tip)

    def _ahead(self, opened: list[int]) -> list[int]:
        """What is not expanded of where the choices of some states lead."""
        found: dict[int, None] = {}
        for state in opened:
            if not self.settled[state]:
                for after in self._successors(state):
                    if after not in self.nodes and not self.settled[after]:
                        found[after] = None
        return list(found)

    def _successors(self, state: int) -> list[int]:
        node = self.nodes[state]
        if node.chosen < 0:
            return []
        after = node.choices[node.chosen][1]
        return [self._of(each) for each in after] if self._merged else list(after)

    # --- backups ---------------------------------------------------------------------------------

    def _evaluate(self, state: int, choice: tuple[tuple[float, ...], tuple[int, ...]]) -> float:
        total = stays = 0.0
        value = self.value
        for weight, successor in zip(*choice, strict=True):
            after = self._of(successor) if self._merged else successor
            if after == state:
                stays += weight
            else:
                total += weight * value[after]
        return total if not stays else (total / (1 - stays) if stays < 1 - _EQUAL else 0.0)

    def _distance(self, state: int, choice: tuple[tuple[float, ...], tuple[int, ...]]) -> float:
        """How many actions to the goal the heuristic expects."""
        total = stays = 0.0
        for weight, successor in zip(*choice, strict=True):
            after = self._of(successor)
            if after == state:
                stays += weight
            else:
                total += weight * (self.guess[after] if self.value[after] else _FAR)
        return (1 + total) / max(_EQUAL, 1 - stays)

    def _order(self, state: int, node: _Node, number: int) -> tuple[int, float, int]:
        """Sort key of a choice, the first to take first."""
        return node.ranks[number], self._distance(state, node.choices[number]), number

    def _backup(self, state: int) -> bool:
        """Set a state's value to that of its best choice; has anything changed?"""
        node = self.nodes[state]
        bounds = node.bounds
        if not bounds:
            changed = self.value[state] != 0
            self.value[state] = 0.0
            self.settled[state] = 1
            return changed
        chosen = node.chosen
        while True:
            top = max(bounds)
            if chosen < 0 or bounds[chosen] < top - _EQUAL:
                equal = [number for number, bound in enumerate(bounds) if bound >= top - _EQUAL]
                chosen = min(equal, key=lambda each: self._order(state, node, each))
            value = self._evaluate(state, node.choices[chosen])
            if value >= bounds[chosen] - _EQUAL:
                break
            bounds[chosen] = value
        changed = chosen != node.chosen or self.value[state] - bounds[chosen] > _REST
        node.chosen = chosen
        self.value[state] = min(self.value[state], bounds[chosen])
        if self.value[state] <= 0:
            self.settled[state] = 1
        return changed

    # --- passes ----------------------------------------------------------------------------------

    def _pass(self) -> tuple[list[int], bool]:
        """Follow the policy from the initial states, back up what it visits, and settle what may be; what is
        to be expanded, and whether anything changed."""
        self._index: dict[int, int] = {}
        self._stack: list[int] = []
        self._waiting: set[int] = set()
        self._tips: dict[int, None] = {}
        self._changed = False
        for state in map(self._of, self.initial):
            if not self.settled[state] and state not in self._index:
                self._visit(state)
        return list(self._tips), self._changed

    def _visit(self, start: int) -> None:
        path = [self._enter(start)]
        while path:
            visit = path[-1]
            if visit.position < len(visit.successors):
                after = visit.successors[visit.position]
                visit.position += 1
                after = self._of(after)
                if self.settled[after]:
                    continue
                if after in self._index:
                    if after in self._waiting:
                        visit.low = min(visit.low, self._index[after])
                    else:
                        visit.open = True
                    continue
                path.append(self._enter(after))
                continue
            path.pop()
            opened = visit.open
            if visit.low == self._index[visit.state]:
                opened = self._finish(visit)
            elif path:
                path[-1].low = min(path[-1].low, visit.low)
            if path:
                path[-1].open = path[-1].open or opened

    def _enter(self, state: int) -> _Visit:
        number = self._index[state] = len(self._index)
        self._stack.append(state)
        self._waiting.add(state)
        if state not in self.nodes:
            self._tips[state] = None
            return _Visit(state, [], 0, number, True)
        return _Visit(state, self._successors(state), 0, number)

    def _finish(self, visit: _Visit) -> bool:
        """A set of states that lead to one another is complete; may it change yet?"""
        at = len(self._stack) - 1
        while self._stack[at] != visit.state:
            at -= 1
        members = self._stack[at:]
        del self._stack[at:]
        self._waiting.difference_update(members)
        known = [state for state in members if state in self.nodes]
        changed = rest = False
        for _ in range(1 if visit.open else _SWEEPS):
            moved = False
            for state in reversed(known):
                before = self.nodes[state].chosen
                moved = self._backup(state) or moved
                changed = changed or self.nodes[state].chosen != before
            if not moved:
                rest = True
                break
            if changed:
                break
        if visit.open or changed or not rest:
            self._changed = self._changed or changed or (not visit.open and not rest)
            return True
        inside = set(members)
        if all(after in inside for state in members for after in self._successors(state)):
            self._merge(members)
            self._changed = True
            return True
        for state in members:
            self.settled[state] = 1
        return False

    def _merge(self, members: list[int]) -> None:
        """Make one state of a trap."""
        root = members[0]
        inside = set(members)
        node = _Node([], [], [])
        for state in members:
            old = self.nodes[state]
            for choice, bound, rank in zip(old.choices, old.bounds, old.ranks, strict=True):
                if any(self._of(after) not in inside for after in choice[1]):
                    node.choices.append(choice)
                    node.bounds.append(bound)
                    node.ranks.append(rank)
        for state in members[1:]:
            self._merged[state] = root
            del self.nodes[state]
        self.guess[root] = min(self.guess[state] for state in members)
        self.value[root] = min(self.value[state] for state in members)
        self.nodes[root] = node
        self._backup(root)
