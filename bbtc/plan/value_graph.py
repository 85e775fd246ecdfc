"""Graph questions about a state space that need no numbers: what can reach the goal, what can
reach it for sure, and in which sets of states a policy can stay for ever.

Source: Baier and Katoen, "Principles of Model Checking" (2008), section 10.6 (the sets where the
maximal probability is 0 or 1, and end components).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bbtc.belief.absorption import components
from bbtc.plan.space import StateSpace
from bbtc.plan.space_actions import Index
from bbtc.plan.space_packing import Flags

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Reached:
    """Result of a backward search. ``depth[s]`` is how many choices of ``via`` it takes at least to
    be in the targets (0 there, -1 where they cannot be reached); ``via[s]`` is the first choice that
    may lead one step closer, -1 where there is none or none is needed."""

    depth: npt.NDArray[np.int32]
    via: Index

    @property
    def found(self) -> Flags:
        """The states that can reach the targets."""
        return self.depth >= 0


class Graph:
    """A state space with its edges sorted by target, too."""

    def __init__(self, space: StateSpace) -> None:
        self.space = space
        self.states = len(space.states)
        self.choices = len(space.choice_action)
        counts = np.diff(space.choice_first)
        self.choice_state: Index = np.repeat(np.arange(self.states), counts)
        """The state of each choice."""
        self.edge_choice: Index = np.repeat(np.arange(self.choices), np.diff(space.edge_first))
        """The choice of each edge."""
        order = np.argsort(space.edge_target, kind="stable")
        self._into: Index = self.edge_choice[order]
        counts = np.bincount(space.edge_target, minlength=self.states)
        self._into_first: Index = np.concatenate(([0], np.cumsum(counts)))

    def reach(self, targets: Flags, allowed: Flags | None = None) -> Reached:
        """What may reach the targets by allowed choices (all by default)."""
        depth = np.where(targets, 0, -1).astype(np.int32)
        via = np.full(self.states, -1, dtype=np.int64)
        frontier = np.flatnonzero(targets)
        step = 0
        while len(frontier):
            step += 1
            choices = self._into[
                ranges(
                    self._into_first[frontier], self._into_first[frontier + 1] - self._into_first[frontier]
                )
            ]
            if allowed is not None:
                choices = choices[allowed[choices]]
            choices = choices[depth[self.choice_state[choices]] < 0]
            states = self.choice_state[choices]
            # The lowest choice of each state wins, whatever the order of the edges.
            order = np.argsort(choices, kind="stable")[::-1]
            via[states[order]] = choices[order]
            depth[states] = step
            frontier = np.unique(states)
        return Reached(depth, via)

    def into(self, states: Flags) -> Flags:
        """Choices with an edge into a set of states."""
        hit = np.zeros(self.choices, dtype=np.bool_)
        hit[self.edge_choice[states[self.space.edge_target]]] = True
        return hit

    def surely(self, targets: Flags) -> Reached:
        """Where the targets can be reached with probability 1, with choices that do so and never
        leave that set."""
        reached = self.reach(targets)
        while True:
            lost = ~reached.found
            safe = ~self.into(lost)
            again = self.reach(targets, safe)
            if (again.found == reached.found).all():
                return again
            reached = again

    def end_components(self, staying: Flags) -> list[list[int]]:
        """Maximal sets of states in which a policy can stay for ever by choices of ``staying``
        (it must be able to reach all of the set from all of it)."""
        staying = staying.copy()
        while True:
            # Drop choices that may lead where there is no such choice, until none is left.
            has = np.zeros(self.states, dtype=np.bool_)
            has[self.choice_state[staying]] = True
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
            targets = self.space.edge_target[edges]
            successors: list[list[int]] = [[] for _ in members]
            for source, target in zip(number[sources].tolist(), number[targets].tolist(), strict=True):
                successors[source].append(target)
            found = components(successors)
            component = np.full(self.states, -1, dtype=np.int64)
            for position, group in enumerate(found):
                component[members[group]] = position
            across = component[sources] != component[targets]
            if not across.any():
                return sorted(sorted(int(members[m]) for m in group) for group in found)
            staying[self.edge_choice[edges][across]] = False


def sums(owners: Index, weights: Floats, count: int) -> Floats:
    """For each of ``count`` owners, the sum of its weights."""
    return np.bincount(owners, weights=weights, minlength=count).astype(np.float64, copy=False)


def ranges(firsts: Index, counts: Index) -> Index:
    """The concatenation of ``range(first, first + count)`` over all pairs."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    found: Index = np.arange(total) + np.repeat(firsts - (ends - counts), counts)
    return found
