"""Exploration: the states of a task that any policy can reach, as a Markov decision process.

States are those of the paper without latches: a truth value for every variable. Goal states are
final. States are expanded many at a time, in any order; results are exact, with outcomes kept by
number and their probabilities as rationals.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bbtc.belief.draws import Values
from bbtc.belief.state import initial_belief
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import BitTest, Flags, Words, bit_test, every, holds
from bbtc.planner.mdp.state_space import StateSpace, ranges
from bbtc.planner.mdp.state_table import StateTable
from bbtc.planner.mdp.transitions import ActionTables, Index

_CELLS = 1 << 19  # array cells worked on at a time
_EDGE = 400  # bytes that an edge takes, for a word, while it is found
_LEAST_ROOM = 4 << 20  # bytes of memory without which no state is expanded


@dataclass(slots=True)
class _Column:
    """An array that grows by pieces."""

    dtype: type[np.int32] | type[np.int64] | type[np.bool_]
    pieces: list[npt.NDArray[np.generic]] = field(default_factory=list)

    def add(self, piece: npt.NDArray[np.generic]) -> None:
        self.pieces.append(piece.astype(self.dtype, copy=False))

    def joined(self) -> npt.NDArray[np.generic]:
        """All of it, as one array that must not be written to."""
        if len(self.pieces) != 1:
            self.pieces = [np.concatenate([np.empty(0, dtype=self.dtype), *self.pieces])]
        return self.pieces[0]


class Choices(NamedTuple):
    """Some choices: the state, action and number of edges of each, and of their edges, one choice's
    after the other's, the state they lead to and the draw."""

    owner: Index
    action: Index
    edges: Index
    successor: Index
    draw: Index


class Explorer:
    """A state space while it grows from the initial belief of a task."""

    def __init__(self, task: Task, limits: Limits) -> None:
        self.task = task
        self.tables = ActionTables(task, limits)
        self.packing = self.tables.packing
        self._by_reference = np.zeros(self.tables.count_steps, dtype=np.bool_)
        self._by_reference[list(self.tables.by_reference)] = True
        self.table = StateTable(self.packing.words)
        self._goal_test: BitTest = bit_test(self.packing, task.goal)
        if self.packing.stage_bits:
            self._goal_test = every((self.packing.in_stage(0), self._goal_test))
        self._goal = _Column(np.bool_)
        self._tested = 0
        self._in_order = True
        self._last = -1
        self._owner, self._action = _Column(np.int32), _Column(np.int32)
        self._edges, self._successor, self._draw = _Column(np.int64), _Column(np.int32), _Column(np.int32)
        self.choices = self.edges = 0
        self._most_edges = 1  # of a state, on average over a batch
        self._step = max(1, _CELLS // (32 * self.tables.width))
        belief = initial_belief(task)
        numbers = self.table.number(self.packing.split(self.packing.pack(values) for values in belief))
        self.initial = tuple(zip(belief.values(), map(int, numbers), strict=True))

    @property
    def count(self) -> int:
        """How many states were found."""
        return self.table.count

    def goal(self) -> Flags:
        """Which of the states found are in the goal."""
        if self._tested < self.count:
            fresh = self.table.states[self._tested : self.count]
            self._goal.add(holds(self.packing, self._goal_test, fresh))
            self._tested = self.count
        return np.asarray(self._goal.joined(), dtype=np.bool_)

    def expand(self, numbers: Index, limits: Limits) -> int:
        """Expand states, none of them twice; how many of them were expanded before a limit was met.
        Goal states get no choices. Raises ``LimitReached`` if none was."""
        done = 0
        try:
            while done < len(numbers):
                limits.check_states(self.count, "exploration")
                limits.check_time("exploration", self.count)
                limits.check_memory("exploration", self.ahead() + _LEAST_ROOM)
                end = min(len(numbers), done + min(self._step, self._room(limits)))
                work = self._expand(numbers[done:end])
                done = end
                # As many states at a time as give arrays of some size, whatever their branching.
                self._step = max(1, min(2 * self._step, self._step * _CELLS // max(1, work)))
        except LimitReached:
            if not done:
                raise
        return done

    def exhaust(self, limits: Limits) -> None:
        """Expand all that was found, and all that it leads to; what was expanded so far was so in order.
        Raises ``LimitReached``."""
        while self._last + 1 < self.count:
            self.expand(np.arange(self._last + 1, self.count), limits)

    def also_start(self, states: Iterable[Values]) -> None:
        """Count some states as found."""
        self.table.number(self.packing.split(self.packing.pack(values) for values in states))

    def _room(self, limits: Limits) -> int:
        """As many states as may be expected to fit into what the limits leave."""
        room = (limits.states - self.count) // self._most_edges
        free = limits.memory_left
        if free is not None:
            room = min(room, (free - self.ahead()) // (_EDGE * self.packing.words * self._most_edges))
        return max(1, room)

    def ahead(self) -> int:
        """About how many bytes it will take to make a space of what was found, and to solve it."""
        per_state = 8 * self.packing.words + 30
        return per_state * self.count + 30 * self.choices + 35 * self.edges

    def _expand(self, numbers: Index) -> int:
        """Append the choices and edges of some states, and number their successors; the array
        cells it took."""
        states = self.table.states[numbers]
        live = np.flatnonzero(~holds(self.packing, self._goal_test, states))
        rows, actions = self.tables.applicable(states[live])
        rows = live[rows]
        counts = self.tables.count[actions]
        owner = np.repeat(np.arange(len(rows)), counts)
        ends = np.cumsum(counts)
        outcomes = self.tables.first[actions][owner] + (np.arange(len(owner)) - (ends - counts)[owner])
        after = self.tables.successors(states, rows[owner], outcomes)
        draws = self.tables.drawn(states, rows[owner], outcomes)
        if self.tables.by_reference:
            owner, draws, after = self._with_reference(states, rows, actions, (owner, draws, after))
        # A choice is kept if it may leave its state.
        moves = (after != states[rows[owner]]).any(axis=1)
        kept = np.zeros(len(rows), dtype=np.bool_)
        kept[owner[moves]] = True
        edges = kept[owner]
        self._successor.add(self.table.number(after[edges]))
        self._draw.add(draws[edges])
        self._edges.add(np.bincount(owner[edges], minlength=len(rows))[kept])
        self._action.add(actions[kept])
        owners = numbers[rows[kept]]
        self._owner.add(owners)
        self._in_order = self._in_order and int(numbers[0]) > self._last
        self._last = int(numbers[-1])
        self.choices += len(owners)
        added = int(edges.sum())
        self.edges += added
        self._most_edges = max(self._most_edges, -(-added // len(numbers)))
        return self.packing.words * 8 * (len(numbers) + len(owner))

    def _with_reference(
        self, states: Words, rows: Index, actions: Index, edges: tuple[Index, Index, Words]
    ) -> tuple[Index, Index, Words]:
        """The edges (choice, draw, state after) with those of actions that are run as the
        simulator runs them."""
        owners, numbers, packed = [], [], []
        values = self.packing.values(states)
        for choice in np.flatnonzero(self._by_reference[actions]).tolist():
            for bits, number in self.tables.reference_results(values[rows[choice]], int(actions[choice])):
                owners.append(choice)
                numbers.append(number)
                packed.append(bits)
        owner = np.concatenate([edges[0], np.array(owners, dtype=np.int64)])
        draws = np.concatenate([edges[1], np.array(numbers, dtype=np.int64)])
        after = np.concatenate([edges[2], self.packing.split(packed)])
        order = np.argsort(owner, kind="stable")
        return owner[order], draws[order], after[order]

    def mark(self) -> int:
        """A moment in the exploration, for :meth:`since`; void once a space was made."""
        return len(self._owner.pieces)

    def since(self, mark: int) -> Choices:
        """The choices found since a moment."""
        columns = (self._owner, self._action, self._edges, self._successor, self._draw)
        empty = np.empty(0, dtype=np.int32)
        owner, action, edges, successor, draw = (
            np.concatenate([empty, *column.pieces[mark:]]).astype(np.int64) for column in columns
        )
        return Choices(owner, action, edges, successor, draw)

    def space(self, fringe: Flags, stop: Diagnostic | None) -> StateSpace:
        """What was found so far; ``fringe`` says which states count as not expanded."""
        owner = np.asarray(self._owner.joined(), dtype=np.int32)
        action = np.asarray(self._action.joined(), dtype=np.int32)
        edge_count = np.asarray(self._edges.joined(), dtype=np.int64)
        successor = np.asarray(self._successor.joined(), dtype=np.int32)
        draw = np.asarray(self._draw.joined(), dtype=np.int32)
        if not self._in_order:  # sort the choices by state
            order = np.argsort(owner, kind="stable")
            firsts = np.cumsum(edge_count) - edge_count
            edges = ranges(firsts[order], edge_count[order])
            owner, action, edge_count = owner[order], action[order], edge_count[order]
            successor, draw = successor[edges], draw[edges]
        return StateSpace(
            task=self.task,
            packing=self.packing,
            states=self.table.states.copy(),
            goal=self.goal(),
            fringe=fringe,
            choice_state=owner,
            choice_action=action,
            edge_choice=np.repeat(np.arange(len(owner), dtype=np.int32), edge_count),
            edge_successor=successor,
            edge_draw=draw,
            draws=tuple(self.tables.draws),
            initial=self.initial,
            stop=stop,
        )


def explore_space(task: Task, limits: Limits, depth: int | None = None) -> StateSpace:
    """Everything reachable from the initial belief, by at most ``depth`` actions if given.

    Never raises for a limit: the space then has unexpanded states and says what stopped it.
    """
    explorer = Explorer(task, limits)
    stop: Diagnostic | None = None
    done = steps = 0
    levels = None if depth is None else depth * explorer.tables.levels
    try:
        while done < explorer.count and (levels is None or steps < levels):
            level_end = explorer.count
            while done < level_end:
                done += explorer.expand(np.arange(done, level_end), limits)
            steps += 1
    except LimitReached as reached:
        stop = reached.diagnostics[0]
    fringe = np.arange(explorer.count) >= done
    return explorer.space(fringe & ~explorer.goal(), stop)
