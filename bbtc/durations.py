"""How long something takes: distributions of seconds, exact where their formulas are rational.

A lognormal duration has irrational probabilities: what is told of it are bounds, rounded outward by
:data:`MARGIN`, which is a thousand times the error of the functions behind them. Everything that rests on it
is a bound, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal, localcontext
from fractions import Fraction
from functools import cache
from typing import TypeAlias

from typing_extensions import assert_never

LONGEST = Fraction(10**9)
"""Seconds that a duration may take at most, as stated (some 31 years)."""

WIDEST = Fraction(10)
"""The greatest ``sigma`` of a lognormal duration."""

MARGIN = Fraction(1, 10**12)
_ZERO, _ONE = Fraction(0), Fraction(1)
Bounds: TypeAlias = tuple[Fraction, Fraction]
"""A number from the first to the second; both are the same where it is known exactly."""


@dataclass(frozen=True, slots=True)
class Fixed:
    """Always the same."""

    seconds: Fraction


@dataclass(frozen=True, slots=True)
class Uniform:
    """Any from ``low`` to ``high``, all being as likely."""

    low: Fraction
    high: Fraction


@dataclass(frozen=True, slots=True)
class Triangular:
    """From ``low`` to ``high``, most likely ``mode``; the density rises and falls in straight lines."""

    low: Fraction
    mode: Fraction
    high: Fraction


@dataclass(frozen=True, slots=True)
class Empirical:
    """Some values, ascending and distinct, each with its probability; these sum to 1."""

    points: tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True, slots=True)
class LogNormal:
    """The logarithm is normally distributed around that of ``median``, with the standard deviation
    ``sigma``: half take at most ``median`` seconds, 84% at most ``median`` times e to the ``sigma``."""

    median: Fraction
    sigma: Fraction


Duration: TypeAlias = Fixed | Uniform | Triangular | Empirical | LogNormal


@dataclass(frozen=True, slots=True)
class UpTo:
    """Some time up to a duration, nobody knows which: what ends an action early does not tell when."""

    most: Duration


Taken: TypeAlias = Duration | UpTo
"""What something takes: a duration, or a part of one."""

INSTANT = Fixed(_ZERO)
"""What takes no time."""


def problem(duration: Duration) -> str | None:
    """What is wrong with the numbers of a duration, in words; None if nothing is."""
    stated, what = _stated(duration)
    if any(value < 0 for value in stated):
        return "a duration cannot be below 0 seconds"
    if any(value > LONGEST for value in stated):
        return f"{what} is longer than {LONGEST} seconds"
    match duration:
        case Fixed():
            return None
        case Uniform(low, high):
            return "the range of `uniform` is empty: it ends before it begins" if low > high else None
        case Triangular(low, mode, high):
            if low > high:
                return "the range of `triangular` is empty: it ends before it begins"
            return (
                None if low <= mode <= high else "the most likely value of `triangular` is not in its range"
            )
        case Empirical(points):
            if not points:
                return "`empirical` lists no duration"
            if any(not 0 <= weight <= 1 for _, weight in points):
                return "a probability of `empirical` is outside [0, 1]"
            total = sum((weight for _, weight in points), _ZERO)
            return (
                None
                if total == 1
                else f"the probabilities of `empirical` sum to {float(total):.12g}, not to 1"
            )
        case LogNormal(median, sigma):
            if not median or sigma <= 0:
                return "median and sigma of `lognormal` are above 0"
            return f"sigma of `lognormal` is at most {WIDEST}" if sigma > WIDEST else None
        case _:
            assert_never(duration)


def _stated(duration: Duration) -> tuple[tuple[Fraction, ...], str]:
    match duration:
        case Fixed(seconds):
            return (seconds,), "a duration"
        case Uniform(low, high):
            return (low, high), "a duration"
        case Triangular(low, mode, high):
            return (low, mode, high), "a duration"
        case Empirical(points):
            return tuple(seconds for seconds, _ in points), "a duration"
        case LogNormal(median):
            return (median,), "the median of a duration"
        case _:
            assert_never(duration)


def empirical(points: Iterable[tuple[Fraction, Fraction]]) -> Empirical:
    """Values with their probabilities, in any order; equal ones are one, those of probability 0 are gone."""
    merged: dict[Fraction, Fraction] = {}
    for seconds, weight in points:
        merged[seconds] = merged.get(seconds, _ZERO) + weight
    return Empirical(tuple(sorted((seconds, weight) for seconds, weight in merged.items() if weight)))


def plain(duration: Duration) -> Duration:
    """The duration, as a fixed one where its range is one value."""
    match duration:
        case Uniform(low, high) | Triangular(low, _, high) if low == high:
            return Fixed(low)
        case Empirical(((seconds, _),)):
            return Fixed(seconds)
        case _:
            return duration


# --- probabilities -------------------------------------------------------------------------------


def below(duration: Taken, seconds: Fraction) -> Bounds:
    """The probability that it takes less than so many seconds."""
    return _distribution(duration, seconds, strictly=True)


def within(duration: Taken, seconds: Fraction) -> Bounds:
    """The probability that it takes at most so many seconds."""
    return _distribution(duration, seconds, strictly=False)


def _distribution(duration: Taken, at: Fraction, *, strictly: bool) -> Bounds:
    match duration:
        case Fixed(seconds):
            return _exactly(_ONE if seconds < at or (seconds == at and not strictly) else _ZERO)
        case Empirical(points):
            return _exactly(sum((p for s, p in points if s < at or (s == at and not strictly)), _ZERO))
        case Uniform(low, high) if low < high:
            return _exactly(min(_ONE, max(_ZERO, (at - low) / (high - low))))
        case Triangular(low, mode, high) if low < high:
            if at <= low:
                return _exactly(_ZERO)
            if at >= high:
                return _exactly(_ONE)
            if at <= mode:
                return _exactly((at - low) ** 2 / ((high - low) * (mode - low)))
            return _exactly(1 - (high - at) ** 2 / ((high - low) * (high - mode)))
        case Uniform(low) | Triangular(low):
            return _distribution(Fixed(low), at, strictly=strictly)
        case LogNormal(median, sigma):
            if at <= 0:
                return _exactly(_ZERO)
            return _outward(_normal(math.log(at / median) / float(sigma)))
        case UpTo(most):
            surely = at > 0 or (at == 0 and not strictly)
            return _distribution(most, at, strictly=strictly)[0], _ONE if surely else _ZERO
        case _:
            assert_never(duration)


def _exactly(value: Fraction) -> Bounds:
    return value, value


def _normal(deviations: float) -> float:
    """The standard normal distribution."""
    return math.erfc(-deviations / math.sqrt(2)) / 2


def _outward(value: float) -> Bounds:
    near = Fraction(value)
    return max(_ZERO, near - MARGIN), min(_ONE, near + MARGIN)


def longest(duration: Taken) -> Fraction | None:
    """The longest that it may take; None where it may take any time."""
    match duration:
        case Fixed(seconds):
            return seconds
        case Uniform(_, high) | Triangular(_, _, high):
            return high
        case Empirical(points):
            return points[-1][0]
        case LogNormal():
            return None
        case UpTo(most):
            return longest(most)
        case _:
            assert_never(duration)


def shortest(duration: Taken) -> Fraction:
    """What it takes at least (or comes as close to as one likes)."""
    match duration:
        case Fixed(seconds):
            return seconds
        case Uniform(low) | Triangular(low):
            return low
        case Empirical(points):
            return points[0][0]
        case LogNormal() | UpTo():
            return _ZERO
        case _:
            assert_never(duration)


# --- means ---------------------------------------------------------------------------------------


def mean(duration: Taken) -> Bounds:
    """The expected number of seconds."""
    match duration:
        case Fixed(seconds):
            return _exactly(seconds)
        case Uniform(low, high):
            return _exactly((low + high) / 2)
        case Triangular(low, mode, high):
            return _exactly((low + mode + high) / 3)
        case Empirical(points):
            return _exactly(sum((seconds * weight for seconds, weight in points), _ZERO))
        case LogNormal(median, sigma):
            near = median * Fraction(math.exp(float(sigma) ** 2 / 2))
            return near * (1 - MARGIN), near * (1 + MARGIN)
        case UpTo(most):
            return _ZERO, mean(most)[1]
        case _:
            assert_never(duration)


def partial_mean(duration: Taken, most: Fraction) -> Bounds:
    """The expected number of seconds where it takes at most so many, counting 0 where it takes more."""
    match duration:
        case Fixed(seconds):
            return _exactly(seconds if seconds <= most else _ZERO)
        case Empirical(points):
            return _exactly(sum((s * weight for s, weight in points if s <= most), _ZERO))
        case Uniform(low, high) if low < high:
            end = min(high, max(low, most))
            return _exactly((end**2 - low**2) / (2 * (high - low)))
        case Triangular(low, mode, high) if low < high:
            return _exactly(_partial_triangle(low, mode, high, min(high, max(low, most))))
        case Uniform(low) | Triangular(low):
            return partial_mean(Fixed(low), most)
        case LogNormal(median, sigma):
            if most <= 0:
                return _exactly(_ZERO)
            spread = float(sigma)
            least, greatest = _outward(_normal(math.log(most / median) / spread - spread))
            short, long = mean(duration)
            return short * least, long * greatest
        case UpTo(until):
            return _ZERO, mean(until)[1]
        case _:
            assert_never(duration)


def _partial_triangle(low: Fraction, mode: Fraction, high: Fraction, end: Fraction) -> Fraction:
    """The integral of x times the density, from ``low`` to ``end``."""
    total = _ZERO
    if mode > low:
        stop = min(mode, end)
        rise = 2 / ((high - low) * (mode - low))
        total += rise * ((stop**3 - low**3) / 3 - low * (stop**2 - low**2) / 2)
    if high > mode and end > mode:
        fall = 2 / ((high - low) * (high - mode))
        total += fall * (high * (end**2 - mode**2) / 2 - (end**3 - mode**3) / 3)
    return total


# --- time-outs -----------------------------------------------------------------------------------


def exceeding(duration: Duration, seconds: Fraction) -> Fraction:
    """The probability that it takes more than so many seconds; where that is irrational, the next multiple of
    1e-9 above it, so that a time-out passes no more rarely than in truth."""
    least, _ = within(duration, seconds)
    if not isinstance(duration, LogNormal):
        return 1 - least
    grid = 10**9
    return Fraction(-((least - 1) * grid // 1), grid)


# --- what happens meanwhile ----------------------------------------------------------------------

GRID = 10**12
"""Probabilities of what happens while an action goes on are multiples of one in so many."""


@cache
def meanwhile(chance: Fraction, duration: Duration, at_most: Fraction | None = None) -> Fraction:
    """The probability that what happens with a ``chance`` each second happens at least once in the duration,
    or by ``at_most``: 1 - E (1 - chance)^T, as the nearest multiple of 1/:data:`GRID`. Not known of lognormal
    durations, for which it raises ``ValueError``."""
    if chance == 0:
        return _ZERO
    if chance == 1:  # at once, unless it takes no time at all
        return 1 - within(duration, _ZERO)[0]
    with localcontext(Context(prec=100)):
        base = Decimal(chance.denominator - chance.numerator) / Decimal(chance.denominator)
        left = _expected_power(base, plain(duration), at_most)
        nearest = (1 - left) * GRID
        return Fraction(int(nearest.to_integral_value(ROUND_HALF_EVEN)), GRID)


def _expected_power(base: Decimal, duration: Duration, at_most: Fraction | None) -> Decimal:
    """E base^T, by the closed integrals of base^t (c + d t)."""

    def number(value: Fraction) -> Decimal:
        return Decimal(value.numerator) / Decimal(value.denominator)

    def power(seconds: Fraction) -> Decimal:
        return (number(seconds) * base.ln()).exp()

    def integral(start: Fraction, end: Fraction, constant: Fraction, slope: Fraction) -> Decimal:
        end = end if at_most is None else min(end, max(start, at_most))
        rate = -base.ln()

        def antiderivative(at: Fraction) -> Decimal:
            return -power(at) * (number(constant + slope * at) / rate + number(slope) / rate**2)

        return antiderivative(end) - antiderivative(start) if end > start else Decimal(0)

    cut = Decimal(0)
    if at_most is not None:
        cut = power(at_most) * number(1 - within(duration, at_most)[0])
    match duration:
        case Fixed(seconds):
            return power(seconds if at_most is None else min(seconds, at_most))
        case Empirical(points):
            ends = ((s if at_most is None else min(s, at_most), weight) for s, weight in points)
            return sum((number(weight) * power(seconds) for seconds, weight in ends), Decimal(0))
        case Uniform(low, high):
            return cut + integral(low, high, 1 / (high - low), _ZERO)
        case Triangular(low, mode, high):
            total = cut
            if mode > low:
                rise = 2 / ((high - low) * (mode - low))
                total += integral(low, mode, -rise * low, rise)
            if high > mode:
                fall = 2 / ((high - low) * (high - mode))
                total += integral(mode, high, fall * high, -fall)
            return total
        case LogNormal():
            raise ValueError("not known of a lognormal duration")
        case _:
            assert_never(duration)


# --- in steps ------------------------------------------------------------------------------------


def lattice(duration: Taken) -> tuple[Fraction, ...] | None:
    """All values that it can have; None where it can have any of a range."""
    match duration if isinstance(duration, UpTo) else plain(duration):
        case Fixed(seconds):
            return (seconds,)
        case Empirical(points):
            return tuple(seconds for seconds, _ in points)
        case _:
            return None


def in_steps(
    duration: Taken, step: Fraction, most: int, *, late: bool, at_most: Fraction | None = None
) -> list[Fraction]:
    """How probably it takes 0, 1, 2, … steps, up to ``most``, rounded up if ``late`` and down otherwise: what
    it takes is never less, or never more, than the truth. What is missing to 1 takes longer than ``most``.
    Of a lognormal duration, too, the first steps have no more, or no less, than the truth. With ``at_most``,
    given that it takes no longer than that; it must be able to."""
    sure = within(duration, at_most) if at_most is not None else _exactly(_ONE)
    share = sure[1] if late else sure[0]
    found: list[Fraction] = []
    before = _ZERO
    for number in range(most + 1):
        end = step * number if late else step * (number + 1)
        if at_most is not None and (end > at_most or (late and end == at_most)):
            cumulative = _ONE
        else:
            bounds = within(duration, end) if late else below(duration, end)
            cumulative = min(_ONE, bounds[0] / share if late else bounds[1] / share)
        cumulative = max(before, cumulative)
        found.append(cumulative - before)
        before = cumulative
        if cumulative == 1:
            break
    return found
