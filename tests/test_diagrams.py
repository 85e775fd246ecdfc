"""Decision diagrams beside tables of all worlds."""

from __future__ import annotations

import functools
from collections import Counter
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagrams import NOTHING, Diagrams, TooManyNodes, Weighted, good_order
from tests.profiles import examples

Table: TypeAlias = dict[int, int]
"""The weight of every world."""

WEIGHTS = st.sampled_from([0, 0, 1, 1, 2, 3, 6])


@st.composite
def tables(
    draw: st.DrawFn, count: int = 1, weights: st.SearchStrategy[int] = WEIGHTS
) -> tuple[list[int], list[Table]]:
    """An order of up to five places, and some tables over them."""
    order = draw(st.permutations(range(draw(st.integers(1, 5)))))
    worlds = range(2 ** len(order))
    return order, [{world: draw(weights) for world in worlds} for _ in range(count)]


def diagram(diagrams: Diagrams, table: Table) -> Weighted:
    """The function of a table, world by world."""
    found = NOTHING
    for world, weight in table.items():
        cube = diagrams.cube((place, bool(world >> place & 1)) for place in diagrams.order)
        found = diagrams.sum(found, Weighted(weight, cube) if weight else NOTHING)
    return found


def table(diagrams: Diagrams, function: Weighted) -> Table:
    """The function as a table."""
    weights = dict(diagrams.worlds(function.node))
    return {world: function.weight * weights.get(world, 0) for world in range(2 ** len(diagrams.order))}


@examples(50)
@given(tables(2))
def test_sums_and_products_are_those_of_the_worlds(given_: tuple[list[int], list[Table]]) -> None:
    order, (one, other) = given_
    diagrams = Diagrams(order, 1_000)
    first, second = diagram(diagrams, one), diagram(diagrams, other)
    assert table(diagrams, first) == one
    assert table(diagrams, diagrams.sum(first, second)) == {world: one[world] + other[world] for world in one}
    factor = table(diagrams, Weighted(1, second.node)) if second.weight else dict.fromkeys(one, 0)
    assert table(diagrams, diagrams.times(first, second.node)) == {w: one[w] * factor[w] for w in one}


@examples(40)
@given(tables(1), st.integers(2, 5))
def test_functions_that_differ_by_a_factor_are_one_node(
    given_: tuple[list[int], list[Table]], factor: int
) -> None:
    order, (weights,) = given_
    diagrams = Diagrams(order, 1_000)
    one = diagram(diagrams, weights)
    more = diagram(diagrams, {world: factor * weight for world, weight in weights.items()})
    assert more == (Weighted(factor * one.weight, one.node) if one.weight else NOTHING)


@examples(50)
@given(tables(1, st.sampled_from([0, 1])))
def test_a_complement_is_one_where_a_function_is_not(given_: tuple[list[int], list[Table]]) -> None:
    order, (truth,) = given_
    diagrams = Diagrams(order, 1_000)
    node = diagram(diagrams, truth).node
    assert table(diagrams, Weighted(1, diagrams.complement(node))) == {w: 1 - one for w, one in truth.items()}


@examples(40)
@given(tables(1), st.data())
def test_cases_leave_what_does_not_depend_on_them(
    given_: tuple[list[int], list[Table]], data: st.DataObject
) -> None:
    order, (weights,) = given_
    diagrams = Diagrams(order, 1_000)
    places = [place for place in order if data.draw(st.booleans())]
    mask = sum(1 << place for place in places)
    found = dict(diagrams.cases(diagram(diagrams, weights), places))
    assert set(found) == {world & mask for world, weight in weights.items() if weight}
    for bits, left in found.items():
        assert table(diagrams, left) == {world: weights[world & ~mask | bits] for world in weights}


@examples(40)
@given(tables(1))
def test_worlds_are_weighed_counted_and_picked(given_: tuple[list[int], list[Table]]) -> None:
    order, (weights,) = given_
    diagrams = Diagrams(order, 1_000)
    function = diagram(diagrams, weights)
    whole = sum(weights.values())
    assert diagrams.total(function) == whole
    if not whole:
        return
    possible = [world for world, weight in weights.items() if weight]
    assert diagrams.sure(function.node) == (
        functools.reduce(lambda one, other: one & other, possible),
        2 ** len(order) - 1 & ~functools.reduce(lambda one, other: one | other, possible),
    )
    assert diagrams.count(function.node) == sum(weight > 0 for weight in weights.values())
    picked = Counter(diagrams.pick(function.node, Fraction(2 * at + 1, 2 * whole)) for at in range(whole))
    assert picked == {world: weight for world, weight in weights.items() if weight}


@examples(50)
@given(tables(1))
def test_a_diagram_that_is_written_down_is_read_again(given_: tuple[list[int], list[Table]]) -> None:
    order, (weights,) = given_
    if not any(weights.values()):
        return
    one, other = Diagrams(order, 1_000), Diagrams(order, 1_000)
    diagram(other, dict.fromkeys(weights, 1) | {0: 7})  # its nodes have other numbers
    written = one.written(diagram(one, weights).node)
    assert other.written(other.read(written)) == written


def test_a_bound_on_nodes_ends_an_operation() -> None:
    diagrams = Diagrams([*range(0, 20, 2), *range(1, 20, 2)], 500)

    def all_same() -> None:
        node = 1
        for place in range(0, 20, 2):  # pairs that the order puts far apart
            cubes = (diagrams.cube([(place, value), (place + 1, value)]) for value in (False, True))
            node = diagrams.product(node, diagrams.sum(*(Weighted(1, cube) for cube in cubes)).node).node

    with pytest.raises(TooManyNodes):
        all_same()


def test_a_diagram_may_be_as_deep_as_there_are_places() -> None:
    diagrams = Diagrams(range(3_000), 100_000)
    every = diagrams.cube((place, True) for place in range(3_000))
    none = diagrams.complement(every)
    both = diagrams.sum(Weighted(1, every), Weighted(1, none))
    assert both == Weighted(1, 1)
    assert diagrams.product(every, none) == NOTHING
    assert diagrams.count(every) == 1


@pytest.mark.parametrize("size", [4, 8, 16])
def test_a_good_order_keeps_few_places_open(size: int) -> None:
    """In a grid whose neighbours are read together, never more places than the shorter side, and one, are
    read together with some that come later; as they are numbered here, most are."""
    cells = list(product(range(size), range(4)))
    number = {cell: at * 7 % len(cells) for at, cell in enumerate(cells)}
    together = [
        [number[x, y], number[other]]
        for x, y in cells
        for other in [(x + 1, y), (x, y + 1)]
        if other in number
    ]

    def most_open(order: list[int]) -> int:
        at = {place: level for level, place in enumerate(order)}
        last = {
            place: max(at[other] for pair in together if place in pair for other in pair) for place in order
        }
        return max(sum(at[place] <= level < last[place] for place in order) for level in range(len(order)))

    order = good_order(range(len(cells)), together)
    assert sorted(order) == sorted(number.values())
    assert most_open(order) <= 5
    assert most_open(sorted(order)) > len(cells) / 3
