"""The optimality equations of a part of a Markov decision process: floats guess their solution, policy
iteration over rationals (Howard 1960) makes it exact.

The value x of a state of the part is that of its best choice: the greatest sum, over a choice's outcomes, of
probability · (reward of the outcome + x of the successor). Outside the part, x is 1 in the states that are
won and else 0. MaxProb has no rewards; a least cost is the greatest reward where costs are negative rewards.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from bbtc.ground.task import ONE, ZERO
from bbtc.limits import Limits
from bbtc.markov import Row, solve, weighted
from bbtc.planner.mdp.graph import Floats, Graph, draw_probabilities, sums
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Number
from bbtc.rounding import rounded

_TIE = 1e-9  # floats closer than this may be equal
_MOST_WORK = 400_000  # elimination steps of one loop of states
_DOING = "the exact solution"


class Equations:
    """The equations of the states of ``part``, which all have a choice. States and choices have numbers of
    their own, in order: ``states`` and ``choices`` give those of the space.

    ``won`` are the states with value 1, ``rewards`` those of each draw (0 by default); other choices than
    ``allowed`` (default: all) are never the best.
    """

    def __init__(
        self,
        graph: Graph,
        part: Flags,
        won: Flags,
        rewards: list[Fraction] | None = None,
        allowed: Flags | None = None,
    ) -> None:
        space = graph.space
        self.graph, self.won, self.rewards = graph, won, rewards
        self.states = np.flatnonzero(part)
        self.number = np.full(graph.states, -1, dtype=np.int64)
        self.number[self.states] = np.arange(len(self.states))
        self.choices = np.flatnonzero(part[graph.choice_state])
        self.choice_number = np.full(graph.choices, -1, dtype=np.int64)
        self.choice_number[self.choices] = np.arange(len(self.choices))
        self.choice_state = self.number[graph.choice_state[self.choices]]
        self.barred = np.flatnonzero(~allowed[self.choices]) if allowed is not None else self.choices[:0]
        edges = np.flatnonzero(self.choice_number[graph.edge_choice] >= 0)
        weight = draw_probabilities(space)[edges]
        owner = self.choice_number[graph.edge_choice[edges]]
        successor = space.edge_successor[edges]
        inner = part[successor]
        self.own = sums(owner, weight * won[successor], len(self.choices))
        """What each choice is worth by its rewards and what it wins outright."""
        if rewards is not None:
            floats = np.array([rounded(reward) for reward in rewards])
            self.own += sums(owner, weight * floats[space.edge_draw[edges]], len(self.choices))
        self.edge_choice, self.edge_successor = owner[inner], self.number[successor[inner]]
        self.weight = weight[inner]
        self.degree = int(np.bincount(owner).max()) if len(owner) else 0
        """Edges of the choice that has most."""
        # States come in order, and so do their choices: the first choice of each state.
        self.first = np.searchsorted(self.choice_state, np.arange(len(self.states)))

    def choice_values(self, values: Floats) -> Floats:
        """The Q-value of each choice, given the values of the states."""
        ahead = sums(self.edge_choice, self.weight * values[self.edge_successor], len(self.choices))
        found: Floats = self.own + ahead
        return found

    def update(self, values: Floats) -> Floats:
        """The Bellman update of every state: one step of value iteration."""
        found = self.choice_values(values)
        found[self.barred] = -np.inf
        best: Floats = np.maximum.reduceat(found, self.first)
        return best

    def ties(self, values: Floats) -> Flags:
        """Choices that attain the value of their state, as far as floats tell."""
        own = values[self.choice_state]
        near: Flags = self.choice_values(values) >= own - _TIE * np.maximum(1.0, np.abs(own))
        near[self.barred] = False
        return near

    def solve(self, policy: Number, limits: Limits) -> list[Fraction] | None:
        """The exact values by policy iteration, from a policy from which every run leaves the part in the
        end; it is improved in place (its numbers are those of the space), on strict improvement only. None
        if that is too much work. Raises ``LimitReached`` when the time is over."""
        if (policy[self.states] < 0).any():
            return None
        while True:
            rows: list[Row] = []
            constant: list[Fraction] = []
            for count, choice in enumerate(policy[self.states].tolist()):
                if count % 1024 == 0:
                    limits.check_time(_DOING)
                own, row = self._row(choice)
                constant.append(own)
                rows.append(row)
            values = solve(rows, constant, most_work=_MOST_WORK, look=lambda: limits.check_time(_DOING))
            if values is None or not self._improve(policy, values, limits):
                return values

    def exact_ties(self, values: list[Fraction]) -> Flags:
        """Choices that attain the value of their state."""
        ties = self.ties(np.array([rounded(value) for value in values]))
        for local in np.flatnonzero(ties).tolist():
            attained = self._exact_value(int(self.choices[local]), values)
            ties[local] = attained == values[int(self.choice_state[local])]
        return ties

    def _improve(self, policy: Number, values: list[Fraction], limits: Limits) -> bool:
        """Switch each state to its best choice where that is strictly better."""
        gain: dict[int, tuple[Fraction, int]] = {}
        near = np.flatnonzero(self.ties(np.array([rounded(value) for value in values])))
        for count, local in enumerate(near.tolist()):
            if count % 1024 == 0:
                limits.check_time(_DOING)
            choice, state = int(self.choices[local]), int(self.choice_state[local])
            if policy[self.states[state]] == choice:
                continue
            value = self._exact_value(choice, values)
            if value > gain.get(state, (values[state], -1))[0]:
                gain[state] = value, choice
        for state, (_, choice) in gain.items():
            policy[self.states[state]] = choice
        return bool(gain)

    def _exact_value(self, choice: int, values: list[Fraction]) -> Fraction:
        """What a choice (numbered as in the space) is worth, where its states have these values."""
        parts = []
        for p, reward, number in self._outcomes(choice):
            parts.append((p, reward))
            if number >= 0:
                parts.append((p, values[number]))
        return weighted(parts)

    def _row(self, choice: int) -> tuple[Fraction, Row]:
        """What a choice is worth for itself, and its probabilities."""
        own = []
        row: Row = {}
        for p, reward, number in self._outcomes(choice):
            own.append((p, reward))
            if number >= 0:
                row[number] = row[number] + p if number in row else p
        return weighted(own), row

    def _outcomes(self, choice: int) -> Iterator[tuple[Fraction, Fraction, int]]:
        """The probability of each outcome of a choice, its reward with what it wins outright, and its state
        if that is one of these, else -1."""
        space = self.graph.space
        for successor, draw in space.outcomes(choice):
            reward = ZERO if self.rewards is None else self.rewards[draw]
            number = int(self.number[successor])
            if number < 0 and self.won[successor]:
                reward = reward + 1 if reward else ONE
            yield space.draws[draw].probability, reward, number
