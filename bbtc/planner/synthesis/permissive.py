"""The states that matter for a policy, and the choices open to it in each.

Every way of taking the choices offered here reaches the goal with the best probability, and at the
least expected cost where that is known; a tree may take whichever makes it smaller.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc.limits import Limits
from bbtc.planner.mdp.explore import StateSpace, ranges
from bbtc.planner.mdp.graph import Number
from bbtc.planner.mdp.maxprob import Reachability
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.ssp import LeastCost, least_cost
from bbtc.planner.mdp.transitions import Index

MOST_OPEN = 20_000
"""More states than this, and one policy is fixed before a tree is made of it."""


@dataclass(frozen=True, slots=True)
class Offers:
    """A part of a space with local state numbers. State i has the offers ``first[i]:first[i + 1]``,
    each an action (``action``) and the states it may lead to (``target`` from ``edge_first``).
    States without offers end a run: in the goal (``goal``), because the goal is out of reach, or
    because nothing can start there for want of attempts (``idle``)."""

    values: npt.NDArray[np.uint8]
    goal: Flags
    idle: Flags
    first: Index
    action: Index
    edge_first: Index
    target: Index
    initial: Index

    def reached(self, taken: Flags) -> Flags:
        """States that a run may visit if it takes only offers of ``taken``."""
        found = np.zeros(len(self.goal), dtype=np.bool_)
        frontier = np.unique(self.initial)
        while len(frontier):
            found[frontier] = True
            offers = ranges(self.first[frontier], self.first[frontier + 1] - self.first[frontier])
            offers = offers[taken[offers]]
            edges = ranges(self.edge_first[offers], self.edge_first[offers + 1] - self.edge_first[offers])
            targets = np.unique(self.target[edges])
            frontier = targets[~found[targets]]
        return found


def best_offers(found: Reachability, limits: Limits) -> tuple[Offers, LeastCost | None]:
    """The choices of the cheapest among the best policies; of one of them where they are too many,
    and of one of the best where costs are not known. Raises ``LimitReached`` when the time is over."""
    cheapest = least_cost(found, limits)
    if cheapest is not None:
        policy, best = cheapest.policy, cheapest.best
        if any(found.space.draws[draw].cost == 0 for draw in np.unique(found.space.edge_draw)):
            # Among equally cheap choices, cycles without cost must not be offered.
            narrowed = replace(found, policy=policy, best=best)
            policy, best = _fewest_actions(narrowed, limits)
    else:
        policy, best = _fewest_actions(found, limits)
    offers = offers_of(found.space, best)
    if len(offers.goal) > MOST_OPEN:
        only = np.zeros_like(best)
        only[policy[policy >= 0]] = True
        offers = offers_of(found.space, only)
    return offers, cheapest


def likely_offers(found: Reachability, most: int) -> Offers | None:
    """The choices of one best policy in the states that its runs visit most probably, ``most`` of them,
    where there are more; None where there are not. Elsewhere a run ends."""
    space = found.space
    chance: dict[int, float] = {}
    heap = [(-float(p), state) for p, state in space.initial]
    heapq.heapify(heap)
    probability = [float(draw.probability) for draw in space.draws]
    while heap and len(chance) < most:
        weight, state = heapq.heappop(heap)
        if state in chance:
            continue
        chance[state] = -weight
        choice = int(found.policy[state])
        if choice >= 0 and not space.goal[state]:
            for edge in range(int(space.edge_first[choice]), int(space.edge_first[choice + 1])):
                target = int(space.edge_target[edge])
                if target not in chance:
                    heapq.heappush(heap, (weight * probability[int(space.edge_draw[edge])], target))
    if not heap:
        return None
    only = np.zeros_like(found.best)
    choices = found.policy[np.array(sorted(chance), dtype=np.int64)]
    only[choices[choices >= 0]] = True
    return offers_of(space, only)


def _fewest_actions(found: Reachability, limits: Limits) -> tuple[Number, Flags]:
    shortest = least_cost(found, limits, [Fraction(1)] * len(found.space.draws))
    if shortest is not None and shortest.exact:
        return shortest.policy, shortest.best
    only = np.zeros_like(found.best)
    only[found.policy[found.policy >= 0]] = True
    return found.policy, only


def offers_of(
    space: StateSpace, taken: Flags, entry: Index | None = None, inside: Flags | None = None
) -> Offers:
    """The part of a space that a run may visit if it takes only choices of ``taken``, from the initial
    states or from ``entry``; where ``inside`` is given, nothing starts outside of it."""
    number = np.full(len(space.states), -1, dtype=np.int64)
    initial = np.unique([state for _, state in space.initial]) if entry is None else entry
    if inside is not None:
        taken = taken & np.repeat(inside, np.diff(space.choice_first))
    found: list[Index] = []
    frontier: Index = initial.astype(np.int64)
    count = 0
    while len(frontier):
        number[frontier] = count + np.arange(len(frontier))
        count += len(frontier)
        found.append(frontier)
        choices = _taken(space, frontier, taken)
        edges = ranges(space.edge_first[choices], space.edge_first[choices + 1] - space.edge_first[choices])
        targets = np.unique(space.edge_target[edges]).astype(np.int64)
        frontier = targets[number[targets] < 0]
    states = np.concatenate(found)
    choices = _taken(space, states, taken)
    owner_counts = _counts(space, states, taken)
    edge_counts = space.edge_first[choices + 1] - space.edge_first[choices]
    edges = ranges(space.edge_first[choices], edge_counts)
    return Offers(
        values=space.packing.unpack(space.states[states]),
        goal=space.goal[states],
        idle=np.zeros(len(states), dtype=np.bool_) if inside is None else ~inside[states],
        first=np.concatenate(([0], np.cumsum(owner_counts))),
        action=space.choice_action[choices].astype(np.int64),
        edge_first=np.concatenate(([0], np.cumsum(edge_counts))),
        target=number[space.edge_target[edges]],
        initial=number[initial],
    )


def _taken(space: StateSpace, states: Index, taken: Flags) -> Index:
    choices = ranges(space.choice_first[states], space.choice_first[states + 1] - space.choice_first[states])
    kept: Index = choices[taken[choices]]
    return kept


def _counts(space: StateSpace, states: Index, taken: Flags) -> Index:
    counts = space.choice_first[states + 1] - space.choice_first[states]
    choices = ranges(space.choice_first[states], counts)
    owners = np.repeat(np.arange(len(states)), counts)
    return np.bincount(owners[taken[choices]], minlength=len(states)).astype(np.int64)
