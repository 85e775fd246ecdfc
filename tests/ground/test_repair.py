"""The cheapest repair of what nothing can bring about: in graphs given by hand."""

from __future__ import annotations

from bbtc.ground.repair import Every, Repairs, Root, Some, Way
from bbtc.limits import Limits


def roots(ways: dict[str, list[Way[str]]], need: str) -> tuple[Root[str], ...]:
    return Repairs(lambda fact: ways.get(fact, []), lambda _: 1.0, Limits(seconds=20)).roots(need)


def test_the_alternative_that_lacks_less_is_repaired() -> None:
    ways = {"goal": [Way("carry", Every(("key", "lamp"))), Way("push", "strength")]}
    assert roots(ways, "goal") == (Root("strength", "push"),)
    ways["goal"][1] = Way("push", Every((Some(("strength", "lever")), "wheels", "oil")))
    assert roots(ways, "goal") == (Root("key", "carry"), Root("lamp", "carry"))


def test_a_fact_that_many_ways_lead_to_is_followed_once() -> None:
    """Each level needs both facts of the next, which both need both of the one after: 2^60 ways, one root."""
    ways = {
        f"{side}{level}": [Way(f"do-{side}{level}", Every((f"a{level + 1}", f"b{level + 1}")))]
        for level in range(60)
        for side in "ab"
    }
    assert roots(ways, "a0") == (Root("a60", "do-a59"), Root("b60", "do-a59"))


def test_a_circle_ends_at_the_fact_that_it_comes_back_to() -> None:
    """The charger is reached by driving, which takes a battery that only the charger fills."""
    ways = {
        "arrived": [Way("drive", "battery")],
        "battery": [Way("charge", "at-charger")],
        "at-charger": [Way("drive", "battery")],
    }
    assert roots(ways, "arrived") == (Root("battery", "drive", ("charge",)),)
