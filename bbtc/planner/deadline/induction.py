"""Backward induction over steps of time (Puterman, "Markov decision processes", 1994): the best probability
of reaching the goal with so many steps left, and the choices that attain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc.limits import Limits
from bbtc.planner.deadline.process import Floats, TimedProcess, groups
from bbtc.planner.mdp.state_space import Number

_MOST_ROUNDS = 10_000  # of choices that take no step
_STILL = 1e-15  # change of a value that is none


@dataclass(frozen=True, slots=True)
class Induction:
    """``values[k]`` are the probabilities with k steps left, by state, and ``best[k]`` choices that attain
    them (-1: none, or none is needed). ``settled``: every choice takes a step, so that nothing had to
    converge."""

    values: Floats
    best: Number
    settled: bool

    def at_start(self, process: TimedProcess) -> float:
        """The probability with all steps left, from the initial states."""
        return float(sum(float(p) * self.values[-1][state] for p, state in process.space.initial))


def induction(
    process: TimedProcess,
    step: Fraction,
    most: int,
    limits: Limits,
    *,
    late: bool,
    only: Sequence[int] | None = None,
) -> Induction:
    """The values with 0, 1, … ``most`` steps left, of all policies, or of those that take some choices only.
    Durations are rounded up if ``late``, else down. Raises ``LimitReached`` when the time is over."""
    space = process.space
    states, choices = len(space.goal), len(process.ways)
    parts = groups(process, step, most, late=late, only=only)
    values = np.zeros((most + 1, states))
    best = np.full((most + 1, states), -1, dtype=np.int32)
    goal = np.asarray(space.goal, dtype=np.float64)
    owner = np.asarray(space.choice_state, dtype=np.int64)
    allowed = np.ones(choices, dtype=np.bool_)
    if only is not None:
        allowed[:] = False
        allowed[list(only)] = True
    live = np.flatnonzero(allowed)
    waiting = any(part.steps[0] > 0 for part in parts)
    ahead = [np.zeros((most + 1, choices)) for _ in parts]
    for left in range(most + 1):
        if left % 16 == 0:
            limits.check_time("backward induction over time", left)
        attained = np.zeros(choices)
        for part, past in zip(parts, ahead, strict=True):
            width = min(len(part.steps) - 1, left)
            if width > 0:
                attained += part.steps[width:0:-1] @ past[left - width : left]
        now = goal.copy()
        for _ in range(_MOST_ROUNDS):
            total = attained
            if waiting:
                total = attained.copy()
                for part in parts:
                    if part.steps[0]:
                        total += part.steps[0] * _led(part.choices, part.chances * now[part.targets], choices)
            after = goal.copy()
            np.maximum.at(after, owner[live], total[live])
            settled = not waiting or float(np.max(np.abs(after - now), initial=0.0)) <= _STILL
            now = after
            if settled:
                break
        values[left] = now
        attaining = live[(total[live] >= now[owner[live]] - _STILL) & (total[live] > 0)]
        best[left, owner[attaining[::-1]]] = attaining[::-1]
        best[left, space.goal] = -1
        for part, past in zip(parts, ahead, strict=True):
            past[left] = _led(part.choices, part.chances * now[part.targets], choices)
    return Induction(values, best, not waiting)


def _led(choices: npt.NDArray[np.int64], weights: Floats, count: int) -> Floats:
    found = np.zeros(count)
    found += np.bincount(choices, weights, count)
    return found


def weights(process: TimedProcess, found: Induction, step: Fraction, limits: Limits) -> Floats:
    """How often the best choices are taken in a run with all steps left at the start, by choice."""
    most = len(found.values) - 1
    parts = groups(process, step, most, late=True)
    mass = np.zeros((most + 1, len(process.space.goal)))
    for p, state in process.space.initial:
        mass[most, state] += float(p)
    taken = np.zeros(len(process.ways))
    for left in range(most, -1, -1):
        if left % 16 == 0:
            limits.check_time("backward induction over time", left)
        moving = mass[left].copy()
        for _ in range(_MOST_ROUNDS):
            acting = np.flatnonzero((moving > 0) & (found.best[left] >= 0))
            if not len(acting):
                break
            chosen = np.zeros(len(process.ways))
            chosen[found.best[left, acting]] = moving[acting]
            taken += chosen
            moving = np.zeros_like(moving)
            for part in parts:
                flow = _led(part.targets, chosen[part.choices] * part.chances, len(moving))
                width = min(len(part.steps) - 1, left)
                if width > 0:
                    mass[left - width : left] += np.outer(part.steps[width:0:-1], flow)
                if part.steps[0]:
                    moving += part.steps[0] * flow
            if moving.sum() < _STILL:
                break
    return taken
