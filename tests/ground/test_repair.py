"""The cheapest repair of what nothing can bring about: in graphs given by hand."""

from __future__ import annotations

from typing import TypeAlias

from bbtc.ground.repair import Every, Need, Repairs, Root, Some, Way
from bbtc.limits import Limits

Ways: TypeAlias = dict[str, list[Way[str]]]


def all_of(*parts: Need[str]) -> Need[str]:
    return Every(parts)


def roots(ways: Ways, need: Need[str]) -> tuple[Root[str], ...]:
    return Repairs(lambda fact: ways.get(fact, []), lambda _: 1.0, Limits(seconds=20)).roots(need)


def test_the_alternative_that_lacks_less_is_repaired() -> None:
    ways: Ways = {"goal": [Way("carry", all_of("key", "lamp")), Way("push", "strength")]}
    assert roots(ways, "goal") == (Root("strength", "push"),)
    ways["goal"][1] = Way("push", all_of(Some(("strength", "lever")), "wheels", "oil"))
    assert roots(ways, "goal") == (Root("key", "carry"), Root("lamp", "carry"))


def test_a_fact_that_many_ways_lead_to_is_followed_once() -> None:
    """Each level needs both facts of the next, which both need both of the one after: 2^60 ways, one root."""
    ways: Ways = {
        f"{side}{level}": [Way(f"do-{side}{level}", all_of(f"a{level + 1}", f"b{level + 1}"))]
        for level in range(60)
        for side in "ab"
    }
    assert roots(ways, "a0") == (Root("a60", "do-a59"), Root("b60", "do-a59"))


def test_what_is_asked_for_itself_is_not_missing_twice() -> None:
    """Of two ways that lack one fact each, the one that lacks what is asked for anyway."""
    ways: Ways = {"door-open": [Way("unlock", "key"), Way("push", "strength")]}
    assert roots(ways, all_of("key", "door-open")) == (Root("key", None),)


def test_a_circle_ends_at_the_fact_that_it_comes_back_to() -> None:
    """The charger is reached by driving, which takes a battery that only the charger fills."""
    ways: Ways = {
        "arrived": [Way("drive", "battery")],
        "battery": [Way("charge", "at-charger")],
        "at-charger": [Way("drive", "battery")],
    }
    assert roots(ways, "arrived") == (Root("battery", "drive", ("charge",)),)
