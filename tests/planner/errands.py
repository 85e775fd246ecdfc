"""Random errands: small tasks in which many policies are as good, and some are easier to disturb."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from random import Random

from hypothesis import strategies as st

from bbtc.ground.condition import Is, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from tests.planner.test_refine import action, task

T, F = Truth.TRUE, Truth.FALSE
_HOME, _PLACES, _DOORS, _THINGS = 0, range(4), (4, 5), (6, 7)


def errand(seed: int) -> Task:
    """Something is to be got at two places, in any order, and brought home; ways have doors, which nobody
    opens or closes, and some places are slippery."""
    drawn = Random(seed)
    acts = []
    for here, there in permutations(_PLACES, 2):
        if drawn.random() < 0.7:
            needs = [Is(here, T), *(Is(door, T) for door in _DOORS if drawn.random() < 0.25)]
            ways = [("1", {here: F, there: T})]
            if drawn.random() < 0.2:
                ways = [("3/4", {here: F, there: T}), ("1/4", {here: F, _HOME: T} if here != _HOME else {})]
            acts.append(action(f"go-{here}-{there}", conjunction(needs), *ways))
    for thing, place in zip(_THINGS, drawn.sample(_PLACES[1:], 2), strict=True):
        sure = drawn.choice(["1", "1/2"])
        ways = [(sure, {thing: T}), *([] if sure == "1" else [("1/2", {})])]
        acts.append(action(f"get-{thing}", conjunction([Is(place, T), Is(thing, F)]), *ways))
    goal = conjunction([Is(_HOME, T), *(Is(thing, T) for thing in _THINGS)])
    start = dict.fromkeys((_HOME, *_DOORS), T)
    made = task("home p1 p2 p3 d1 d2 t1 t2", start, goal, *acts)
    return replace(made, variables=tuple(replace(each, three_valued=False) for each in made.variables))


def errands() -> st.SearchStrategy[Task]:
    """Any of them."""
    return st.integers(0, 10**9).map(errand)
