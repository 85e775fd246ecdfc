"""Multi-policies (permissive strategies: Dräger et al. 2015): the states that matter for a policy, and all
choices that are as good in each.

Every way of taking them reaches the goal with the best probability, and at the least expected cost where that
is known; a tree may take whichever makes it smaller.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice

import numpy as np
import numpy.typing as npt

from bbtc.limits import Limits
from bbtc.planner.mdp.contraction import onward_pairs
from bbtc.planner.mdp.maxprob import MaxProb
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.ssp import LeastCost, least_cost
from bbtc.planner.mdp.state_space import Branching, Number, StateSpace
from bbtc.planner.mdp.transitions import Index

MOST_STATES = 20_000
"""More states than this, and one policy is fixed before a tree is made of it."""


@dataclass(frozen=True, slots=True, eq=False)
class MultiPolicy(Branching):
    """For every state, choices that are equally good, over a part of a space with state numbers of its own.
    ``values`` are the states, and ``initial`` those that runs start in. States without choices end a run: in
    the goal, because the goal is out of reach, or because nothing can start there for want of attempts
    (``idle``)."""

    values: npt.NDArray[np.uint8]
    idle: Flags
    initial: Index
    beliefs: npt.NDArray[np.uint32]
    """Of each state, the number of what is believed of each component of hidden facts."""


def best_multi_policy(found: MaxProb, limits: Limits) -> tuple[MultiPolicy, LeastCost | None]:
    """The choices of the cheapest among the best policies; of one of them where they are too many,
    and of one of the best where costs are not known. Raises ``LimitReached`` when the time is over."""
    cheapest = least_cost(found, limits)
    if cheapest is not None:
        policy, best = cheapest.policy, cheapest.best
        decided = found.space.decided[found.space.edge_choice]
        if any(found.space.draws[draw].cost == 0 for draw in np.unique(found.space.edge_draw[decided])):
            # Among equally cheap choices, cycles without cost must not be offered.
            narrowed = replace(found, policy=policy, best=best)
            policy, best = _fewest_actions(narrowed, limits)
    else:
        policy, best = _fewest_actions(found, limits)
    offered = multi_policy(found.space, best)
    if len(offered.goal) > MOST_STATES:
        only = np.zeros_like(best)
        only[policy[policy >= 0]] = True
        offered = multi_policy(found.space, only)
    return offered, cheapest


def likely_policy(found: MaxProb, most: int) -> MultiPolicy | None:
    """The choices of one best policy in the states that its runs visit most probably, ``most`` of them,
    where there are more; None where there are not. Elsewhere a run ends."""
    chosen = [state for state, _ in islice(_by_chance(found), most + 1)]
    return _in(found, chosen[:most]) if len(chosen) > most else None


def likely_way(found: MaxProb) -> MultiPolicy | None:
    """The choices of one best policy on the most probable way to the goal, elsewhere a run ends; None where
    there is no such way."""
    before: dict[int, int] = {}
    for state, source in _by_chance(found):
        before[state] = source
        if found.space.goal[state]:
            way = [state]
            while before[way[-1]] >= 0:
                way.append(before[way[-1]])
            return _in(found, way)
    return None


def one_policy(found: MaxProb) -> MultiPolicy:
    """The choices of one best policy."""
    only = np.zeros_like(found.best)
    only[found.policy[found.policy >= 0]] = True
    return multi_policy(found.space, only)


def _by_chance(found: MaxProb) -> Iterator[tuple[int, int]]:
    """The states that runs of one best policy visit, by the probability of the most probable way there, each
    with the state before (-1: none)."""
    space = found.space
    heap = [(-float(p), state, -1) for p, state in space.initial]
    heapq.heapify(heap)
    seen: set[int] = set()
    probability = [float(draw.probability) for draw in space.draws]
    while heap:
        weight, state, source = heapq.heappop(heap)
        if state in seen:
            continue
        seen.add(state)
        yield state, source
        choice = int(found.policy[state])
        if choice >= 0 and not space.goal[state]:
            for successor, draw in space.outcomes(choice):
                if successor not in seen:
                    heapq.heappush(heap, (weight * probability[draw], successor, state))


def _in(found: MaxProb, states: list[int]) -> MultiPolicy:
    """The choices of one best policy in some states."""
    only = np.zeros_like(found.best)
    choices = found.policy[np.array(sorted(states), dtype=np.int64)]
    only[choices[choices >= 0]] = True
    return multi_policy(found.space, only)


def _fewest_actions(found: MaxProb, limits: Limits) -> tuple[Number, Flags]:
    shortest = least_cost(found, limits, [Fraction(1)] * len(found.space.draws))
    if shortest is not None and shortest.exact:
        return shortest.policy, shortest.best
    only = np.zeros_like(found.best)
    only[found.policy[found.policy >= 0]] = True
    return found.policy, only


def multi_policy(
    space: StateSpace, taken: Flags, entry: Index | None = None, inside: Flags | None = None
) -> MultiPolicy:
    """The decisions of a space that a run may come to if it takes only choices of ``taken``, from the initial
    states or from ``entry``; where ``inside`` is given, nothing starts outside of it."""
    start = space.start if entry is None else entry
    if inside is not None:
        taken = taken & inside[space.choice_state]
    passing = space.passing
    states = space.closure(start, taken | ~space.decided)
    states = states[~passing[states]]
    choices = space.choices_of(states)
    choices = choices[taken[choices]]
    owner, successor = onward_pairs(space, passing, choices)
    number = _numbers(states, len(space.goal))
    return MultiPolicy(
        goal=space.goal[states],
        choice_state=number[space.choice_state[choices]],
        choice_action=space.choice_action[choices],
        edge_choice=owner.astype(np.int32),
        edge_successor=number[successor],
        values=space.packing.unpack(space.states[states]),
        idle=np.zeros(len(states), dtype=np.bool_) if inside is None else ~inside[states],
        initial=number[start].astype(np.int64),
        beliefs=space.packing.belief_numbers(space.states[states]),
    )


def _numbers(chosen: Index, count: int) -> Number:
    """For each of ``count``, its place among the chosen."""
    number = np.full(count, -1, dtype=np.int32)
    number[chosen] = np.arange(len(chosen), dtype=np.int32)
    return number
