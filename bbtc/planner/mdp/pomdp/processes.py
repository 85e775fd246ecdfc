"""Markov decision processes from lists of numbers, to be solved like those of tasks."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from bbtc.ground.task import ZERO, Task
from bbtc.planner.mdp.packing import Flags, Packing
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.planner.mdp.transitions import Draw


class Choice(NamedTuple):
    """An action in a state: states after, with probabilities."""

    state: int
    after: Sequence[int]
    probability: Sequence[float]


def process(task: Task, goal: Flags, choices: Sequence[Choice]) -> StateSpace:
    """The process with these choices, which are ordered by state."""
    counts = np.array([len(each.after) for each in choices], dtype=np.int64)
    probabilities = np.array([p for each in choices for p in each.probability])
    kinds, draw = np.unique(probabilities, return_inverse=True)
    return StateSpace(
        task=task,
        packing=Packing.of(task),
        states=np.zeros((len(goal), 1), dtype=np.uint64),
        goal=goal,
        fringe=np.zeros(len(goal), dtype=np.bool_),
        choice_state=np.array([each.state for each in choices], dtype=np.int32),
        choice_action=np.zeros(len(choices), dtype=np.int32),
        edge_choice=np.repeat(np.arange(len(choices), dtype=np.int32), counts),
        edge_successor=np.array([state for each in choices for state in each.after], dtype=np.int32),
        edge_draw=draw.astype(np.int32),
        draws=tuple(Draw(Fraction(float(kind)), ZERO, ZERO) for kind in kinds),
        initial=(),
        stop=None,
    )
