"""The least expected cost among the policies that attain P*: a stochastic shortest path problem (SSP).

A policy may use the choices that attain P* and must end, in a goal or where the goal is out of
reach. Policy iteration starts from one that ends and switches on strict improvement only; with
costs that are not negative it then never leaves the policies that end, cycles without cost
included, and its fixed point is optimal among them (Bertsekas and Tsitsiklis 1991).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.mdp.graph import Floats, sums
from bbtc.planner.mdp.maxprob import MaxProb, draw_probabilities, solved
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Number
from bbtc.rounding import rounded

_ZERO = Fraction(0)
_MOST_EXACT = 100_000  # edges of a system that is solved in rationals
_MOST_SWEEPS = 100_000
_TIE = 1e-9


@dataclass(frozen=True, slots=True)
class LeastCost:
    """``initial`` is the least expected cost from the initial belief (``exact`` tells whether it is
    exactly that), ``values`` that of every state, ``policy`` a choice for each transient state that
    attains it, ``best`` all such choices. Costs until the goal, or until it is out of reach."""

    initial: Fraction
    exact: bool
    values: Floats
    policy: Number
    best: Flags


def least_cost(found: MaxProb, limits: Limits, costs: list[Fraction] | None = None) -> LeastCost | None:
    """The least expected cost; None where a cost is negative or P* is not known well enough.

    ``costs`` gives the cost of each draw; by default, the action's cost and its outcome's. Raises
    ``LimitReached`` when the time is over.
    """
    if found.exact is None:
        return None
    space, graph = found.space, found.graph
    table = [draw.cost for draw in space.draws] if costs is None else costs
    if any(table[draw] < 0 for draw in np.unique(space.edge_draw)):
        return None
    transient = ~found.prob_0 & ~space.goal
    if not transient.any():
        empty = np.full(graph.states, -1, dtype=np.int32)
        return LeastCost(_ZERO, True, np.zeros(graph.states), empty, np.zeros(graph.choices, dtype=np.bool_))
    system = _System(found, table, transient)
    start = found.policy.copy()
    values = system.improve_floats(start, limits)
    policy = system.policy_from(values)
    exact = system.exact(policy, limits)
    if exact is not None:
        values[system.states] = [rounded(value) for value in exact]
        best = system.ties_exactly(exact, values)
        at = dict(zip(system.states.tolist(), exact, strict=True))
        initial = sum((p * at.get(s, _ZERO) for p, s in space.initial), _ZERO)
    else:
        best = system.ties(values)
        initial = sum((p * Fraction(float(values[s])) for p, s in space.initial), _ZERO)
    return LeastCost(initial, exact is not None, values, policy, best)


class _System:
    def __init__(self, found: MaxProb, table: list[Fraction], transient: Flags) -> None:
        self.found, self.table = found, table
        self.space, self.graph = found.space, found.graph
        self.states = np.flatnonzero(transient)
        self.transient = transient
        self.number = np.full(self.graph.states, -1, dtype=np.int64)
        self.number[self.states] = np.arange(len(self.states))
        self.allowed = found.best & transient[self.graph.choice_state]
        self.weight = draw_probabilities(self.space)
        floats = np.array([rounded(cost) for cost in table])
        weights = self.weight * floats[self.space.edge_draw]
        self.cost = sums(self.graph.edge_choice, weights, self.graph.choices)

    def choice_values(self, values: Floats) -> Floats:
        """The Q-value of each choice, its expected cost, given that of the states."""
        weights = self.weight * values[self.space.edge_successor]
        found: Floats = self.cost + sums(self.graph.edge_choice, weights, self.graph.choices)
        return found

    def improve_floats(self, policy: Number, limits: Limits) -> Floats:
        """The optimal values in floats: those of a policy that ends, then value iteration from
        there downwards (from below, cycles without cost would hide the way out)."""
        values = np.zeros(self.graph.states)
        own = policy[self.states]
        self._sweep(values, lambda found: found[own], limits)
        choices = np.flatnonzero(self.allowed)
        # Choices are ordered by state, and every transient state has an allowed one.
        first = np.searchsorted(self.graph.choice_state[choices], self.states)
        self._sweep(values, lambda found: np.minimum.reduceat(found[choices], first), limits)
        return values

    def _sweep(self, values: Floats, choose: Callable[[Floats], Floats], limits: Limits) -> None:
        """Give every transient state what ``choose`` makes of the values of the choices, until they rest."""
        for step in range(_MOST_SWEEPS):
            after = choose(self.choice_values(values))
            moved = np.abs(after - values[self.states]).max()
            values[self.states] = after
            if moved < 1e-13 * max(1.0, float(after.max())):
                break
            if step % 64 == 0:
                limits.check_time("the search for the least cost")

    def ties(self, values: Floats) -> Flags:
        """Allowed choices that attain their state's cost, as far as floats tell."""
        limit = values[self.graph.choice_state]
        near: Flags = self.allowed & (self.choice_values(values) <= limit + _TIE * np.maximum(1.0, limit))
        return near

    def policy_from(self, values: Floats) -> Number:
        """A policy of such choices that ends: each state moves closer to an end."""
        via = self.graph.reach(~self.transient, self.ties(values)).via
        return np.where(self.transient & (via < 0), self.found.policy, np.where(self.transient, via, -1))

    # --- rationals -------------------------------------------------------------------------------

    def row(self, choice: int) -> tuple[Fraction, dict[int, Fraction]]:
        cost = _ZERO
        row: dict[int, Fraction] = {}
        space = self.space
        for state, draw in space.outcomes(choice):
            p = space.draws[draw].probability
            cost += p * self.table[draw]
            successor = int(self.number[state])
            if successor >= 0:
                row[successor] = row[successor] + p if successor in row else p
        return cost, row

    def exact(self, policy: Number, limits: Limits) -> list[Fraction] | None:
        """The values in rationals; the policy is improved in place."""
        if int(self.allowed.sum()) > _MOST_EXACT:
            return None
        while True:
            limits.check_time("the search for the least cost")
            rows = [self.row(int(choice)) for choice in policy[self.states]]
            values = solved(rows, limits)
            if values is None:
                return None
            floats = np.zeros(self.graph.states)
            floats[self.states] = [rounded(value) for value in values]
            gain: dict[int, tuple[Fraction, int]] = {}
            for choice in np.flatnonzero(self.ties(floats)).tolist():
                state = int(self.number[self.graph.choice_state[choice]])
                value = self.exact_value(choice, values)
                if value < gain.get(state, (values[state], -1))[0]:
                    gain[state] = value, choice
            if not gain:
                return values
            for state, (_, choice) in gain.items():
                policy[self.states[state]] = choice

    def exact_value(self, choice: int, values: list[Fraction]) -> Fraction:
        cost, row = self.row(choice)
        return cost + sum((p * values[successor] for successor, p in row.items()), _ZERO)

    def ties_exactly(self, exact: list[Fraction], values: Floats) -> Flags:
        """Allowed choices that attain their state's cost."""
        ties = self.ties(values)
        for choice in np.flatnonzero(ties).tolist():
            state = int(self.number[self.graph.choice_state[choice]])
            ties[choice] = self.exact_value(choice, exact) == exact[state]
        return ties
