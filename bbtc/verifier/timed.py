"""The time that a tree takes, recomputed without the simulator.

The task is copied with costs that tell what takes time: first how long each action takes on average, of
which the expected cost is the expected time; then a number of its own for each action, and another where it
is given up, by which every step of the explored program tells what it was. Success by a deadline is found
backwards: how probable it is with so many steps of time left, state by state, durations being rounded up,
and down.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from statistics import NormalDist

from typing_extensions import assert_never

from bbtc import durations
from bbtc.durations import Duration, Empirical, Fixed, LogNormal, Triangular, Uniform
from bbtc.ground.task import Factor, GroundAction, Outcome, Task, outcomes_of
from bbtc.limits import Limits
from bbtc.tree.nodes import Node, actions_of
from bbtc.verifier.chain import solvable_chain
from bbtc.verifier.explore import Space, explore
from bbtc.verifier.outcomes import MOST_BRANCHES, combinations
from bbtc.verifier.solve import recompute

_STEPS = 400
_STILL = 1e-14
_MOST_ROUNDS = 100_000
_COST = 1  # of the rewards of a step


@dataclass(frozen=True, slots=True)
class TimeFound:
    """Expected seconds, overall and given success (None: infinite, or undefined); with a deadline, bounds
    of the probability of success by then, but for rounding."""

    expected: Fraction | None
    given_success: Fraction | None
    by: tuple[float, float] | None = None


def time_found(task: Task, root: Node, limits: Limits, seconds: Fraction | None) -> TimeFound | None:
    """The time that a tree takes; None where it is not known, or an action has too many outcomes to tell
    which of them a time-out is. Raises ``LimitReached``."""
    used = {node.action for node in actions_of(root)}
    actions = [action for action in task.actions if action.name in used]
    if not all(map(_told, actions)) or (task.events and any(action.during is not None for action in actions)):
        return None
    if task.moves_by_time and any(map(_adds, outcomes_of(f for event in task.events for f in event.factors))):
        return None  # without what it adds, an event would have another rate
    own = recompute(explore(solvable_chain(_with_costs(task, _mean), root), limits), limits)
    if seconds is None:
        return TimeFound(own.cost, own.cost_given_success)
    number = {action.name: place for place, action in enumerate(actions, 1)}
    late = len(actions) + 1
    marked = _with_costs(
        task, lambda action, given_up: Fraction(number.get(action.name, 0) + (late if given_up else 0))
    )
    space = explore(solvable_chain(marked, root), limits)
    takes: dict[int, tuple[Duration, Fraction | None]] = {}
    for action in actions:
        mark, limit = number[action.name], action.timeout
        takes[mark] = (action.duration or durations.INSTANT, limit)
        if limit is not None:
            takes[late + mark] = (Fixed(limit), None)
    by = [_success_by(space, takes, seconds, limits, late=late_too) for late_too in (True, False)]
    return TimeFound(own.cost, own.cost_given_success, (by[0], by[1]))


def _adds(outcome: Outcome) -> bool:
    """Does it add to cost or reward?"""
    return bool(outcome.cost or outcome.reward or outcome.charges)


def _told(action: GroundAction) -> bool:
    """Is its time known, and told by single steps?"""
    if not any(outcome.timed_out for factor in action.factors for outcome in factor.outcomes):
        return True
    return action.duration is not None and combinations(action.factors) <= MOST_BRANCHES


def _mean(action: GroundAction, given_up: bool) -> Fraction:
    takes = action.duration or durations.INSTANT
    if given_up:
        assert action.timeout is not None
        return action.timeout
    if action.timeout is None:
        return durations.mean(takes)[0]
    return durations.partial_mean(takes, action.timeout)[0] / durations.within(takes, action.timeout)[0]


def _with_costs(task: Task, cost: Callable[[GroundAction, bool], Fraction]) -> Task:
    """The task in which an action costs what a function of it, and of whether it is given up, tells."""

    def of_outcome(outcome: Outcome, extra: Fraction) -> Outcome:
        inner = tuple(of_factor(factor, None) for factor in outcome.factors)
        return replace(outcome, cost=extra, charges=(), factors=inner)

    def of_factor(factor: Factor, action: GroundAction | None) -> Factor:
        late = any(outcome.timed_out for outcome in factor.outcomes)
        extras = (
            cost(action, outcome.timed_out) if action is not None and late else Fraction(0)
            for outcome in factor.outcomes
        )
        outcomes = (of_outcome(*each) for each in zip(factor.outcomes, extras, strict=True))
        return replace(factor, outcomes=tuple(outcomes))

    def of_action(action: GroundAction) -> GroundAction:
        late = any(outcome.timed_out for factor in action.factors for outcome in factor.outcomes)
        factors = tuple(of_factor(factor, action) for factor in action.factors)
        cost_of_start = Fraction(0) if late else cost(action, False)
        abort = tuple(of_factor(factor, None) for factor in action.on_abort)
        return replace(action, cost=cost_of_start, factors=factors, on_abort=abort)

    events = (
        replace(event, factors=tuple(of_factor(factor, None) for factor in event.factors))
        for event in task.events
    )
    return replace(task, metric="cost", actions=tuple(map(of_action, task.actions)), events=tuple(events))


# --- by a deadline -------------------------------------------------------------------------------


def _success_by(
    space: Space,
    takes: dict[int, tuple[Duration, Fraction | None]],
    seconds: Fraction,
    limits: Limits,
    *,
    late: bool,
) -> float:
    """The probability of success, from the first state, with all of the time left."""
    step = seconds / _STEPS
    spread = {mark: _spread(*each, step, late=late) for mark, each in takes.items()} | {0: [1.0]}
    rows = [
        [(float(each.probability), each.successor, spread[int(each.rewards[_COST])]) for each in steps]
        for ((_, steps),) in space.choices
    ]
    won = space.labels["success"] & space.labels["goal"]
    values = [[1.0 if state in won else 0.0] * (_STEPS + 1) for state in range(len(rows))]
    order = [state for state in reversed(range(len(rows))) if rows[state] and state not in won]
    for left in range(_STEPS + 1):
        limits.check_time("recomputing success by a deadline", left)
        for _ in range(_MOST_ROUNDS):
            change = 0.0
            for state in order:
                value = 0.0
                for p, after, taken in rows[state]:
                    value += p * sum(map(float.__mul__, taken, values[after][left::-1]))
                change = max(change, value - values[state][left])
                values[state][left] = value
            if change <= _STILL:
                break
    return values[0][_STEPS]


def _spread(duration: Duration, at_most: Fraction | None, step: Fraction, *, late: bool) -> list[float]:
    """How probably the duration takes 0, 1, 2, … steps, rounded up, or down."""
    sure = 1.0 if at_most is None else _until(duration, at_most, inclusive=True)
    if not sure:
        return []  # it is always given up
    before, found = 0.0, list[float]()
    for number in range(_STEPS + 1):
        end = step * number if late else step * (number + 1)
        over = at_most is not None and (end > at_most or (late and end == at_most))
        now = 1.0 if over else min(1.0, _until(duration, end, inclusive=late) / sure)
        found.append(max(0.0, now - before))
        before = max(before, now)
    return found


def _until(duration: Duration, end: Fraction, *, inclusive: bool) -> float:
    """How probably it takes less than so many seconds, or, if ``inclusive``, as many at most."""
    match duration:
        case Fixed(seconds):
            return float(_reached(seconds, end, inclusive))
        case Empirical(points):
            return float(sum(weight for seconds, weight in points if _reached(seconds, end, inclusive)))
        case Uniform(low, high):
            return 0.0 if end <= low else 1.0 if end >= high else float((end - low) / (high - low))
        case Triangular(low, mode, high):
            if not low < end < high:
                return float(end >= high)
            rising = end <= mode
            side, width = (end - low, mode - low) if rising else (high - end, high - mode)
            area = float(side * side / width / (high - low))
            return area if rising else 1 - area
        case LogNormal(median, sigma):
            normal = NormalDist(math.log(median), float(sigma))
            return 0.0 if end <= 0 else normal.cdf(math.log(end))
        case _:
            assert_never(duration)


def _reached(seconds: Fraction, end: Fraction, inclusive: bool) -> bool:
    return seconds < end or (inclusive and seconds == end)
