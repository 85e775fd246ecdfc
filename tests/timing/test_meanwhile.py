"""What happens while an action goes on, beside the mean over its quantiles."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.durations import (
    GRID,
    Duration,
    Empirical,
    Fixed,
    LogNormal,
    Triangular,
    Uniform,
    longest,
    meanwhile,
    within,
)

F = Fraction
CASES: tuple[tuple[Duration, Fraction | None], ...] = (
    (Fixed(F(5, 2)), None),
    (Fixed(F(5, 2)), F(2)),
    (Empirical(((F(0), F(1, 4)), (F(1), F(1, 4)), (F(3), F(1, 2)))), None),
    (Empirical(((F(1), F(1, 2)), (F(3), F(1, 2)))), F(2)),
    (Uniform(F(2), F(6)), None),
    (Uniform(F(2), F(6)), F(3)),
    (Uniform(F(2), F(6)), F(1)),
    (Triangular(F(10), F(20), F(40)), None),
    (Triangular(F(10), F(20), F(40)), F(30)),
    (Triangular(F(10), F(20), F(40)), F(15)),
    (Triangular(F(10), F(10), F(40)), None),
    (Triangular(F(10), F(40), F(40)), F(35)),
)


@pytest.mark.parametrize(("duration", "at_most"), CASES)
@pytest.mark.parametrize("chance", [F(1, 10**6), F(1, 100), F(1, 2), F(99, 100)])
def test_a_chance_by_the_second_comes_to_its_mean_over_the_duration(
    duration: Duration, at_most: Fraction | None, chance: Fraction
) -> None:
    """With S(t) the probability to take longer than t, E x^T is 1 less the sum of the drops of x^t where it
    does; between two steps of t the truth lies between two sums."""
    end = longest(duration)
    assert end is not None
    end = end if at_most is None else min(end, at_most)
    steps = 250
    low = high = 0.0
    for number in range(steps):
        start, stop = end * number / steps, end * (number + 1) / steps
        drop = (1 - float(chance)) ** float(start) - (1 - float(chance)) ** float(stop)
        low += drop * float(1 - within(duration, stop)[0]) if number + 1 < steps else 0.0
        high += drop * float(1 - within(duration, start)[0])
    found = meanwhile(chance, duration, at_most)
    assert found.denominator <= GRID
    assert low - 1e-9 <= float(found) <= high + 1e-9
    assert high - low < 0.1


def test_what_is_certain_or_impossible_each_second_is_so() -> None:
    takes = Empirical(((F(0), F(1, 4)), (F(2), F(3, 4))))
    assert meanwhile(F(0), takes) == 0
    assert meanwhile(F(1), takes) == F(3, 4)
    assert meanwhile(F(1, 2), Fixed(F(3))) == F(7, 8)


def test_of_a_lognormal_duration_it_is_not_known() -> None:
    with pytest.raises(ValueError, match="lognormal"):
        meanwhile(F(1, 2), LogNormal(F(2), F(1)))
