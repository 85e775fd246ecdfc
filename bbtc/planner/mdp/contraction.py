"""State spaces without the states in which nothing is decided, where these are few enough to be left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Branching, StateSpace
from bbtc.planner.mdp.transitions import Draw, Index

_EDGE = 100  # bytes that an edge takes, meanwhile


def contracted(space: StateSpace, limits: Limits) -> StateSpace:
    """The space of decisions: every action leads to the states in which the next one is chosen, whatever
    happens by itself in between. States that were found but not expanded stay. Raises ``LimitReached`` where
    that takes more memory or time than there is."""
    passing = space.passing & ~space.fringe
    if not passing.any():
        return space
    draws = _Draws(space)
    kept = ~passing[space.choice_state]
    owner, draw, successor = (
        each.astype(np.int64)[kept[space.edge_choice]]
        for each in (space.edge_choice, space.edge_draw, space.edge_successor)
    )
    while (through := passing[successor]).any():
        limits.check_time("exploration")
        limits.check_memory("exploration", _EDGE * len(owner))
        at, edges = _onward(space, successor, through)
        joined = draws.joined(draw[at], space.edge_draw[edges].astype(np.int64))
        owner = np.concatenate([owner[~through], owner[at]])
        draw = np.concatenate([draw[~through], joined])
        successor = np.concatenate([successor[~through], space.edge_successor[edges].astype(np.int64)])
    order = np.argsort(owner, kind="stable")
    number, choice_number = np.cumsum(~passing) - 1, np.cumsum(kept) - 1
    return replace(
        space,
        goal=space.goal[~passing],
        fringe=space.fringe[~passing],
        states=space.states[~passing],
        choice_state=number[space.choice_state[kept]].astype(np.int32),
        choice_action=space.choice_action[kept],
        edge_choice=choice_number[owner[order]].astype(np.int32),
        edge_successor=number[successor[order]].astype(np.int32),
        edge_draw=draw[order].astype(np.int32),
        draws=tuple(draws.all),
        initial=tuple((probability, int(number[state])) for probability, state in space.initial),
    )


def onward_pairs(branching: Branching, passing: Flags, choices: Index) -> tuple[Index, Index]:
    """Where some choices lead once something is decided again: pairs of the place among the choices and the
    state, each once, in order."""
    owner = np.repeat(np.arange(len(choices)), branching.edge_counts(choices))
    successor = branching.edge_successor[branching.edges_of(choices)].astype(np.int64)
    while (through := passing[successor]).any():
        at, edges = _onward(branching, successor, through)
        owner = np.concatenate([owner[~through], owner[at]])
        successor = np.concatenate([successor[~through], branching.edge_successor[edges].astype(np.int64)])
        owner, successor = np.divmod(np.unique(owner * len(passing) + successor), len(passing))
    return owner, successor


def _onward(branching: Branching, successor: Index, through: Flags) -> tuple[Index, Index]:
    """Of edges that lead to states with one choice or none: their places, once for every edge of that choice,
    and these edges."""
    places = np.flatnonzero(through)
    choices = branching.choices_of(successor[places])
    states = int(successor.max(initial=-1)) + 1
    owners = np.repeat(places, np.bincount(branching.choice_state, minlength=states)[successor[places]])
    return np.repeat(owners, branching.edge_counts(choices)), branching.edges_of(choices)


class _Draws:
    """The draws of a space, and those that are made of two that follow each other."""

    def __init__(self, space: StateSpace) -> None:
        self.all = list(space.draws)
        self._known: dict[Draw, int] = {}

    def joined(self, first: Index, second: Index) -> Index:
        """The numbers of what happens by both."""
        pairs, places = np.unique(first << 31 | second, return_inverse=True)
        numbers = [self._number(pair >> 31, pair & (1 << 31) - 1) for pair in pairs.tolist()]
        found: Index = np.array(numbers, dtype=np.int64)[places.reshape(-1)]
        return found

    def _number(self, first: int, second: int) -> int:
        one, two = self.all[first], self.all[second]
        draw = Draw(one.probability * two.probability, one.cost + two.cost, one.reward + two.reward)
        number = self._known.setdefault(draw, len(self.all))
        if number == len(self.all):
            self.all.append(draw)
        return number
