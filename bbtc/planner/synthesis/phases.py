"""Policies for a finite horizon, as phases with a multi-policy each: its choices are optimal
whatever number of actions is left there.

A tree does not count its steps, but a retry node bounds how many actions start below it. Where one
assignment of choices to states is optimal all along, one retry node around the tree is enough;
where the best choice changes as the budget runs out, phases follow one another, each with a retry
node of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.mdp.finite_horizon import Horizon, best_choices, cheapest_choices
from bbtc.planner.mdp.graph import Graph, draw_probabilities
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Number, StateSpace
from bbtc.planner.mdp.transitions import Index
from bbtc.planner.synthesis.permissive import MultiPolicy, multi_policy

_MOST_STEPS = 1_000
_NEVER = 1e-9  # states that are less probable are given up


@dataclass(frozen=True, slots=True)
class Phase:
    """Up to ``steps`` actions by this multi-policy. It has the states of later phases, too, which are read
    when its attempts are used up (idle), and those that earlier ones ended in."""

    steps: int
    policy: MultiPolicy


def phases(horizon: Horizon, limits: Limits) -> list[Phase]:
    """The phases of a policy that attains the horizon's value; of the cheapest such policies unless
    others do with fewer phases. Raises ``LimitReached`` when the time is over."""
    graph = Graph(horizon.space)
    best = [best_choices(horizon, graph, step) for step in range(1, len(horizon.values))]
    cheap = _phases(horizon, graph, cheapest_choices(horizon, graph, best), limits)
    any_of_best = _phases(horizon, graph, best, limits) if len(cheap) > 1 else cheap
    return any_of_best if len(any_of_best) < len(cheap) else cheap


def likely_way_within(horizon: Horizon) -> Phase | None:
    """The choices of a policy that attains the horizon's value on the most probable way to the goal,
    elsewhere a run ends; None where there is no such way. No state is twice on it, so it is short enough."""
    space, graph = horizon.space, Graph(horizon.space)
    steps = len(horizon.values) - 1
    chance = np.log(draw_probabilities(space))
    likely = [np.where(space.goal, 0.0, -np.inf)]
    via: list[Index] = []
    for step in range(1, steps + 1):
        offered = best_choices(horizon, graph, step) & ~space.goal[space.choice_state]
        edges = np.flatnonzero(offered[space.edge_choice])
        states = space.choice_state[space.edge_choice[edges]]
        found = chance[edges] + likely[-1][space.edge_successor[edges]]
        best = likely[0].copy()
        np.maximum.at(best, states, found)
        edge = np.full(len(best), -1, dtype=np.int64)
        on_best = np.isfinite(found) & (found == best[states])
        edge[states[on_best]] = edges[on_best]
        likely.append(best)
        via.append(edge)
    starts = [(math.log(p) + likely[steps][state], state) for p, state in space.initial if p]
    weight, at = max(starts, key=lambda start: start[0])
    if weight == -math.inf:
        return None
    taken = np.zeros(graph.choices, dtype=np.bool_)
    last: dict[int, int] = {}
    left = steps
    while not space.goal[at]:
        left -= 1
        edge_taken = int(via[left][at])
        last[at] = int(space.edge_choice[edge_taken])
        at = int(space.edge_successor[edge_taken])
    # Of a state met twice, what was done the last time: that way is shorter.
    taken[list(last.values())] = True
    return Phase(steps, multi_policy(space, taken))


def _phases(horizon: Horizon, graph: Graph, best: list[Flags], limits: Limits) -> list[Phase]:
    space = horizon.space
    left = len(horizon.values) - 1
    entry = space.start
    ended = np.zeros(graph.states, dtype=np.bool_)
    parts: list[_Part] = []
    while left and len(entry):
        steps, offered, inside, leaving = _longest(horizon, graph, best[:left], entry, limits)
        inside |= ended
        ended = ended | (inside & ~space.goal & ~space.having(offered))
        parts.append(_Part(steps, offered, inside, np.union1d(entry, np.flatnonzero(ended))))
        left -= steps
        entry = leaving
    return _assembled(space, parts)


def _assembled(space: StateSpace, parts: list[_Part]) -> list[Phase]:
    """The phases, each with all states that it reads."""
    later = np.empty(0, dtype=np.int64)
    found: list[Phase] = []
    for part in reversed(parts):
        read = np.union1d(part.entry, later)
        found.append(Phase(part.steps, multi_policy(space, part.offered, read, part.inside)))
        later = space.closure(read, part.offered & part.inside[space.choice_state])
    return found[::-1]


def by_count(space: StateSpace, policy: Number, enough: float, limits: Limits) -> list[Phase]:
    """Phases of a policy in which states that read alike have the same choice, the one that the policy takes
    after so many actions: for states that only beliefs tell apart. They go on until the goal is reached with
    a probability of ``enough``, or nothing is done any more; where states that read alike want different
    actions after equally many, the more probable ones have theirs. Raises ``LimitReached`` when the time is
    over."""
    values = [row.tobytes() for row in space.packing.unpack(space.states)]
    chance = draw_probabilities(space)
    mass = dict.fromkeys(space.start.tolist(), 0.0)
    for probability, state in space.initial:
        mass[state] += float(probability)
    parts: list[_Part] = []
    doing: dict[bytes, int] = {}
    attained = 0.0
    ended = np.zeros(len(policy), dtype=np.bool_)
    for _ in range(_MOST_STEPS):
        limits.check_time("the search for a policy")
        attained += sum(p for state, p in mass.items() if space.goal[state])
        ended[[state for state in mass if policy[state] < 0 and not space.goal[state]]] = True
        going = sorted(
            (state for state, p in mass.items() if policy[state] >= 0 and p > _NEVER),
            key=lambda state: -mass[state],
        )
        if not going or attained >= enough:
            break
        wanted: dict[bytes, int] = {}
        for state in going:
            wanted.setdefault(values[state], int(space.choice_action[policy[state]]))
        if not parts or any(doing.get(read, action) != action for read, action in wanted.items()):
            offered, inside = (np.zeros(n, dtype=np.bool_) for n in (len(space.choice_action), len(policy)))
            parts.append(_Part(0, offered, inside, np.array(sorted(mass), dtype=np.int64)))
            doing = {}
        doing |= wanted
        part, after = parts[-1], dict[int, float]()
        for state in going:
            choice = int(policy[state])
            if space.choice_action[choice] != doing[values[state]]:
                continue
            part.offered[choice] = part.inside[state] = True
            edges = space.edges_of(np.array([choice]))
            for edge, successor in zip(edges.tolist(), space.edge_successor[edges].tolist(), strict=True):
                after[successor] = after.get(successor, 0.0) + mass[state] * float(chance[edge])
        parts[-1] = replace(part, steps=part.steps + 1)
        mass = after
    for part in parts:  # wherever a run has ended, or would at a later time, nothing starts
        part.inside[ended] = True
    return _assembled(space, parts)


@dataclass(frozen=True, slots=True)
class _Part:
    """A phase: the choices offered, where it may start an action, and where it may be entered."""

    steps: int
    offered: Flags
    inside: Flags
    entry: Index


def _longest(
    horizon: Horizon, graph: Graph, best_at: list[Flags], entry: Index, limits: Limits
) -> tuple[int, Flags, Flags, Index]:
    """The longest phase from a set of states, with as many actions left as there are best choices
    given: its length, the choices offered, the states in which it may start an action, and those it
    may end in."""
    space = horizon.space
    left = len(best_at)
    offered = np.zeros(graph.choices, dtype=np.bool_)
    inside = np.zeros(graph.states, dtype=np.bool_)
    steps = 0
    while steps < left and len(entry):
        limits.check_time("the search for a policy")
        best = best_at[left - steps - 1].copy()
        best[np.asarray(horizon.values[left - steps])[graph.choice_state] == 0] = False
        fresh = np.zeros(graph.states, dtype=np.bool_)
        fresh[entry] = True
        again = fresh & inside
        chosen = offered.copy()
        chosen[fresh[graph.choice_state] & ~inside[graph.choice_state]] = True
        chosen &= best | ~fresh[graph.choice_state]
        # A state seen before must keep some choice, unless it is given up now: going on is harmless.
        had = space.having(offered)
        given_up = ~space.having(best)
        chosen |= offered & given_up[graph.choice_state]
        if (again & had & ~space.having(chosen)).any():
            break
        # A state given up before, but not now, cannot be told from the one that was.
        offered, inside = chosen, inside | fresh
        steps += 1
        after = space.successors(entry, offered)
        entry = after[~space.goal[after]]
    return max(1, steps), offered, inside, entry
