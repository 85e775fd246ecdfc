"""Durations as JSON, in and out."""

from __future__ import annotations

from fractions import Fraction

from typing_extensions import assert_never

from bbtc import durations
from bbtc.artefacts.cursor import At
from bbtc.artefacts.numbers import given_text
from bbtc.artefacts.prior_json import check_sum
from bbtc.durations import LONGEST, Duration, Empirical, Fixed, LogNormal, Triangular, Uniform
from bbtc.ground.task import Factor, outcomes_of


def duration_to_json(duration: Duration) -> dict[str, object]:
    """``{"uniform": ["8", "20"]}`` and the like; seconds."""
    match duration:
        case Fixed(seconds):
            return {"fixed": given_text(seconds)}
        case Uniform(low, high):
            return {"uniform": [given_text(low), given_text(high)]}
        case Triangular(low, mode, high):
            return {"triangular": [given_text(each) for each in (low, mode, high)]}
        case Empirical(points):
            return {"empirical": [{"seconds": given_text(s), "p": given_text(p)} for s, p in points]}
        case LogNormal(median, sigma):
            return {"lognormal": {"median": given_text(median), "sigma": given_text(sigma)}}
        case _:
            assert_never(duration)


_KINDS = ("fixed", "uniform", "triangular", "empirical", "lognormal")


def duration_from_json(at: At) -> Duration:
    """Inverse of :func:`duration_to_json`."""
    members = at.members([], _KINDS)
    if len(members) != 1:
        raise at.fault("BBT0603", "a duration has one field, which names its distribution")
    ((kind, value),) = members.items()
    match kind:
        case "fixed":
            found: Duration = Fixed(value.given())
        case "uniform":
            found = Uniform(*_numbers(value, 2))
        case "triangular":
            found = Triangular(*_numbers(value, 3))
        case "lognormal":
            fields = value.members(["median", "sigma"])
            found = LogNormal(fields["median"].given(), fields["sigma"].given())
        case _:
            points = [each.members(["seconds", "p"]) for each in value.elements()]
            weights = [(p["seconds"].given(), p["p"].given_probability()) for p in points]
            check_sum(value, [weight for _, weight in weights])
            found = durations.empirical(weights)
    wrong = durations.problem(found)
    if wrong is not None:
        raise value.fault("BBT0604", wrong)
    return found


def _numbers(at: At, count: int) -> list[Fraction]:
    found = [each.given() for each in at.elements()]
    if len(found) != count:
        raise at.fault("BBT0604", f"must be {count} numbers")
    return found


def may_time_out(factors: tuple[Factor, ...], allowed: bool) -> bool:
    """Do all outcomes of a time-out stand in one factor, not nested, of an action that has one?"""
    inner = outcomes_of(inner for factor in factors for each in factor.outcomes for inner in each.factors)
    late = [factor for factor in factors if any(each.timed_out for each in factor.outcomes)]
    return len(late) <= int(allowed) and not any(each.timed_out for each in inner)


def timeout_from_json(at: At) -> Fraction:
    """Seconds after which an action is given up."""
    seconds = at.given()
    if not 0 < seconds <= LONGEST:
        raise at.fault(
            "BBT0604", "a time-out is above 0 seconds" if seconds <= 0 else "a time-out is too long"
        )
    return seconds
