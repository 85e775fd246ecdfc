"""MaxProb: the best probability with which any policy ever reaches the goal, P*, state by state.

1. States with value 0 and 1 are found in the graph (prob-0 and prob-1, :mod:`bbtc.planner.mdp.graph`).
2. For the others, interval iteration closes in from below and, with end components merged to
   single states, from above (Haddad and Monmege 2018), by Bellman updates of all states. Rounding is
   accounted for, so that the bounds hold.
3. Where the numbers are modest, the policy found is solved in rationals and improved until no
   choice is better: then its value is P* exactly, for it is reached by a policy and, being a
   solution of the optimality inequalities, an upper bound for all of them (Park induction; it
   needs no end components).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from bbtc.diagnostics import LimitReached
from bbtc.limits import Limits
from bbtc.planner.mdp.graph import Floats, Graph
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.policy_iteration import Equations
from bbtc.planner.mdp.state_space import Number, StateSpace
from bbtc.planner.mdp.transitions import Index

_ZERO, _ONE = Fraction(0), Fraction(1)
_UNIT = 2.0**-53
_CLOSE = 1e-12  # bounds this close are not worth further sweeps
_MOST_EXACT = 300_000  # edges of a system that is solved in rationals
_CHECK_EVERY = 16  # sweeps between two looks at the bounds


@dataclass(frozen=True, slots=True)
class Bounds:
    """A closed interval that holds the value; both ends are equal where it is known exactly."""

    lower: Fraction
    upper: Fraction

    @property
    def exact(self) -> Fraction | None:
        """The value, if it is known exactly."""
        return self.lower if self.lower == self.upper else None


@dataclass(frozen=True, slots=True)
class MaxProb:
    """P* of every state of a complete space.

    ``prob_1`` and ``prob_0`` are the states with these values; ``lower`` and ``upper`` bound the value
    of every state; ``exact`` holds the values of the other states, if they were found exactly.
    ``best[c]`` tells that choice c attains its state's value (where not exact: as far as floats
    tell). ``policy[s]`` is a choice for every state with positive value; following it attains P*.
    """

    space: StateSpace
    graph: Graph
    prob_1: Flags
    prob_0: Flags
    lower: Floats
    upper: Floats
    exact: dict[int, Fraction] | None
    best: Flags
    policy: Number

    def bounds(self, state: int) -> Bounds:
        """The value of one state."""
        if self.prob_1[state] or self.prob_0[state]:
            value = _ONE if self.prob_1[state] else _ZERO
            return Bounds(value, value)
        if self.exact is not None:
            return Bounds(self.exact[state], self.exact[state])
        return Bounds(Fraction(float(self.lower[state])), Fraction(float(self.upper[state])))

    @property
    def initial(self) -> Bounds:
        """The value of the task: the expectation over its initial states."""
        found = [(p, self.bounds(state)) for p, state in self.space.initial]
        return Bounds(
            sum((p * b.lower for p, b in found), _ZERO), sum((p * b.upper for p, b in found), _ZERO)
        )


def max_prob(
    space: StateSpace,
    limits: Limits,
    goal: Flags | None = None,
    *,
    graph: Graph | None = None,
    rationals: bool = True,
) -> MaxProb:
    """P* of reaching ``goal`` (by default the task's) in the part of a space that was expanded.

    ``graph`` is the space's, if it was made before; without ``rationals`` the values of states that
    numbers decide are left to floats. Where the limit on time ends the iteration, the bounds are wider.
    Raises ``LimitReached`` only if the time is over before the first step.
    """
    limits.check_time("the search for the best probability")
    graph = Graph(space) if graph is None else graph
    goals = space.goal if goal is None else goal
    reached = graph.reach(goals)
    some, surely = reached.found, graph.prob_1(goals, reached)
    one, maybe = surely.found, some & ~surely.found
    lower, upper = one.astype(np.float64), some.astype(np.float64)
    best = np.zeros(graph.choices, dtype=np.bool_)
    # In states of value 1, a choice is as good as any if it never leaves them.
    best[one[graph.choice_state] & ~graph.into(~one)] = True
    policy = surely.via.copy()
    exact: dict[int, Fraction] | None = {}
    if maybe.any():
        equations = Equations(graph, maybe, one)
        states, choices = equations.states, equations.choices
        low, high = _iterate(equations, limits)
        best[choices] = equations.ties(low)
        lower[states], upper[states] = low, high
        via = graph.reach(one, best).via
        policy[maybe] = via[maybe]
        values = _exact_values(equations, policy, limits) if rationals else None
        exact = None
        if values is not None:
            exact = dict(zip(states.tolist(), values, strict=True))
            best[choices] = equations.exact_ties(values)
            lower[states] = upper[states] = [float(value) for value in values]
    return MaxProb(space, graph, one, ~some, lower, upper, exact, best, policy)


def _exact_values(equations: Equations, policy: Number, limits: Limits) -> list[Fraction] | None:
    """The values exactly; None if that is too much work, or the time is over."""
    if len(equations.edge_successor) > _MOST_EXACT:
        return None
    try:
        return equations.solve(policy, limits)
    except LimitReached:
        return None


def _merged(equations: Equations, values: Floats) -> tuple[Index, Flags] | None:
    """End components merged: for each state its group, and the choices that may leave it. None if there
    are none."""
    graph, states, choices = equations.graph, equations.states, equations.choices
    source = equations.choice_state[equations.edge_choice]
    away = np.abs(values[equations.edge_successor] - values[source]) > 1e-6
    staying = np.zeros(graph.choices, dtype=np.bool_)
    staying[choices] = True
    staying[choices[equations.edge_choice[away]]] = False  # equal values all over a component
    leaving = graph.into(equations.number < 0)
    found = graph.end_components(staying & ~leaving)
    if not found:
        return None
    group = np.arange(len(states))
    for component in found:
        group[equations.number[component]] = equations.number[component[0]]
    leaves = leaving[choices]
    leaves[equations.edge_choice[group[equations.edge_successor] != group[source]]] = True
    return group, leaves


def _iterate(equations: Equations, limits: Limits) -> tuple[Floats, Floats]:
    """Bounds on the value of every state, closing until they are tight, nothing moves any more, or
    the time is over."""
    low = np.zeros(len(equations.states))
    rounding = (equations.degree + 2) * _UNIT  # of one sweep
    sweeps = 0
    while True:  # from below
        before = low
        for _ in range(_CHECK_EVERY):
            low = equations.update(low)
        sweeps += _CHECK_EVERY
        if float((low - before).max()) < _CLOSE or _time_is_over(limits):
            break
    error = sweeps * rounding
    lower: Floats = np.maximum(low - error, 0.0)
    merged = _merged(equations, low)
    high = np.ones(len(equations.states))
    sweeps = 0
    while float((high - low).max()) > _CLOSE and not _time_is_over(limits):
        before = high
        for _ in range(_CHECK_EVERY):
            values = equations.choice_values(high)
            if merged is None:
                high = np.maximum.reduceat(values, equations.first)
                continue
            group, leaves = merged
            top = np.zeros(len(high))
            np.maximum.at(top, group[equations.choice_state[leaves]], values[leaves])
            high = top[group]
        sweeps += _CHECK_EVERY
        if float((before - high).max()) < _CLOSE / 100:
            break
    upper: Floats = np.minimum(high + sweeps * rounding, 1.0)
    return lower, upper


def _time_is_over(limits: Limits) -> bool:
    remaining = limits.remaining
    return remaining is not None and remaining <= 0
