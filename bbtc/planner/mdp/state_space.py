"""Markov decision processes (MDPs) in flat arrays: which choices states have, and where each may lead."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.planner.mdp.packing import Flags, Packing, Words
from bbtc.planner.mdp.transitions import Draw, Index

Number: TypeAlias = npt.NDArray[np.int32]
"""Numbers of states or choices."""


_FEW = 16  # states whose successors are found one by one
_MOST_LISTED = 200_000  # edges


class _Lists(NamedTuple):
    """Where the choices of each state begin, where the edges of each choice begin, and where edges lead."""

    choices: list[int]
    edges: list[int]
    successor: list[int]


@dataclass(frozen=True, slots=True, eq=False)
class Branching:
    """The graph of a Markov decision process. Every choice belongs to a state and is an action (its number in
    the task); every edge belongs to a choice and leads to a state. Choices stand in the order of their
    states, and edges in that of their choices; ``goal`` tells which states are in the goal."""

    goal: Flags
    choice_state: Number
    choice_action: Number
    edge_choice: Number
    edge_successor: Number
    _choice_first: Index = field(init=False, repr=False)
    _edge_first: Index = field(init=False, repr=False)
    _lists: list[_Lists] = field(init=False, repr=False, default_factory=list)
    """What :meth:`closure` reads, once it was called; at most one."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "_choice_first", _firsts(self.choice_state, len(self.goal)))
        object.__setattr__(self, "_edge_first", _firsts(self.edge_choice, len(self.choice_action)))

    def choices_of(self, states: Index | Number) -> Index:
        """The choices of some states, one state's after the other's."""
        first = self._choice_first[states]
        return ranges(first, self._choice_first[states + 1] - first)

    def edges_of(self, choices: Index | Number) -> Index:
        """The edges of some choices, one choice's after the other's."""
        first = self._edge_first[choices]
        return ranges(first, self._edge_first[choices + 1] - first)

    def edge_counts(self, choices: Index | Number) -> Index:
        """How many edges each of some choices has."""
        found: Index = self._edge_first[choices + 1] - self._edge_first[choices]
        return found

    def having(self, choices: Flags | None = None) -> Flags:
        """The states that have any of some choices (by default: any at all)."""
        found = np.zeros(len(self.goal), dtype=np.bool_)
        found[self.choice_state if choices is None else self.choice_state[choices]] = True
        return found

    def successors(self, states: Index, taken: Flags) -> Index:
        """The states that choices of ``taken`` may lead to from some states, in order."""
        choices = self.choices_of(states)
        return np.unique(self.edge_successor[self.edges_of(choices[taken[choices]])]).astype(np.int64)

    def closure(self, start: Index, taken: Flags) -> Index:
        """The states that runs may visit if they take only choices of ``taken``, those nearest to the start
        first."""
        seen = np.zeros(len(self.goal), dtype=np.bool_)
        found: list[Index] = []
        frontier = start
        while len(frontier):
            seen[frontier] = True
            found.append(frontier)
            few = len(frontier) <= _FEW and len(self.edge_choice) <= _MOST_LISTED
            after = self._few_successors(frontier, taken) if few else self.successors(frontier, taken)
            frontier = after[~seen[after]]
        return np.concatenate([start[:0], *found])

    def _few_successors(self, states: Index, taken: Flags) -> Index:
        """The same as :meth:`successors`, faster for few states."""
        if not self._lists:
            ends = (self._choice_first, self._edge_first, self.edge_successor)
            self._lists.append(_Lists(*(each.tolist() for each in ends)))
        choices, edges, successor = self._lists[0]
        found: set[int] = set()
        for state in states.tolist():
            for choice in range(choices[state], choices[state + 1]):
                if taken[choice]:
                    found.update(successor[edges[choice] : edges[choice + 1]])
        return np.array(sorted(found), dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class StateSpace(Branching):
    """The states of a task that any policy can reach, or a part of them. Choices that never leave their
    state are left out.

    ``fringe`` are the states that were found, but not expanded, because of a limit (``stop``) or the
    depth asked for, or because they did not seem to matter.
    """

    task: Task
    packing: Packing
    states: Words
    fringe: Flags
    edge_draw: Number
    draws: tuple[Draw, ...]
    initial: tuple[tuple[Fraction, int], ...]
    stop: Diagnostic | None

    @property
    def passing(self) -> Flags:
        """The states in which nothing is decided (:mod:`bbtc.planner.mdp.passing`)."""
        return self.packing.passing(self.states)

    @property
    def decided(self) -> Flags:
        """The choices that are actions."""
        found: Flags = self.choice_action < len(self.task.actions)
        return found

    @property
    def expanded(self) -> int:
        """How many states were expanded (goal states among them)."""
        return len(self.fringe) - int(self.fringe.sum())

    @property
    def complete(self) -> bool:
        """Was everything reachable found?"""
        return not self.fringe.any()

    def require_complete(self) -> None:
        """Raises ``LimitReached`` for the limit that left a part of it out, if one did."""
        if self.stop is not None:
            raise LimitReached([self.stop])

    @property
    def start(self) -> Index:
        """The initial states, in order."""
        return np.unique([state for _, state in self.initial]).astype(np.int64)

    def outcomes(self, choice: int) -> Iterator[tuple[int, int]]:
        """Where a choice may lead, and the number of the draw that does."""
        first, end = self._edge_first[choice : choice + 2].tolist()
        return zip(self.edge_successor[first:end].tolist(), self.edge_draw[first:end].tolist(), strict=True)


def ranges(firsts: Index, counts: Index) -> Index:
    """The concatenation of ``range(first, first + count)`` over all pairs."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    found: Index = np.arange(total) + np.repeat(firsts - (ends - counts), counts)
    return found


def _firsts(owners: Number, count: int) -> Index:
    """Where what each of ``count`` owners has begins in a list ordered by owner, and the end."""
    firsts = np.zeros(count + 1, dtype=np.int64)
    np.cumsum(np.bincount(owners, minlength=count), out=firsts[1:])
    return firsts
