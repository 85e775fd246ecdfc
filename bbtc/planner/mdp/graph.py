"""Qualitative reachability in a Markov decision process, which needs no numbers: where the best probability
of reaching the goal is 0 (prob-0), where it is 1 (prob-1), and the maximal end components, sets of states in
which a policy can stay for ever.

Source: Baier and Katoen, "Principles of Model Checking" (2008), section 10.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bbtc.markov import components
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Number, StateSpace, ranges
from bbtc.planner.mdp.transitions import Index

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Reached:
    """Result of a backward search. ``depth[s]`` is how many choices of ``via`` it takes at least to
    be in the goals (0 there, -1 where they cannot be reached); ``via[s]`` is the first choice that
    may lead one step closer, -1 where there is none or none is needed."""

    depth: Number
    via: Number

    @property
    def found(self) -> Flags:
        """The states that can reach the goals."""
        return self.depth >= 0


class Graph:
    """A state space with its edges sorted by successor, too."""

    def __init__(self, space: StateSpace) -> None:
        self.space = space
        self.states = len(space.states)
        self.choices = len(space.choice_action)
        self.choice_state = space.choice_state
        self.edge_choice = space.edge_choice
        order = np.argsort(space.edge_successor, kind="stable")
        self._into: Number = self.edge_choice[order]
        counts = np.bincount(space.edge_successor, minlength=self.states)
        self._into_first: Index = np.concatenate(([0], np.cumsum(counts)))

    def reach(self, goals: Flags, allowed: Flags | None = None, ahead: Number | None = None) -> Reached:
        """What may reach the goals by allowed choices (all by default); the rest is prob-0. ``ahead`` tells
        how many steps each goal counts for itself; 0 by default."""
        depth = np.full(self.states, -1, dtype=np.int32)
        via = np.full(self.states, -1, dtype=np.int32)
        waiting = np.flatnonzero(goals)
        if ahead is not None:
            waiting = waiting[np.argsort(ahead[waiting], kind="stable")]
            due, first = np.unique(ahead[waiting], return_index=True)
            levels = dict(zip(due.tolist(), np.split(waiting, first[1:]), strict=True))
        else:
            levels = {0: waiting}
        frontier: Index | Number = np.empty(0, dtype=np.int64)
        step = 0
        while len(frontier) or levels:
            if not len(frontier):
                step = min(levels)
            if step in levels:
                fresh = levels.pop(step)
                fresh = fresh[depth[fresh] < 0]
                depth[fresh] = step
                frontier = np.concatenate([frontier, fresh])
            step += 1
            firsts = self._into_first[frontier]
            choices = self._into[ranges(firsts, self._into_first[frontier + 1] - firsts)]
            if allowed is not None:
                choices = choices[allowed[choices]]
            choices = choices[depth[self.choice_state[choices]] < 0]
            choices.sort()
            states = self.choice_state[choices]
            # Choices are ordered by state: the lowest of each state stands first.
            lowest = np.ones(len(states), dtype=np.bool_)
            np.not_equal(states[1:], states[:-1], out=lowest[1:])
            frontier = states[lowest]
            via[frontier] = choices[lowest]
            depth[frontier] = step
        return Reached(depth, via)

    def into(self, states: Flags) -> Flags:
        """Choices with an edge into a set of states."""
        hit = np.zeros(self.choices, dtype=np.bool_)
        hit[self.edge_choice[states[self.space.edge_successor]]] = True
        return hit

    def prob_1(self, goals: Flags, some: Reached | None = None) -> Reached:
        """Where the goals can be reached with probability 1, with choices that do so and never leave that
        set: a strong cyclic policy (Cimatti et al. 2003). ``some`` is what :meth:`reach` finds for the
        goals, if that is known."""
        reached = self.reach(goals) if some is None else some
        while True:
            lost = ~reached.found
            safe = ~self.into(lost)
            again = self.reach(goals, safe)
            if (again.found == reached.found).all():
                return again
            reached = again

    def end_components(self, staying: Flags) -> list[list[int]]:
        """Maximal end components: sets of states in which a policy can stay for ever by choices of
        ``staying`` (it must be able to reach all of the set from all of it)."""
        staying = staying.copy()
        while True:
            # Drop choices that may lead where there is no such choice, until none is left.
            has = self.space.having(staying)
            dropped = staying & self.into(~has)
            if dropped.any():
                staying &= ~dropped
                continue
            members = np.flatnonzero(has)
            if not len(members):
                return []
            number = np.full(self.states, -1, dtype=np.int64)
            number[members] = np.arange(len(members))
            edges = staying[self.edge_choice]
            sources = self.choice_state[self.edge_choice[edges]]
            after = self.space.edge_successor[edges]
            successors: list[list[int]] = [[] for _ in members]
            for source, successor in zip(number[sources].tolist(), number[after].tolist(), strict=True):
                successors[source].append(successor)
            found = components(successors)
            component = np.full(self.states, -1, dtype=np.int64)
            for position, group in enumerate(found):
                component[members[group]] = position
            across = component[sources] != component[after]
            if not across.any():
                return sorted(sorted(int(members[m]) for m in group) for group in found)
            staying[self.edge_choice[edges][across]] = False


def sums(owners: Index | Number, weights: Floats, count: int) -> Floats:
    """For each of ``count`` owners, the sum of its weights."""
    return np.bincount(owners, weights=weights, minlength=count).astype(np.float64, copy=False)


def draw_probabilities(space: StateSpace) -> Floats:
    """The probability of each edge."""
    table = np.array([float(draw.probability) for draw in space.draws] or [0.0])
    found: Floats = table[space.edge_draw]
    return found
