"""Graph questions about a state space that need no numbers: what can reach the goal, what can
reach it for sure, and in which sets of states a policy can stay for ever.

Source: Baier and Katoen, "Principles of Model Checking" (2008), section 10.6 (the sets where the
maximal probability is 0 or 1, and end components).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bbtc.markov import components
from bbtc.planner.mdp.explore import StateSpace, ranges
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.transitions import Index

Floats = npt.NDArray[np.float64]
Number = npt.NDArray[np.int32]
"""Numbers of states or choices."""


@dataclass(frozen=True, slots=True)
class Reached:
    """Result of a backward search. ``depth[s]`` is how many choices of ``via`` it takes at least to
    be in the targets (0 there, -1 where they cannot be reached); ``via[s]`` is the first choice that
    may lead one step closer, -1 where there is none or none is needed."""

    depth: Number
    via: Number

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
        self.choice_state: Number = np.repeat(np.arange(self.states, dtype=np.int32), counts)
        """The state of each choice."""
        self.edge_choice: Number = np.repeat(
            np.arange(self.choices, dtype=np.int32), np.diff(space.edge_first)
        )
        """The choice of each edge."""
        order = np.argsort(space.edge_target, kind="stable")
        self._into: Number = self.edge_choice[order]
        counts = np.bincount(space.edge_target, minlength=self.states)
        self._into_first: Index = np.concatenate(([0], np.cumsum(counts)))

    def reach(self, targets: Flags, allowed: Flags | None = None, ahead: Number | None = None) -> Reached:
        """What may reach the targets by allowed choices (all by default). ``ahead`` tells how many
        steps each target counts for itself; 0 by default."""
        depth = np.full(self.states, -1, dtype=np.int32)
        via = np.full(self.states, -1, dtype=np.int32)
        waiting = np.flatnonzero(targets)
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
        hit[self.edge_choice[states[self.space.edge_target]]] = True
        return hit

    def surely(self, targets: Flags, some: Reached | None = None) -> Reached:
        """Where the targets can be reached with probability 1, with choices that do so and never
        leave that set. ``some`` is what :meth:`reach` finds for the targets, if that is known."""
        reached = self.reach(targets) if some is None else some
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


def sums(owners: Index | Number, weights: Floats, count: int) -> Floats:
    """For each of ``count`` owners, the sum of its weights."""
    return np.bincount(owners, weights=weights, minlength=count).astype(np.float64, copy=False)
