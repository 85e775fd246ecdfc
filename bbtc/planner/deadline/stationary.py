"""Policies that read no clock, for success by a deadline.

With time left as part of the state, the best policy may do one thing early and another late. A tree that
reads no clock does one thing in each state: at first what the best policy does there most often, then,
state by state, what is better, as long as anything is (coordinate ascent; Littman 1994 on memoryless
policies).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction

import numpy as np

from bbtc.diagnostics import LimitReached
from bbtc.limits import Limits
from bbtc.planner.deadline.induction import Induction, induction, weights
from bbtc.planner.deadline.process import TimedProcess

_BETTER = 1e-9


def stationary(
    process: TimedProcess, found: Induction, step: Fraction, limits: Limits
) -> Iterator[list[int]]:
    """Policies, each better than the one before, as lists of choices, one for each state that needs one. Ends
    where a limit is met."""
    with suppress(LimitReached):
        yield from _ascent(process, found, step, limits)


def _ascent(process: TimedProcess, found: Induction, step: Fraction, limits: Limits) -> Iterator[list[int]]:
    most = len(found.values) - 1
    often = weights(process, found, step, limits)
    offered = _offered(process, found)
    chosen = {state: max(choices, key=lambda c: (often[c], -c)) for state, choices in offered.items()}

    def value() -> float:
        one = induction(process, step, most, limits, late=True, only=sorted(chosen.values()))
        return one.at_start(process)

    best = value()
    yield sorted(chosen.values())
    undecided = [state for state, choices in offered.items() if len(choices) > 1]
    undecided.sort(key=lambda state: -sum(often[choice] for choice in offered[state]))
    improved = True
    while improved:
        improved = False
        for state in undecided:
            for choice in offered[state]:
                before = chosen[state]
                if choice == before:
                    continue
                chosen[state] = choice
                tried = value()
                if tried > best + _BETTER:
                    best, improved = tried, True
                    yield sorted(chosen.values())
                else:
                    chosen[state] = before


def _offered(process: TimedProcess, found: Induction) -> dict[int, list[int]]:
    """For each state, the choices that are best there at some time; where the deadline is lost, any that may
    still lead to the goal would do, and none is needed."""
    offered: dict[int, list[int]] = {}
    owner = process.space.choice_state
    for choice in np.unique(found.best[found.best >= 0]).tolist():
        offered.setdefault(int(owner[choice]), []).append(choice)
    return offered
