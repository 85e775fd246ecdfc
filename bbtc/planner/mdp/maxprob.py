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
from bbtc.markov import Row, solve
from bbtc.planner.mdp.graph import Floats, Graph, sums
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Number, StateSpace
from bbtc.planner.mdp.transitions import Index

_ZERO, _ONE = Fraction(0), Fraction(1)
_UNIT = 2.0**-53
_TIE = 1e-9  # floats closer than this may be equal
_CLOSE = 1e-12  # bounds this close are not worth further sweeps
_MOST_EXACT = 300_000  # edges of a system that is solved in rationals
_MOST_WORK = 400_000  # elimination steps of one loop of states
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


def draw_probabilities(space: StateSpace) -> Floats:
    """The probability of each edge."""
    table = np.array([float(draw.probability) for draw in space.draws] or [0.0])
    found: Floats = table[space.edge_draw]
    return found


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
        part = _Part(graph, maybe, one)
        low, high = _iterate(part, limits)
        best[part.choices] = part.ties(low)
        lower[part.states], upper[part.states] = low, high
        via = graph.reach(one, best).via
        policy[maybe] = via[maybe]
        exact = part.exact_values(policy, limits) if rationals else None
        if exact is not None:
            values = np.array([float(exact[s]) for s in part.states.tolist()])
            best[part.choices] = part.exact_ties(exact, values)
            lower[part.states] = upper[part.states] = values
    return MaxProb(space, graph, one, ~some, lower, upper, exact, best, policy)


class _Part:
    """The sub-process of the states whose value is neither 0 nor 1, with local numbers."""

    def __init__(self, graph: Graph, maybe: Flags, one: Flags) -> None:
        space = graph.space
        self.graph = graph
        self.states = np.flatnonzero(maybe)
        self.number = np.full(graph.states, -1, dtype=np.int64)
        self.number[self.states] = np.arange(len(self.states))
        self.choices = np.flatnonzero(maybe[graph.choice_state])
        choice_number = np.full(graph.choices, -1, dtype=np.int64)
        choice_number[self.choices] = np.arange(len(self.choices))
        self.choice_state = self.number[graph.choice_state[self.choices]]
        edges = np.flatnonzero(choice_number[graph.edge_choice] >= 0)
        weight = draw_probabilities(space)[edges]
        owner = choice_number[graph.edge_choice[edges]]
        successor = space.edge_successor[edges]
        inner = maybe[successor]
        self.win = sums(owner, weight * one[successor], len(self.choices))
        self.edge_choice, self.edge_successor = owner[inner], self.number[successor[inner]]
        self.weight = weight[inner]
        self.degree = int(np.bincount(owner).max()) + 2 if len(owner) else 2
        # States come in order, and so do their choices: the first choice of each state.
        self.first = np.searchsorted(self.choice_state, np.arange(len(self.states)))
        self.one = one

    def choice_values(self, values: Floats) -> Floats:
        """The Q-value of each choice, given the values of the states."""
        part = sums(self.edge_choice, self.weight * values[self.edge_successor], len(self.choices))
        found: Floats = self.win + part
        return found

    def update(self, values: Floats) -> Floats:
        """The Bellman update of every state: one step of value iteration."""
        found: Floats = np.maximum.reduceat(self.choice_values(values), self.first)
        return found

    def ties(self, values: Floats) -> Flags:
        """Choices that attain the value of their state, as far as floats tell."""
        near: Flags = self.choice_values(values) >= values[self.choice_state] - _TIE
        return near

    def merge(self, values: Floats) -> tuple[Index, Flags] | None:
        """End components merged: for each state its group, and the choices that may leave it.
        None if there are none."""
        away = np.abs(values[self.edge_successor] - values[self.choice_state[self.edge_choice]]) > 1e-6
        staying = np.zeros(self.graph.choices, dtype=np.bool_)
        staying[self.choices] = True
        staying[self.choices[self.edge_choice[away]]] = False  # equal values all over a component
        outside = np.ones(self.graph.states, dtype=np.bool_)
        outside[self.states] = False
        leaving = self.graph.into(outside)
        found = self.graph.end_components(staying & ~leaving)
        if not found:
            return None
        group = np.arange(len(self.states))
        for component in found:
            group[self.number[component]] = self.number[component[0]]
        leaves = leaving[self.choices]
        across = group[self.edge_successor] != group[self.choice_state[self.edge_choice]]
        leaves[self.edge_choice[across]] = True
        return group, leaves

    # --- rationals -------------------------------------------------------------------------------

    def row(self, choice: int) -> tuple[Fraction, dict[int, Fraction]]:
        """Of a choice (numbered as in the space), the probability of values 1, and the others by
        local number."""
        space = self.graph.space
        win = _ZERO
        row: dict[int, Fraction] = {}
        for successor, draw in space.outcomes(choice):
            p = space.draws[draw].probability
            number = int(self.number[successor])
            if number >= 0:
                row[number] = row[number] + p if number in row else p
            elif self.one[successor]:
                win += p
        return win, row

    def exact_values(self, policy: Number, limits: Limits) -> dict[int, Fraction] | None:
        """P* of every state by policy iteration in rationals, starting from a policy that reaches
        the goal from everywhere with positive probability; ``policy`` is improved in place. None
        if that is too much work, or the time is over."""
        if len(self.edge_successor) > _MOST_EXACT or (policy[self.states] < 0).any():
            return None
        try:
            while True:
                rows = []
                for count, choice in enumerate(policy[self.states].tolist()):
                    if count % 1024 == 0:
                        limits.check_time("the exact solution")
                    rows.append(self.row(choice))
                values = solved(rows, limits)
                if values is None:
                    return None
                if not self._improve(policy, values, limits):
                    return dict(zip(self.states.tolist(), values, strict=True))
        except LimitReached:
            return None

    def _improve(self, policy: Number, values: list[Fraction], limits: Limits) -> bool:
        """Switch each state to its best choice where that is strictly better."""
        floats = np.array([float(value) for value in values])
        near = np.flatnonzero(self.choice_values(floats) > floats[self.choice_state] - _TIE)
        gain: dict[int, tuple[Fraction, int]] = {}
        for count, local in enumerate(near.tolist()):
            if count % 1024 == 0:
                limits.check_time("the exact solution")
            choice, state = int(self.choices[local]), int(self.choice_state[local])
            if policy[self.states[state]] == choice:
                continue
            value = self.exact_value(choice, values)
            if value > gain.get(state, (values[state], -1))[0]:
                gain[state] = value, choice
        for state, (_, choice) in gain.items():
            policy[self.states[state]] = choice
        return bool(gain)

    def exact_value(self, choice: int, values: list[Fraction]) -> Fraction:
        """The Q-value of a choice, given the values of the states by local number."""
        win, row = self.row(choice)
        return win + sum((p * values[successor] for successor, p in row.items()), _ZERO)

    def exact_ties(self, exact: dict[int, Fraction], floats: Floats) -> Flags:
        """Choices that attain the value of their state."""
        values = [exact[state] for state in self.states.tolist()]
        ties = self.ties(floats)
        for local in np.flatnonzero(ties).tolist():
            attained = self.exact_value(int(self.choices[local]), values)
            ties[local] = attained == values[int(self.choice_state[local])]
        return ties


def _iterate(part: _Part, limits: Limits) -> tuple[Floats, Floats]:
    """Bounds on the value of every state, closing until they are tight, nothing moves any more, or
    the time is over."""
    low = np.zeros(len(part.states))
    sweeps = 0
    while True:  # from below
        before = low
        for _ in range(_CHECK_EVERY):
            low = part.update(low)
        sweeps += _CHECK_EVERY
        if float((low - before).max()) < _CLOSE or _time_is_over(limits):
            break
    error = sweeps * part.degree * _UNIT
    lower: Floats = np.maximum(low - error, 0.0)
    merged = part.merge(low)
    high = np.ones(len(part.states))
    sweeps = 0
    while float((high - low).max()) > _CLOSE and not _time_is_over(limits):
        before = high
        for _ in range(_CHECK_EVERY):
            values = part.choice_values(high)
            if merged is None:
                high = np.maximum.reduceat(values, part.first)
                continue
            group, leaves = merged
            top = np.zeros(len(high))
            np.maximum.at(top, group[part.choice_state[leaves]], values[leaves])
            high = top[group]
        sweeps += _CHECK_EVERY
        if float((before - high).max()) < _CLOSE / 100:
            break
    upper: Floats = np.minimum(high + sweeps * part.degree * _UNIT, 1.0)
    return lower, upper


def solved(system: list[tuple[Fraction, Row]], limits: Limits) -> list[Fraction] | None:
    """The exact values of a chain, of which each state has a constant and a row; None if that is too much
    work. Raises ``LimitReached`` when the time is over."""
    rows, constant = [row for _, row in system], [own for own, _ in system]
    return solve(rows, constant, most_work=_MOST_WORK, look=lambda: limits.check_time("the exact solution"))


def _time_is_over(limits: Limits) -> bool:
    remaining = limits.remaining
    return remaining is not None and remaining <= 0
