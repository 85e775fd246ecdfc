"""The states of a task that any policy can reach, as a Markov decision process in flat arrays.

States are those of the paper without latches: a truth value for every variable. Goal states are
final. Exploration is breadth first, whole frontiers at a time; results are exact, with outcomes
kept by number and their probabilities as rationals.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc.belief.state import initial_belief
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.space_actions import ActionTables, Draw, Index
from bbtc.plan.space_packing import Flags, Packing, Words, bit_test, holds
from bbtc.plan.space_table import StateTable

_CELLS = 1 << 20  # array cells worked on at a time


@dataclass(frozen=True, slots=True)
class StateSpace:
    """A Markov decision process. State s has the choices ``choice_first[s]:choice_first[s + 1]``,
    choice c the edges ``edge_first[c]:edge_first[c + 1]``. Choices that never leave their state
    are left out.

    States from ``expanded`` on were found, but not expanded, because of a limit (``stop``) or the
    depth asked for. ``levels[d]`` is the first state that takes ``d`` actions to reach.
    """

    task: Task
    packing: Packing
    states: Words
    goal: Flags
    expanded: int
    levels: tuple[int, ...]
    choice_first: Index
    choice_action: npt.NDArray[np.int32]
    edge_first: Index
    edge_target: npt.NDArray[np.int32]
    edge_draw: npt.NDArray[np.int32]
    draws: tuple[Draw, ...]
    initial: tuple[tuple[Fraction, int], ...]
    stop: Diagnostic | None

    @property
    def complete(self) -> bool:
        """Was everything reachable found?"""
        return self.expanded == len(self.states)

    def action_name(self, choice: int) -> str:
        """The name of the action of a choice."""
        return self.task.actions[int(self.choice_action[choice])].name


@dataclass(slots=True)
class _Explorer:
    task: Task
    packing: Packing
    tables: ActionTables
    table: StateTable
    choice_count: list[Index]
    choice_action: list[Index]
    edge_count: list[Index]
    edge_target: list[Index]
    edge_draw: list[Index]

    def expand(self, states: Words, goal: Flags) -> None:
        """Append the choices and edges of a run of states, and number their successors."""
        live = np.flatnonzero(~goal)
        rows, actions = self.tables.applicable(states[live])
        rows = live[rows]
        counts = self.tables.count[actions]
        owner = np.repeat(np.arange(len(rows)), counts)
        ends = np.cumsum(counts)
        outcomes = self.tables.first[actions][owner] + (np.arange(len(owner)) - (ends - counts)[owner])
        after = self.tables.successors(states, rows[owner], outcomes)
        if self.tables.by_reference:
            owner, outcomes, after = self._with_reference(states, rows, actions, (owner, outcomes, after))
        # A choice is kept if it may leave its state.
        moves = (after != states[rows[owner]]).any(axis=1)
        kept = np.zeros(len(rows), dtype=np.bool_)
        kept[owner[moves]] = True
        edges = kept[owner]
        self.edge_target.append(self.table.number(after[edges]))
        self.edge_draw.append(outcomes[edges])
        self.edge_count.append(np.bincount(owner[edges], minlength=len(rows))[kept])
        self.choice_action.append(actions[kept])
        self.choice_count.append(np.bincount(rows[kept], minlength=len(states)))

    def _with_reference(
        self, states: Words, rows: Index, actions: Index, edges: tuple[Index, Index, Words]
    ) -> tuple[Index, Index, Words]:
        """The edges (choice, outcome, state after) with those of actions that are run as the
        simulator runs them."""
        owners, numbers, packed = [], [], []
        for choice in np.flatnonzero(np.isin(actions, list(self.tables.by_reference))):
            results = self.tables.reference_results(states, int(rows[choice]), int(actions[choice]))
            for bits, number in results:
                owners.append(choice)
                numbers.append(number)
                packed.append(bits)
        owner = np.concatenate([edges[0], np.array(owners, dtype=np.int64)])
        outcomes = np.concatenate([edges[1], np.array(numbers, dtype=np.int64)])
        after = np.concatenate([edges[2], self.packing.split(packed)])
        order = np.argsort(owner, kind="stable")
        return owner[order], outcomes[order], after[order]


def explore_space(task: Task, limits: Limits, depth: int | None = None) -> StateSpace:
    """Everything reachable from the initial belief, by at most ``depth`` actions if given.

    Never raises for a limit: the space then has unexpanded states and says what stopped it.
    """
    packing = Packing.of(task)
    table = StateTable(packing.words)
    explorer = _Explorer(task, packing, ActionTables(task, packing), table, [], [], [], [], [])
    belief = initial_belief(task)
    numbers = table.number(packing.split(packing.pack(values) for values in belief))
    initial = tuple(zip(belief.values(), map(int, numbers), strict=True))
    goal_test = bit_test(packing, task.goal)
    goals: list[Flags] = []
    stop: Diagnostic | None = None
    levels = [0]
    step = max(1, _CELLS // explorer.tables.width)
    done = 0
    try:
        while done < table.count and (depth is None or len(levels) <= depth):
            level_end = table.count
            while done < level_end:
                limits.check_states(table.count, "exploration")
                limits.check_time("exploration")
                end = min(level_end, done + step)
                states = table.states[done:end].copy()
                goals.append(holds(packing, goal_test, states))
                explorer.expand(states, goals[-1])
                done = end
            levels.append(level_end)
    except LimitReached as reached:
        stop = reached.diagnostics[0]
    goals.append(holds(packing, goal_test, table.states[done:]))
    return StateSpace(
        task=task,
        packing=packing,
        states=table.states.copy(),
        goal=np.concatenate(goals),
        expanded=done,
        levels=tuple(levels),
        choice_first=_firsts(explorer.choice_count, table.count),
        choice_action=_joined(explorer.choice_action),
        edge_first=_firsts(explorer.edge_count, None),
        edge_target=_joined(explorer.edge_target),
        edge_draw=_joined(explorer.edge_draw),
        draws=tuple(explorer.tables.draws),
        initial=initial,
        stop=stop,
    )


def _joined(pieces: list[Index]) -> npt.NDArray[np.int32]:
    return np.concatenate(pieces).astype(np.int32) if pieces else np.empty(0, dtype=np.int32)


def _firsts(counts: list[Index], length: int | None) -> Index:
    """Start positions from counts, and the end; states not expanded have none."""
    count = np.concatenate(counts) if counts else np.empty(0, dtype=np.int64)
    firsts = np.zeros((len(count) if length is None else length) + 1, dtype=np.int64)
    np.cumsum(count, out=firsts[1 : len(count) + 1])
    firsts[len(count) + 1 :] = firsts[len(count)]
    return firsts
