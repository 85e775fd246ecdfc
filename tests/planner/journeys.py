"""Random journeys: small tasks in which most policies do worse than the best, which seldom always wins."""

from __future__ import annotations

from fractions import Fraction
from random import Random

from hypothesis import strategies as st

from bbtc.ground.condition import Condition, Is, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from tests.planner.test_refine import action, task

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN
_PLACES = 6
_KEY, _CARD, _SIGN, _LOST = range(_PLACES, _PLACES + 4)


def journey(seed: int) -> Task:
    """A traveller goes from place to place and may slip, or be lost; a key may be found and may break, a card
    can be bought, and some ways need one of them, or a sign that is read first and may say anything."""
    drawn = Random(seed)

    def places() -> list[int]:
        return drawn.sample(range(_PLACES), 2)

    def moved(here: int, there: int) -> dict[int, Truth]:
        return {here: F, there: T} if here != there else {}

    acts = []
    for number in range(11):
        here, there = places()
        needs: list[Condition] = [Is(here, T), Is(_LOST, F)]
        if drawn.random() < 0.4:
            needs.append(drawn.choice([Is(_KEY, T), Is(_CARD, T), Is(_SIGN, T), Is(_SIGN, F), Is(_CARD, F)]))
        sure = drawn.choice([Fraction(1, 2), Fraction(2, 3), Fraction(9, 10), Fraction(1)])
        outcomes = [(str(sure), moved(here, there))]
        if sure < 1:
            other = drawn.choice([{_LOST: T}, {_KEY: F}, moved(here, drawn.randrange(_PLACES))])
            outcomes.append((str(1 - sure), other))
        acts.append(action(f"go{number:02}", conjunction(needs), *outcomes))
    here, there = places()
    acts.append(
        action("find", conjunction([Is(here, T), Is(_KEY, F)]), ("3/4", {_KEY: T}), ("1/4", {_LOST: T}))
    )
    acts.append(action("buy", conjunction([Is(there, T), Is(_CARD, F)]), ("1", {_CARD: T, _KEY: F})))
    acts.append(action("read", Is(_SIGN, U), ("1/3", {_SIGN: T}), ("1/3", {_SIGN: F}), ("1/3", {})))
    goal = conjunction(
        [Is(_PLACES - 1, T), drawn.choice([Is(_KEY, T), Is(_CARD, T), Is(_LOST, F), Is(_KEY, F)])]
    )
    return task("p0 p1 p2 p3 p4 p5 key card sign lost", {0: T, _SIGN: U}, goal, *acts)


def journeys() -> st.SearchStrategy[Task]:
    """Any of them."""
    return st.integers(0, 10**9).map(journey)
