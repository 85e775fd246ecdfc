"""Confidence intervals of sampled figures.

Source: Wilson, "Probable inference, the law of succession, and statistical inference" (1927); his interval
holds what it promises also where nearly all or nearly no runs succeed (Brown, Cai, DasGupta 2001).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

CONFIDENCE = Fraction(95, 100)
_Z = Fraction(1_959_964, 1_000_000)  # the two-sided 95 % quantile of the normal distribution
_GRAIN = 10**6  # ends are rounded outwards to so many parts


@dataclass(frozen=True, slots=True)
class Interval:
    """A 95 % confidence interval; its ends are multiples of a millionth."""

    lower: Fraction
    upper: Fraction


def wilson(successes: int, runs: int) -> Interval:
    """Wilson's score interval of a share that was counted; exact arithmetic, rounded outwards. ``runs`` >
    0."""
    share = Fraction(successes, runs)
    return score(share, share * (1 - share), runs)


def score(mean: Fraction, variance: Fraction, count: int) -> Interval:
    """The same for the mean of ``count`` numbers between 0 and 1. Of all such numbers with this mean, those
    that are 0 or 1 vary most, so that the interval is never too narrow with their variance."""
    squared = _Z * _Z
    middle = mean + squared / (2 * count)
    root = _root_above(variance / count + squared / (4 * count * count))
    scale = 1 + squared / count
    lower, upper = (middle - _Z * root) / scale, (middle + _Z * root) / scale
    return Interval(
        max(Fraction(0), Fraction(math.floor(lower * _GRAIN), _GRAIN)),
        min(Fraction(1), Fraction(math.ceil(upper * _GRAIN), _GRAIN)),
    )


def _root_above(value: Fraction) -> Fraction:
    """A square root, rounded up."""
    fine = _GRAIN**2
    return Fraction(math.isqrt(math.floor(value * fine**2)) + 1, fine)
