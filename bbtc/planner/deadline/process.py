"""The task as a Markov decision process in which choices take time (a semi-Markov one: Howard 1971)."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc import durations
from bbtc.durations import Taken
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.mdp.contraction import contracted
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.timing.chain import Doing, Happening

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TimedProcess:
    """The states that any policy can reach, and for each choice of them the ways in which it takes time."""

    space: StateSpace
    ways: tuple[tuple[Happening, ...], ...]

    def soonest(self) -> Fraction | None:
        """The least number of seconds within which any run can reach the goal; None where none can."""
        best: dict[int, Fraction] = {}
        queue = [(Fraction(0), state) for _, state in self.space.initial]
        heapq.heapify(queue)
        choices: list[list[int]] = [[] for _ in self.space.goal]
        for choice, state in enumerate(self.space.choice_state.tolist()):
            choices[state].append(choice)
        while queue:
            seconds, state = heapq.heappop(queue)
            if state in best:
                continue
            if self.space.goal[state]:
                return seconds
            best[state] = seconds
            for way in (way for choice in choices[state] for way in self.ways[choice]):
                later = seconds + durations.shortest(way.duration)
                for target, _ in way.moves:
                    if target not in best:
                        heapq.heappush(queue, (later, target))
        return None


def timed_process(task: Task, limits: Limits) -> TimedProcess:
    """The process of a task. Raises :class:`bbtc.timing.chain.Untimed`, and ``LimitReached`` where it has too
    many states."""
    space = explore_space(task, limits)
    space.require_complete()
    space = contracted(space, limits)
    values = space.packing.values(space.states)
    number = {each: state for state, each in enumerate(values)}
    doings: dict[int, Doing] = {}
    found = []
    for choice, state in enumerate(space.choice_state.tolist()):
        if choice % 1024 == 0:
            limits.check_time("exploration in time", choice)
        action = int(space.choice_action[choice])
        if action not in doings:
            doings[action] = Doing(task, task.actions[action], limits)
        found.append(doings[action].ways_from(values[state], number))
    return TimedProcess(space, tuple(found))


@dataclass(frozen=True, slots=True)
class Group:
    """All ways of one duration: of which choices, with what chance, to which states; and that in steps."""

    choices: npt.NDArray[np.int64]
    targets: npt.NDArray[np.int64]
    chances: Floats
    steps: Floats


def groups(
    process: TimedProcess, step: Fraction, most: int, *, late: bool, only: Sequence[int] | None = None
) -> list[Group]:
    """The ways of all choices, or of some, by what they take."""
    rows: dict[tuple[Taken, Fraction | None], list[tuple[int, int, float]]] = {}
    for choice in range(len(process.ways)) if only is None else only:
        for way in process.ways[choice]:
            entries = rows.setdefault((way.duration, way.at_most), [])
            entries += [(choice, target, float(way.chance * p)) for target, p in way.moves]
    found = []
    for (duration, at_most), entries in rows.items():
        steps = durations.in_steps(duration, step, most, late=late, at_most=at_most)
        choices, targets, chances = zip(*entries, strict=True)
        found.append(
            Group(
                np.array(choices, dtype=np.int64),
                np.array(targets, dtype=np.int64),
                np.array(chances, dtype=np.float64),
                np.array([float(p) for p in steps]),
            )
        )
    return found
