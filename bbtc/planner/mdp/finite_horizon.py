"""MaxProb within a finite horizon: the best probability of reaching the goal with at most k actions, by
backward induction (Puterman, "Markov decision processes", 1994)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.mdp.graph import Floats, Graph, draw_probabilities, sums
from bbtc.planner.mdp.maxprob import Bounds
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.rounding import rounded

_MOST_EXACT = 400_000  # edges times steps that are summed in rationals
_UNIT = 2.0**-53
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True)
class Horizon:
    """``initial[k]`` is the task's value with at most k actions. ``values[k]`` are the states'
    values, in rationals where ``exact``, else in floats."""

    space: StateSpace
    initial: tuple[Bounds, ...]
    values: tuple[list[Fraction], ...] | tuple[Floats, ...]
    exact: bool


def horizon_values(
    space: StateSpace, steps: int, limits: Limits, goal: Flags | None = None, *, rationals: bool = True
) -> Horizon:
    """Values for 0, 1, … ``steps`` actions of reaching ``goal`` (by default the task's). They are those
    of the task if the space is expanded to that depth at least. Without ``rationals`` they are left
    to floats.

    Raises ``LimitReached`` when the time is over.
    """
    if len(space.edge_successor) * steps <= (_MOST_EXACT if rationals else 0):
        return _exact(space, steps, limits, space.goal if goal is None else goal)
    graph = Graph(space)
    weight = draw_probabilities(space)
    degree = int(np.bincount(graph.edge_choice).max()) + 2
    live = np.unique(graph.choice_state)
    first = np.searchsorted(graph.choice_state, live)
    values = (space.goal if goal is None else goal).astype(np.float64)
    found = [values]
    for _ in range(steps):
        limits.check_time("backward induction")
        attained = sums(graph.edge_choice, weight * values[space.edge_successor], graph.choices)
        after = values.copy()
        after[live] = np.maximum(values[live], np.maximum.reduceat(attained, first))
        values = after
        found.append(values)
    initial = []
    for step, values in enumerate(found):
        middle = sum((p * Fraction(float(values[s])) for p, s in space.initial), _ZERO)
        error = Fraction(step * degree * _UNIT)
        initial.append(Bounds(max(_ZERO, middle - error), min(_ONE, middle + error)))
    return Horizon(space, tuple(initial), tuple(found), exact=False)


def _exact(space: StateSpace, steps: int, limits: Limits, aims: Flags) -> Horizon:
    table = [draw.probability for draw in space.draws]
    choices = [
        (state, [(table[draw], successor) for successor, draw in space.outcomes(choice)])
        for choice, state in enumerate(space.choice_state.tolist())
    ]
    values = [_ONE if goal else _ZERO for goal in aims.tolist()]
    found = [values]
    for _ in range(steps):
        limits.check_time("backward induction")
        after = list(values)
        for state, outcomes in choices:
            value = sum((p * values[successor] for p, successor in outcomes if values[successor]), _ZERO)
            after[state] = max(after[state], value)
        values = after
        found.append(values)
    initial = tuple(
        Bounds(value, value) for value in (sum((p * v[s] for p, s in space.initial), _ZERO) for v in found)
    )
    return Horizon(space, initial, tuple(found), exact=True)


def best_choices(horizon: Horizon, graph: Graph, step: int) -> Flags:
    """Choices that attain the value of their state with at most ``step`` actions left."""
    space = horizon.space
    if horizon.exact:
        before, after = horizon.values[step - 1], horizon.values[step]
        flags = np.zeros(graph.choices, dtype=np.bool_)
        for choice in range(graph.choices):
            value = _ZERO
            for successor, draw in space.outcomes(choice):
                if before[successor]:
                    value += space.draws[draw].probability * before[successor]
            flags[choice] = value == after[int(graph.choice_state[choice])]
        return flags
    floats = np.asarray(horizon.values[step - 1])
    weight = draw_probabilities(space)
    attained = sums(graph.edge_choice, weight * floats[space.edge_successor], graph.choices)
    best: Flags = attained >= np.asarray(horizon.values[step])[graph.choice_state] - 1e-12
    return best


def cheapest_choices(horizon: Horizon, graph: Graph, best: list[Flags]) -> list[Flags]:
    """Of the best choices with 1, 2, … actions left, those of the least expected cost (as far as
    floats tell: cost only breaks ties)."""
    space = horizon.space
    weight = draw_probabilities(space)
    table = np.array([rounded(draw.cost) for draw in space.draws] or [0.0])
    own = sums(graph.edge_choice, weight * table[space.edge_draw], graph.choices)
    cost = np.zeros(graph.states)
    found: list[Flags] = []
    for step, attained in enumerate(best, 1):
        hopeless = np.asarray(horizon.values[step], dtype=np.float64) == 0
        usable = attained & ~hopeless[graph.choice_state]
        total = own + sums(graph.edge_choice, weight * cost[space.edge_successor], graph.choices)
        least = np.full(graph.states, np.inf)
        np.minimum.at(least, graph.choice_state[usable], total[usable])
        found.append(usable & (total <= least[graph.choice_state] + 1e-9))
        cost = np.where(np.isinf(least), 0.0, least)
    return found
