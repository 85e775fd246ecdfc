"""Upper bounds on what is attained, from a robot that is told more than it is.

The fast informed bound (Hauskrecht 2000): after each action the robot sees the world as it was before it. It
is a vector for each action, the best of which bounds the value of a belief. It is iterated from what a robot
attains that always sees the world; every iteration leaves a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import accumulate, pairwise

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.mdp.graph import Floats, sums
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.mdp.pomdp.model import Class, Pomdp, Told
from bbtc.planner.mdp.pomdp.processes import Choice, process

NEVER = -1e300
"""What a vector holds of a world in which it must not be used: it makes nothing of any belief that has it."""

_SWEEPS = 100
_STILL = 1e-6
_DISCOUNT = 0.97


def informed(pomdp: Pomdp, limits: Limits) -> list[Floats]:
    """By class, a row for each part of the goal and for each action: its upper bound, by world. What is left
    out is to do nothing, which is worth 0. Raises ``LimitReached``."""
    seeing = _seeing(pomdp, limits)
    bounds = [_rows(each, lambda told: _expected(told, seeing[told.after])) for each in pomdp.classes]
    return _iterated(pomdp, bounds, 1.0, limits)


def hasty(pomdp: Pomdp, bounds: list[Floats], limits: Limits) -> list[Floats]:
    """The same for a robot that may be stopped after any action, with a small probability: what gets on is
    worth more. Raises ``LimitReached``."""
    return _iterated(pomdp, bounds, _DISCOUNT, limits)


def _iterated(pomdp: Pomdp, bounds: list[Floats], discount: float, limits: Limits) -> list[Floats]:
    bounds = list(bounds)
    for _ in range(_SWEEPS):
        limits.check_time("bounds on the best probability")
        change = 0.0
        for number, each in enumerate(pomdp.classes):
            found = _rows(each, lambda told: discount * _best(told, bounds[told.after]))
            change = max(change, float(np.max(bounds[number] - found, initial=0.0)))
            bounds[number] = np.minimum(bounds[number], found)
        if change < _STILL:
            break
    return bounds


def _rows(where: Class, worth: Callable[[Told], Floats]) -> Floats:
    """The rows of a class, given what there is to gain after something is told, by edge summed to worlds."""
    rows = [np.where(met, 1.0, NEVER) for met in where.goals]
    for doing in where.doings:
        ahead = np.zeros(where.worlds)
        for told in doing.told:
            found = worth(told)
            ahead[: len(found)] += found
        rows.append(np.where(doing.applies, np.minimum(ahead, 1.0), NEVER))
    return np.array(rows).reshape(len(rows), where.worlds)


def _expected(told: Told, values: Floats) -> Floats:
    return sums(told.source, told.probability * values[told.target], int(told.source.max()) + 1)


def _best(told: Told, rows: Floats) -> Floats:
    """The best of some rows for each world before."""
    found = np.zeros(int(told.source.max()) + 1)
    for row in rows:
        np.maximum(found, _expected(told, row), out=found)
    return found


def _seeing(pomdp: Pomdp, limits: Limits) -> list[Floats]:
    """By class, upper bounds on what a robot attains from each world that always sees it."""
    first = list(accumulate((each.worlds for each in pomdp.classes), initial=0))
    goal = np.zeros(first[-1], dtype=np.bool_)
    for number, each in enumerate(pomdp.classes):
        for met in each.goals:
            goal[first[number] : first[number + 1]] |= met
    space = process(pomdp.task, goal, list(_choices(pomdp, first)))
    values = max_prob(space, limits, rationals=False).upper
    return [values[start:end] for start, end in pairwise(first)]


def _choices(pomdp: Pomdp, first: list[int]) -> Iterator[Choice]:
    for number, each in enumerate(pomdp.classes):
        by_world: list[list[Choice]] = [[] for _ in range(each.worlds)]
        for doing in each.doings:
            ends: list[tuple[list[int], list[float]]] = [([], []) for _ in range(each.worlds)]
            for told in doing.told:
                edges = zip(
                    told.source.tolist(), told.target.tolist(), told.probability.tolist(), strict=True
                )
                for source, target, probability in edges:
                    ends[source][0].append(first[told.after] + target)
                    ends[source][1].append(probability)
            for world in np.flatnonzero(doing.applies).tolist():
                by_world[world].append(Choice(first[number] + world, *ends[world]))
        for choices in by_world:
            yield from choices
