"""What is told of the time that a tree takes: expectations, quantiles, the curve of success by a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

from bbtc import durations
from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain
from bbtc.diagnostics import BbtcError
from bbtc.durations import Bounds
from bbtc.ground.task import ZERO, Task
from bbtc.limits import Limits
from bbtc.timing.chain import Happening, Untimed, happenings, timed, untimed_actions
from bbtc.timing.curve import Curve, curves
from bbtc.tree.nodes import SuccessBy

SHARES = (Fraction(1, 2), Fraction(9, 10), Fraction(95, 100), Fraction(99, 100))
"""Of the runs that succeed: by when so many of them have."""

_MOST_STEPS = 4000
_STEPS = 200  # of the expected time, where durations leave open what a step is
_REST = Fraction(1, 1000)  # of success, that comes after the end of the curve
_TEN = Fraction(10)
_NICE = (Fraction(1), Fraction(2), Fraction(5))


@dataclass(frozen=True, slots=True)
class Quantile:
    """``share`` of the runs that succeed have done so within some time of these bounds, and not sooner; None:
    after the end of the curve."""

    share: Fraction
    least: Fraction
    most: Fraction | None


@dataclass(frozen=True, slots=True)
class TimeFigures:
    """Seconds that a tree takes: expectations (None: infinite, or, given success, there is none), quantiles,
    and the curve. ``untimed`` are actions that do not say how long they take, and count as taking no time."""

    expected: Bounds | None
    given_success: Bounds | None
    quantiles: tuple[Quantile, ...]
    curve: Curve
    untimed: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Times:
    """The time of a tree: its figures, or why they are not told; and the ways in which actions take time."""

    figures: TimeFigures | None
    untold: str | None
    ways: tuple[tuple[Happening, ...], ...] = ()


def times(
    task: Task, chain: Chain, success: Fraction, limits: Limits, step: Fraction | None = None
) -> Times | None:
    """The time that a tree takes, in steps of so many seconds; None where no action says how long it takes.
    Raises :class:`bbtc.diagnostics.LimitReached`."""
    if not timed(task):
        return None
    try:
        ways = happenings(task, chain, limits)
    except Untimed as reason:
        return Times(None, str(reason))
    expected, given = _expectations(chain, ways, success)
    step = step or step_of(ways, given)
    enough = float(success * (1 - _REST))
    curve = curves(chain, ways, step, _MOST_STEPS, limits, enough=enough, success=success)
    quantiles = tuple(_quantile(curve, share, success) for share in SHARES) if success else ()
    figures = TimeFigures(expected, given, quantiles, curve, untimed_actions(task, chain))
    return Times(figures, None, ways)


def success_by(task: Task, chain: Chain, seconds: Fraction, limits: Limits) -> SuccessBy:
    """Bounds of the probability that a tree succeeds within so many seconds. Raises :class:`BbtcError`
    where it is not known how long actions take, and :class:`bbtc.diagnostics.LimitReached`."""
    if not timed(task):
        raise unknown("no action has a `:duration`")
    try:
        ways = happenings(task, chain, limits)
    except Untimed as reason:
        raise unknown(str(reason)) from None
    step = whole_step(ways, seconds)
    least, most = curves(chain, ways, step, int(seconds / step), limits).by(seconds)
    return SuccessBy(seconds, Fraction(least), Fraction(most))


def unknown(why: str) -> BbtcError:
    """An error: success by a deadline is asked for, and the time of actions is not known."""
    return BbtcError.single("BBT0446", f"success by a deadline cannot be told: {why}")


def whole_step(ways: Sequence[Sequence[Happening]], seconds: Fraction, steps: int = 600) -> Fraction:
    """A step of which the time is a multiple, and all durations, if that takes few steps."""
    common = common_step(ways)
    if common is not None:
        common = _gcd(common, seconds)
        if seconds / common <= _MOST_STEPS:
            return common
    return seconds / steps


def _expectations(
    chain: Chain, ways: Sequence[Sequence[Happening]], success: Fraction
) -> tuple[Bounds | None, Bounds | None]:
    absorption = Absorption(chain)
    visits = absorption.visits()
    wins = absorption.hitting({state: chain.won(state) for state in chain.final if chain.won(state)})
    overall, won = [ZERO, ZERO], [ZERO, ZERO]
    for state, each in enumerate(ways):
        often = visits[state]
        for way in each if often else ():
            weight = (often or ZERO) * way.chance
            hope = sum((probability * wins[target] for target, probability in way.moves), ZERO)
            for end, seconds in enumerate(way.mean):
                overall[end] += weight * seconds
                won[end] += weight * seconds * hope
    expected = None if absorption.endless and absorption.entering() else (overall[0], overall[1])
    return expected, (won[0] / success, won[1] / success) if success else None


def _quantile(curve: Curve, share: Fraction, success: Fraction) -> Quantile:
    wanted = share * success
    least = next((n for n, p in enumerate(curve.early) if Fraction(p) >= wanted), len(curve.early))
    most = next((n for n, p in enumerate(curve.late) if Fraction(p) >= wanted), None)
    return Quantile(share, least * curve.step, None if most is None else most * curve.step)


# --- steps ---------------------------------------------------------------------------------------


def step_of(ways: Sequence[Sequence[Happening]], expected: Bounds | None) -> Fraction:
    """The step that shows a tree best: what all durations are multiples of, if these are few; else a short
    number of which some hundred make up the expected time."""
    mean = max(expected[1], Fraction(1, 10**6)) if expected is not None else Fraction(1)
    common = common_step(ways)
    if common is not None and mean / common <= _STEPS:
        return common
    return nice(mean / _STEPS)


def common_step(ways: Sequence[Sequence[Happening]]) -> Fraction | None:
    """The greatest number of seconds that all durations are multiples of; None where there is none."""
    common: Fraction | None = None
    for way in (way for each in ways for way in each):
        values = durations.lattice(way.duration)
        if values is None:
            return None
        for value in values:
            if value and (way.at_most is None or value <= way.at_most):
                common = value if common is None else _gcd(common, value)
    return common


def _gcd(first: Fraction, second: Fraction) -> Fraction:
    below = lcm(first.denominator, second.denominator)
    return Fraction(gcd(int(first * below), int(second * below)), below)


def nice(value: Fraction) -> Fraction:
    """The next of …, 0.1, 0.2, 0.5, 1, 2, 5, 10, … from a number on."""
    exponent = math.floor(math.log10(value))
    tried = (each * _TEN ** (exponent + more) for more in range(-1, 3) for each in _NICE)
    return next(each for each in tried if each >= value)
