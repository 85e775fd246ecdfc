"""Of choices that are as good in a world that nobody else changes, those that others' changes harm least.

Where something changes before a tick with probability e, a policy succeeds with P + e·D + o(e). D, its
derivative at e = 0, adds up over the ticks of an undisturbed run what one change makes of the success
probability: in a state s, r(s) = Σ C(s, t)·P*(t) - P*(s), where a change leads to t with probability C(s, t)
(:mod:`bbtc.planner.changing_facts`), and the robot does the best that it can from there. So the greatest D
solves D(s) = r(s) + max Σ p(t)·D(t) over the choices of s: a stochastic shortest path problem.
(Derivatives of Markov chains: Schweitzer, "Perturbation theory and finite Markov chains", 1968.)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.mdp.graph import Floats, draw_probabilities, sums
from bbtc.planner.mdp.maxprob import MaxProb
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.transitions import Index

SLIGHT = 0.01
"""Where choices make no more of a difference to D, all are as good: success differs by less than a thousandth
where one tick in ten comes after a change."""

_CLOSE = 1e-9
_CONVERGED = 1e-13
_LOOK = 100  # states or sweeps between two looks at the clock


def least_exposed(found: MaxProb, good: Flags, facts: ChangingFacts, limits: Limits) -> Flags:
    """Those of some choices that attain the greatest D; all of them where they make next to no difference.
    Whichever of them are taken, runs must end. A change to a state that is not in the space counts as none.
    Raises ``LimitReached`` when the time is over."""
    space = found.space
    taken = good & (~found.prob_0 & ~space.goal)[space.choice_state]
    visited = np.sort(space.closure(space.start, taken))
    choices = space.choices_of(visited)
    choices = choices[taken[choices]]
    values = np.where(space.goal, 1.0, found.lower)
    if len(choices) == len(np.unique(space.choice_state[choices])) or values.min() == 1:
        return good  # there is nothing to choose, or nothing to lose
    own = _changes_of_success(found, values, visited, facts, limits)
    most, of_choices = _totals(found, own, choices, np.maximum.reduceat, limits)
    least, _ = _totals(found, own, choices, np.minimum.reduceat, limits)
    if (most[space.start] - least[space.start] <= SLIGHT).all():
        return good
    kept: Flags = good.copy()
    kept[choices] = of_choices >= (most - own)[space.choice_state[choices]] - _CLOSE
    return kept


def _changes_of_success(
    found: MaxProb, values: Floats, visited: Index, facts: ChangingFacts, limits: Limits
) -> Floats:
    """r of the states visited; 0 elsewhere."""
    space, packing = found.space, found.space.packing
    numbers = {row.tobytes(): number for number, row in enumerate(space.states)}
    changes = np.zeros(len(values))
    visited = visited[~space.passing[visited]]
    before = packing.values(space.states[visited])
    for count, state in enumerate(visited.tolist()):
        if count % _LOOK == 0:
            limits.check_time("the search for a tree that recovers")
        ways = facts.changes(before[count])
        rows = packing.split(packing.pack(after) for _, after in ways)
        for (chance, _), row in zip(ways, rows, strict=True):
            number = numbers.get(row.tobytes(), state)
            changes[state] += float(chance) * (values[number] - values[state])
    return changes


def _totals(
    found: MaxProb,
    own: Floats,
    choices: Index,
    best_of: Callable[[Floats, Index], Floats],
    limits: Limits,
) -> tuple[Floats, Floats]:
    """D of each state by value iteration, and for each choice the sum, the r of its state left out."""
    space = found.space
    states, first = np.unique(space.choice_state[choices], return_index=True)
    edges = space.edges_of(choices)
    owners = np.searchsorted(choices, space.edge_choice[edges])
    weights, successors = draw_probabilities(space)[edges], space.edge_successor[edges]
    totals = own.copy()
    sweeps = 0
    while True:
        if sweeps % _LOOK == 0:
            limits.check_time("the search for a tree that recovers")
        sweeps += 1
        of_choices = sums(owners, weights * totals[successors], len(choices))
        after = own[states] + best_of(of_choices, first)
        moved = np.abs(after - totals[states]).max()
        totals[states] = after
        if moved <= _CONVERGED * max(1.0, float(np.abs(after).max())):
            return totals, of_choices
