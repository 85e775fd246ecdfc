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
from bbtc.planner.mdp.graph import Floats
from bbtc.planner.mdp.maxprob import MaxProb
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.policy_iteration import Equations
from bbtc.planner.mdp.state_space import Number
from bbtc.rounding import rounded

_ZERO = Fraction(0)
_MOST_EXACT = 100_000  # choices of a system that is solved in rationals
_MOST_SWEEPS = 100_000
_SAME_SWEEPS = 1_000  # that change values by the same: so do all that follow


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
    rewards = [-cost for cost in table]
    equations = Equations(graph, transient, np.zeros(graph.states, dtype=np.bool_), rewards, found.best)
    floats = _float_values(equations, found.policy, limits)
    best = np.zeros(graph.choices, dtype=np.bool_)
    best[equations.choices] = equations.ties(floats)
    # A policy of such choices that ends: each state moves closer to an end.
    via = graph.reach(~transient, best).via
    policy = np.where(transient & (via < 0), found.policy, np.where(transient, via, -1))
    known: list[Fraction] | None = None
    if np.count_nonzero(found.best & transient[graph.choice_state]) <= _MOST_EXACT:
        known = equations.solve(policy, limits)
    if known is not None:
        floats = np.array([rounded(value) for value in known])
        best[equations.choices] = equations.exact_ties(known)
    at = dict(zip(equations.states.tolist(), known or map(Fraction, floats.tolist()), strict=True))
    initial = -sum((p * at.get(state, _ZERO) for p, state in space.initial), _ZERO)
    values = np.zeros(graph.states)
    values[equations.states] = -floats
    return LeastCost(initial, known is not None, values, policy, best)


def _float_values(equations: Equations, policy: Number, limits: Limits) -> Floats:
    """The values in floats: those of a policy that ends, then value iteration from there upwards (from
    above, cycles without cost would hide the way out)."""
    own = equations.choice_number[policy[equations.states]]
    values = np.zeros(len(own))
    updates: list[Callable[[Floats], Floats]] = [
        lambda before: equations.choice_values(before)[own],
        equations.update,
    ]
    for update in updates:
        change, same = np.zeros(len(own)), 0
        for step in range(_MOST_SWEEPS):
            before, values = values, update(values)
            last, change = change, values - before
            if np.abs(change).max() < 1e-13 * max(1.0, float(np.abs(values).max())):
                break
            # What ends with a chance too small for floats never ends in them.
            same = same + 1 if np.array_equal(change, last) else 0
            if same == _SAME_SWEEPS:
                break
            if step % 64 == 0:
                limits.check_time("the search for the least cost")
    return values
