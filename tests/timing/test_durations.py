"""How long something takes: against closed forms, numerical integrals and draws of other libraries."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from itertools import accumulate
from statistics import NormalDist

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc import durations
from bbtc.artefacts.cursor import At
from bbtc.artefacts.duration_json import duration_from_json, duration_to_json
from bbtc.durations import Duration, Empirical, Fixed, LogNormal, Triangular, Uniform
from tests.profiles import examples

F = Fraction
KINDS: list[Duration] = [
    Fixed(F(7)),
    Fixed(F(0)),
    Uniform(F(8), F(20)),
    Triangular(F(2), F(5), F(12)),
    Triangular(F(0), F(0), F(3)),
    Triangular(F(1), F(4), F(4)),
    Empirical(((F(2), F(1, 4)), (F(5), F(1, 4)), (F(13, 2), F(1, 2)))),
    LogNormal(F(10), F(1, 2)),
]


def drawn(duration: Duration, generator: random.Random) -> float:
    """A draw by the standard library, which knows nothing of the formulas."""
    match duration:
        case Fixed(seconds):
            return float(seconds)
        case Uniform(low, high):
            return generator.uniform(float(low), float(high))
        case Triangular(low, mode, high):
            return generator.triangular(float(low), float(high), float(mode))
        case Empirical(points):
            values, weights = zip(*points, strict=True)
            return float(generator.choices(values, [float(weight) for weight in weights])[0])
        case LogNormal(median, sigma):
            return generator.lognormvariate(math.log(float(median)), float(sigma))


def seconds(least: int = 0) -> st.SearchStrategy[Fraction]:
    return st.fractions(least, 40, max_denominator=12)


@st.composite
def some_duration(draw: st.DrawFn) -> Duration:
    kind = draw(st.sampled_from(["fixed", "uniform", "triangular", "empirical", "lognormal"]))
    if kind == "fixed":
        return Fixed(draw(seconds()))
    if kind == "lognormal":
        return LogNormal(draw(seconds()) + 1, draw(st.fractions(F(1, 10), 2, max_denominator=10)))
    if kind == "empirical":
        values = draw(st.lists(seconds(), min_size=1, max_size=4, unique=True))
        return durations.empirical((value, F(1, len(values))) for value in values)
    low, mode, high = sorted(draw(st.tuples(seconds(), seconds(), seconds())))
    return Uniform(low, high) if kind == "uniform" else Triangular(low, mode, high)


@pytest.mark.parametrize("duration", KINDS, ids=str)
def test_probabilities_and_means_are_those_of_draws(duration: Duration) -> None:
    generator, count = random.Random(1), 10_000
    values = sorted(drawn(duration, generator) for _ in range(count))
    band = 4 / math.sqrt(count)
    for at in (F(0), F(1), F(5, 2), F(5), F(7), F(10), F(15), F(40)):
        least, most = durations.within(duration, at)
        assert 0 <= least <= most <= 1
        assert most - least <= 2 * durations.MARGIN
        end = float(at)  # which is quick to compare with, and exact
        share = sum(value <= end for value in values) / count
        assert abs(share - float(least)) < band
        share = sum(value < end for value in values) / count
        assert abs(share - float(durations.below(duration, at)[0])) < band
        part = sum(value for value in values if value <= end) / count
        assert abs(part - float(durations.partial_mean(duration, at)[0])) < 20 * band
    assert abs(sum(values) / count - float(durations.mean(duration)[0])) < 20 * band
    assert values[0] >= float(durations.shortest(duration))
    longest = durations.longest(duration)
    assert longest is None or values[-1] <= float(longest)


def test_a_lognormal_is_bounded_by_what_another_function_tells() -> None:
    normal, duration = NormalDist(math.log(10), 0.5), LogNormal(F(10), F(1, 2))
    for at in (1, 5, 10, 17, 60):
        least, most = durations.within(duration, F(at))
        assert float(least) - 1e-11 < normal.cdf(math.log(at)) < float(most) + 1e-11
    assert durations.within(duration, F(10)) == (F(1, 2) - durations.MARGIN, F(1, 2) + durations.MARGIN)


@given(some_duration(), st.fractions(F(1, 8), 3, max_denominator=8))
@examples(80)
def test_steps_are_rounded_in_one_direction_and_differ_by_one(duration: Duration, step: Fraction) -> None:
    most = 60
    late = durations.in_steps(duration, step, most, late=True)
    early = durations.in_steps(duration, step, most, late=False)
    assert min(*late, *early, F(0)) >= 0
    late += [F(0)] * (most + 1 - len(late))
    early += [F(0)] * (most + 1 - len(early))
    ups, downs = list(accumulate(late)), list(accumulate(early))
    for number in range(most):
        up, down = ups[number], downs[number]
        # What is rounded up to n steps is truly done by then, and all that is done before is among what is
        # rounded down to them.
        assert up <= durations.within(duration, number * step)[1]
        assert down >= durations.below(duration, (number + 1) * step)[0]
        assert down >= up
        assert down <= ups[number + 1] + 4 * durations.MARGIN


@given(some_duration(), seconds(1), st.fractions(F(1, 8), 3, max_denominator=8))
@examples(60)
def test_what_takes_no_longer_than_a_time_out_is_conditioned_on_that(
    duration: Duration, limit: Fraction, step: Fraction
) -> None:
    chance = durations.exceeding(duration, limit)
    least, most = durations.within(duration, limit)
    assert 0 <= chance - (1 - most) <= F(1, 10**9) + 2 * durations.MARGIN
    if most < F(1, 1000):
        return
    count = int(limit / step) + 2
    late = durations.in_steps(duration, step, count, late=True, at_most=limit)
    early = durations.in_steps(duration, step, count, late=False, at_most=limit)
    assert sum(late) == sum(early) == 1
    for number in range(count):
        true = min(F(1), durations.within(duration, min(limit, number * step))[0] / least)
        assert sum(late[: number + 1]) <= true + F(1, 10**8)
        assert sum(early[: number + 1]) >= min(F(1), durations.below(duration, (number + 1) * step)[0] / most)


@given(some_duration())
@examples(100)
def test_what_json_holds_is_read_back(duration: Duration) -> None:
    assert durations.problem(duration) is None
    assert duration_from_json(At(duration_to_json(duration))) == duration


@pytest.mark.parametrize(
    ("duration", "said"),
    [
        (Fixed(F(-1)), "below 0"),
        (Uniform(F(3), F(2)), "empty"),
        (Triangular(F(3), F(4), F(2)), "empty"),
        (Triangular(F(1), F(4), F(2)), "not in its range"),
        (Empirical(()), "lists no duration"),
        (Empirical(((F(1), F(1, 2)),)), "sum to 0.5"),
        (Empirical(((F(1), F(3, 2)), (F(2), F(-1, 2)))), "outside"),
        (LogNormal(F(0), F(1)), "above 0"),
        (LogNormal(F(5), F(0)), "above 0"),
        (LogNormal(F(5), F(11)), "at most 10"),
        (Fixed(F(10**9 + 1)), "longer than"),
    ],
)
def test_what_makes_no_sense_is_told(duration: Duration, said: str) -> None:
    assert said in (durations.problem(duration) or "")
