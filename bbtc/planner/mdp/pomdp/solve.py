"""Bounds on P* where beliefs have no end, and a part of the beliefs in which a policy attains the lower one.

The search works with floating-point numbers. Of the policy that it finds, the beliefs that its runs visit are
then worked out exactly, the most probable first: what the best policy attains within them is a lower bound
without rounding, and trees are made of that.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import count

import numpy as np

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import ONE, Task
from bbtc.limits import Limits
from bbtc.planner.mdp.explore import Choices, Explorer
from bbtc.planner.mdp.graph import Floats
from bbtc.planner.mdp.maxprob import Bounds, MaxProb, max_prob
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.pomdp.bounds import Vector
from bbtc.planner.mdp.pomdp.model import Pomdp, pomdp_of
from bbtc.planner.mdp.pomdp.search import ERROR, Search

MOST_BELIEFS = 1_000
"""Beliefs of a policy that are worked out exactly."""

_LOST = 1e-9  # beliefs that are visited with less are left out
_MOST_STEPS = 20 * MOST_BELIEFS
_FOR_SEARCH = 0.7  # of the time


@dataclass(frozen=True, slots=True)
class Closed:
    """Bounds on P*, and a part of the beliefs in which a policy attains the lower one. ``stop`` is the limit
    that ended the search."""

    found: MaxProb
    bounds: Bounds
    stop: Diagnostic | None
    interrupted: bool = False


def search_of(task: Task, limits: Limits) -> Search | None:
    """A search that has not begun; None where the task is not one for it, or where there is no time."""
    try:
        pomdp = pomdp_of(task, limits)
        return None if pomdp is None else Search(pomdp, limits)
    except LimitReached:
        return None


def closed_in(search: Search, limits: Limits, target: Fraction | None, *, verdict: bool) -> Closed:
    """Search until the bounds have met, a policy reaches the target, or with ``verdict`` none can. Raises
    ``LimitReached`` where there is no time for what was found."""
    stop, interrupted = None, False
    try:
        search.run(target, limits.part(_FOR_SEARCH), verdict=verdict)
    except LimitReached as reached:
        stop = reached.diagnostics[0]
    except KeyboardInterrupt:
        interrupted = True
    found = _exactly(search, limits)
    lower, upper = found.initial.lower, highest(search)
    return Closed(found, Bounds(lower, max(lower, upper)), stop, interrupted)


def highest(search: Search) -> Fraction:
    """The upper bound on P* that is known."""
    return min(ONE, Fraction(search.bounds[1] + ERROR))


def _exactly(search: Search, limits: Limits) -> MaxProb:
    """The beliefs that runs of the policy visit, with all that can be done in them."""
    pomdp = search.pomdp
    explorer = Explorer(pomdp.task, limits)
    waiting: list[tuple[float, int, int, Vector]] = []
    order = count()  # of equals, what came first

    def come(probability: float, state: int, vector: Vector) -> None:
        heapq.heappush(waiting, (-probability, state, next(order), vector))

    for p, state in explorer.initial:
        come(float(p), state, search.best(*_belief(pomdp, explorer, state)))
    choices: dict[int, Choices] = {}
    entered: set[tuple[int, int]] = set()
    while waiting and len(choices) < MOST_BELIEFS and len(entered) < _MOST_STEPS:
        weight, state, _, vector = heapq.heappop(waiting)
        if -weight < _LOST:
            break
        if vector.doing is None or (state, id(vector)) in entered:
            continue
        entered.add((state, id(vector)))
        if state not in choices:
            mark = explorer.mark()
            try:
                explorer.expand(np.array([state]), limits)
            except LimitReached:
                break
            choices[state] = explorer.since(mark)
        told = _told(pomdp, explorer, state, vector)
        edges = list(_edges(choices[state], vector.doing.action))
        for after, draw in edges:
            next_vector = _nearest(told, *_belief(pomdp, explorer, after))
            if next_vector is not None:
                come(-weight * float(explorer.tables.draws[draw].probability), after, next_vector)
        if not edges and len(told) == 1:  # to look at what is known
            come(-weight, state, told[0][2])
    fringe: Flags = ~explorer.goal()
    fringe[list(choices)] = False
    return max_prob(explorer.space(fringe, None), limits)


def _belief(pomdp: Pomdp, explorer: Explorer, state: int) -> tuple[int, Floats]:
    """The class and the weights of a state."""
    (values,) = explorer.packing.values(explorer.table.states[state : state + 1])
    return pomdp.belief(values)


def _edges(choices: Choices, action: int) -> Iterator[tuple[int, int]]:
    """Where an action may lead, and by which draw."""
    ends = np.cumsum(choices.edges)
    for place in np.flatnonzero(choices.action == action).tolist():
        edges = slice(int(ends[place] - choices.edges[place]), int(ends[place]))
        yield from zip(choices.successor[edges].tolist(), choices.draw[edges].tolist(), strict=True)


def _told(pomdp: Pomdp, explorer: Explorer, state: int, vector: Vector) -> list[tuple[int, Floats, Vector]]:
    """The classes and weights that the action of a vector leads to, and what to do then."""
    _, weights = _belief(pomdp, explorer, state)
    found = []
    for told, after in zip(vector.doing.told if vector.doing else (), vector.after, strict=True):
        drawn = told.weights(weights)
        if drawn.any():
            found.append((told.after, drawn / drawn.sum(), after))
    return found


def _nearest(told: list[tuple[int, Floats, Vector]], where: int, weights: Floats) -> Vector | None:
    """What to do in a belief, which is one of those told, but for rounding."""
    found = [
        (float(np.abs(drawn - weights).sum()), at) for at, (to, drawn, _) in enumerate(told) if to == where
    ]
    return told[min(found)[1]][2] if found else None
