"""Weights of worlds as decision diagrams: functions from worlds to whole numbers, told apart up to a factor.

A world gives each of some places a truth value. A node asks for one place; each of its two edges has a
weight and leads to a node that asks for a later place, and the weight of a world is the product along its
path. The two weights of a node have no common divisor, and a node whose edges are the same is left out, so
that functions which differ by a factor only are one node. (Bryant, 1986: "Graph-Based Algorithms for Boolean
Function Manipulation"; with factors on the edges: Sanner, McAllester, 2005, "Affine Algebraic Decision
Diagrams".) All numbers are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd
from typing import NamedTuple, TypeAlias

ZERO, ONE = 0, 1
"""The nodes of the functions that are 0 everywhere, and 1 everywhere."""

_MOST_KEPT = 1_000_000
"""Results of operations that are kept."""


class Weighted(NamedTuple):
    """The function of a node, times a factor."""

    weight: int
    node: int


NOTHING = Weighted(0, ZERO)

_Edges: TypeAlias = tuple[Weighted, Weighted]
_Sum: TypeAlias = tuple[Weighted, Weighted]


@dataclass(frozen=True, slots=True)
class Node:
    """A node as it is written down: the place that it asks for, and where that leads if it is false, or
    true."""

    place: int
    if_false: Weighted
    if_true: Weighted


@dataclass(frozen=True, slots=True)
class Diagram:
    """A function by itself. ``order`` has every place, in the order in which they are asked for; the nodes
    are numbered from 2 on, each after those that it leads to. The last is where all worlds begin; where there
    is none, all weights are 1."""

    order: tuple[int, ...]
    nodes: tuple[Node, ...]


class TooManyNodes(Exception):
    """Diagrams have become larger than they may be."""


class Diagrams:
    """Diagrams over the same places, which they all ask for in the same order."""

    def __init__(self, order: Sequence[int], most: int) -> None:
        """``order`` has all places, each once. With more than ``most`` nodes, operations raise
        :class:`TooManyNodes`."""
        self.order = tuple(order)
        self.most = most
        self._level = {place: level for level, place in enumerate(order)}
        last = len(self.order)
        self._levels = [last, last]
        self._edges: list[_Edges] = [(NOTHING, NOTHING)] * 2
        self._totals = [0, 1]
        self._sure = [(0, 0), (0, 0)]
        """By node: the places that are true, and those that are false, in all worlds with a weight."""
        self._numbers: dict[tuple[int, Weighted, Weighted], int] = {}
        self._products: dict[tuple[int, int], Weighted] = {}
        self._sums: dict[_Sum, Weighted] = {}
        self._complements: dict[int, int] = {ZERO: ONE, ONE: ZERO}

    def __len__(self) -> int:
        """The number of nodes."""
        return len(self._levels)

    # --- nodes ---------------------------------------------------------------------------------

    def _make(self, level: int, low: Weighted, high: Weighted) -> Weighted:
        """The function that is ``low`` where the place of a level is false, and ``high`` where it is true."""
        if low == high:
            return low
        common = gcd(low.weight, high.weight)
        if common != 1:
            low, high = Weighted(low.weight // common, low.node), Weighted(high.weight // common, high.node)
        key = level, low, high
        found = self._numbers.get(key)
        if found is None:
            found = self._numbers[key] = len(self._levels)
            if found > self.most:
                raise TooManyNodes
            self._levels.append(level)
            self._edges.append((low, high))
            self._totals.append(self._below(level, low) + self._below(level, high))
            self._sure.append(self._sure_in(level, low, high))
        return Weighted(common, found)

    def _sure_in(self, level: int, low: Weighted, high: Weighted) -> tuple[int, int]:
        place = 1 << self.order[level]
        if not low.weight:
            true, false = self._sure[high.node]
            return true | place, false
        if not high.weight:
            true, false = self._sure[low.node]
            return true, false | place
        both = zip(self._sure[low.node], self._sure[high.node], strict=True)
        true, false = (one & other for one, other in both)
        return true, false

    def _below(self, level: int, edge: Weighted) -> int:
        """The sum of a function over all values of the places after a level."""
        return edge.weight * self._totals[edge.node] << (self._levels[edge.node] - level - 1)

    def total(self, function: Weighted) -> int:
        """The sum of a function over all worlds."""
        return self._below(-1, function)

    def _split(self, node: int, level: int) -> _Edges:
        if self._levels[node] == level:
            return self._edges[node]
        edge = Weighted(1, node)
        return edge, edge

    def cube(self, values: Iterable[tuple[int, bool]]) -> int:
        """1 where places have these values, else 0."""
        node = ONE
        for place, value in sorted(values, key=lambda each: -self._level[each[0]]):
            edge = Weighted(1, node)
            pair = (NOTHING, edge) if value else (edge, NOTHING)
            node = self._make(self._level[place], *pair).node
        return node

    # --- operations ------------------------------------------------------------------------------
    # Each asks for what it needs by a stack of its own: diagrams may be as deep as there are places.

    def product(self, one: int, other: int) -> Weighted:
        """The product of two functions."""
        if len(self._products) > _MOST_KEPT:
            self._products.clear()
        known, levels, split = self._products, self._levels, self._edges
        asked = (one, other) if one < other else (other, one)
        stack = [asked]
        while stack:
            key = stack[-1]
            if key in known:
                stack.pop()
                continue
            first, second = key
            if first in (ZERO, ONE):
                known[key] = Weighted(first, second if first else ZERO)
                stack.pop()
                continue
            level = min(levels[second], levels[first])
            mine = split[first] if levels[first] == level else ((1, first),) * 2
            others = split[second] if levels[second] == level else ((1, second),) * 2
            edges = []
            missing = False
            for (a, node), (b, with_) in zip(mine, others, strict=True):
                if not a or not b:
                    edges.append(NOTHING)
                    continue
                pair = (node, with_) if node < with_ else (with_, node)
                inner = known.get(pair)
                if inner is None:
                    stack.append(pair)
                    missing = True
                elif inner.weight:
                    edges.append(Weighted(a * b * inner.weight, inner.node))
                else:
                    edges.append(NOTHING)
            if not missing:
                known[key] = self._make(level, *edges)
                stack.pop()
        return known[asked]

    def times(self, one: Weighted, other: int) -> Weighted:
        """The product of a function with a node's."""
        inner = self.product(one.node, other)
        return Weighted(one.weight * inner.weight, inner.node) if inner.weight and one.weight else NOTHING

    def sum(self, one: Weighted, other: Weighted) -> Weighted:
        """The sum of two functions."""
        if len(self._sums) > _MOST_KEPT:
            self._sums.clear()
        simple = self._simple_sum(one, other)
        if simple is not None:
            return simple
        common, asked = _sum_of(one, other)
        stack, known = [asked], self._sums
        while stack:
            key = stack[-1]
            if key in known:
                stack.pop()
                continue
            first, second = key
            level = min(self._levels[first.node], self._levels[second.node])
            edges: list[Weighted] = []
            missing: list[_Sum] = []
            for a, b in zip(self._split(first.node, level), self._split(second.node, level), strict=True):
                left = Weighted(first.weight * a.weight, a.node)
                right = Weighted(second.weight * b.weight, b.node)
                edge = self._simple_sum(left, right)
                if edge is None:
                    factor, inner = _sum_of(left, right)
                    found = known.get(inner)
                    if found is None:
                        missing.append(inner)
                        continue
                    edge = Weighted(factor * found.weight, found.node)
                edges.append(edge)
            if missing:
                stack += missing
            else:
                known[key] = self._make(level, *edges)
        return Weighted(common * known[asked].weight, known[asked].node)

    @staticmethod
    def _simple_sum(one: Weighted, other: Weighted) -> Weighted | None:
        if not one.weight:
            return other if other.weight else NOTHING
        if not other.weight:
            return one
        return Weighted(one.weight + other.weight, one.node) if one.node == other.node else None

    def complement(self, node: int) -> int:
        """1 where a function of zeros and ones is 0, and 0 where it is 1."""
        known, stack = self._complements, [node]
        while stack:
            key = stack[-1]
            if key in known:
                stack.pop()
                continue
            nodes = [edge.node if edge.weight else ZERO for edge in self._edges[key]]
            missing = [each for each in nodes if each not in known]
            if missing:
                stack += missing
                continue
            low, high = (Weighted(1, known[each]) if known[each] else NOTHING for each in nodes)
            found = self._make(self._levels[key], low, high).node
            known[key], known[found] = found, key
        return known[node]

    def cases(self, function: Weighted, places: Iterable[int]) -> Iterator[tuple[int, Weighted]]:
        """The values that some places may have, as bits by place, each with what is left of the function
        then, which no longer depends on them."""
        levels = sorted(self._level[place] for place in places)
        cofactors: dict[tuple[int, int, bool], Weighted] = {}
        waiting = [(0, 0, function)] if function.weight else []
        while waiting:
            at, bits, left = waiting.pop()
            if at == len(levels):
                yield bits, left
                continue
            for value in (True, False):
                part = self._cofactor(left, levels[at], value, cofactors)
                if part.weight:
                    more = 1 << self.order[levels[at]] if value else 0
                    waiting.append((at + 1, bits | more, part))

    def _cofactor(
        self, function: Weighted, level: int, value: bool, known: dict[tuple[int, int, bool], Weighted]
    ) -> Weighted:
        """What a function is where the place of a level has a value."""
        stack = [function.node]
        while stack:
            node = stack[-1]
            if (node, level, value) in known:
                stack.pop()
                continue
            if self._levels[node] >= level:
                edge = self._edges[node][value] if self._levels[node] == level else Weighted(1, node)
                known[node, level, value] = edge if edge.weight else NOTHING
                continue
            missing = [
                edge.node
                for edge in self._edges[node]
                if edge.weight and (edge.node, level, value) not in known
            ]
            if missing:
                stack += missing
                continue
            edges = []
            for weight, inner in self._edges[node]:
                found = known[inner, level, value] if weight else NOTHING
                edges.append(Weighted(weight * found.weight, found.node) if found.weight else NOTHING)
            known[node, level, value] = self._make(self._levels[node], *edges)
        found = known[function.node, level, value]
        return Weighted(function.weight * found.weight, found.node) if found.weight else NOTHING

    # --- reading ---------------------------------------------------------------------------------

    def _reached(self, node: int) -> list[int]:
        """The nodes of a diagram, each before those that it leads to; not :data:`ZERO` and :data:`ONE`."""
        found, waiting = {node}, [node]
        while waiting:
            for edge in self._edges[waiting.pop()]:
                if edge.weight and edge.node not in found:
                    found.add(edge.node)
                    waiting.append(edge.node)
        return sorted((each for each in found if each > ONE), key=lambda each: (self._levels[each], each))

    def sure(self, node: int) -> tuple[int, int]:
        """The places that are true, and those that are false, in all worlds with a weight, as bits."""
        return self._sure[node]

    def pick(self, node: int, point: Fraction) -> int:
        """The world at a point from 0 to below 1, where all stand in a row as long as their weights."""
        world, point = 0, point * self.total(Weighted(1, node))
        for level, place in enumerate(self.order):
            low, high = self._split(node, level)
            # The weights of what comes after this level only.
            false = self._below(level, low)
            if point < false:
                node, point = low.node, point / low.weight
            else:
                world |= 1 << place
                node, point = high.node, (point - false) / high.weight
        return world

    def turns(self) -> Iterator[tuple[int, Fraction, tuple[int, int]]]:
        """Of each node from the first made on: its level, how likely its place is true in a world that is
        drawn by weight, and the nodes that its edges lead to."""
        for level, (low, high) in zip(self._levels[2:], self._edges[2:], strict=True):
            false, true = self._below(level, low), self._below(level, high)
            yield level, Fraction(true, false + true), (low.node, high.node)

    def worlds(self, node: int) -> Iterator[tuple[int, int]]:
        """All worlds, with their weights."""
        waiting = [(0, 0, 1, node)] if node else []
        while waiting:
            level, world, weight, at = waiting.pop()
            if level == len(self.order):
                yield world, weight
                continue
            for value, edge in enumerate(self._split(at, level)):
                if edge.weight:
                    bit = value << self.order[level]
                    waiting.append((level + 1, world | bit, weight * edge.weight, edge.node))

    def count(self, node: int) -> int:
        """The number of worlds that have a weight."""
        counts = {ZERO: 0, ONE: 1}
        for each in reversed(self._reached(node)):
            level = self._levels[each]
            counts[each] = sum(
                counts[edge.node] << (self._levels[edge.node] - level - 1)
                for edge in self._edges[each]
                if edge.weight
            )
        return counts[node] << self._levels[node]

    def written(self, node: int) -> Diagram:
        """A diagram by itself, of a function that is not 0 everywhere. The same function gives the same."""
        numbers = {ZERO: ZERO, ONE: ONE}
        nodes: list[Node] = []
        stack = [node]
        while stack:
            each = stack[-1]
            inner = [edge.node for edge in self._edges[each] if edge.node not in numbers]
            if inner:
                stack += reversed(inner)
                continue
            stack.pop()
            if each not in numbers:
                numbers[each] = len(numbers)
                low, high = (Weighted(edge.weight, numbers[edge.node]) for edge in self._edges[each])
                nodes.append(Node(self.order[self._levels[each]], low, high))
        return Diagram(self.order, tuple(nodes))

    def read(self, diagram: Diagram) -> int:
        """The node of a diagram that was written down with the same order, whoever wrote it."""
        found = [NOTHING, Weighted(1, ONE)]
        for node in diagram.nodes:
            edges = []
            for weight, to in (node.if_false, node.if_true):
                inner = found[to]
                whole = weight * inner.weight
                edges.append(Weighted(whole, inner.node) if whole else NOTHING)
            found.append(self._make(self._level[node.place], *edges))
        return found[-1].node


def _sum_of(one: Weighted, other: Weighted) -> tuple[int, _Sum]:
    """A sum without its common factor, and that."""
    common = gcd(one.weight, other.weight)
    first = Weighted(one.weight // common, one.node)
    second = Weighted(other.weight // common, other.node)
    return common, (first, second) if first.node < second.node else (second, first)


def good_order(places: Sequence[int], together: Iterable[Sequence[int]]) -> list[int]:
    """An order in which diagrams stay small whose factors each read places that stand ``together``: one by
    one, places are taken so that few that were taken are together with some that were not. From some of the
    places with the fewest others around, the order that keeps the fewest open is taken."""
    sets = sorted({tuple(sorted(set(each))) for each in together})
    around: dict[int, set[int]] = {place: set() for place in places}
    for each in sets:
        for place in each:
            around[place].update(each)
    for place, others in around.items():
        others.discard(place)
    starts = sorted(places, key=lambda place: (len(around[place]), place))[:_STARTS]
    orders = (_order_from(places, around, start) for start in starts)
    return min(orders, key=lambda each: each[0], default=(0, list[int]()))[1]


_STARTS = 6


def _order_from(places: Sequence[int], around: Mapping[int, set[int]], start: int) -> tuple[int, list[int]]:
    """An order that begins with a place, and a measure of the nodes that diagrams may have in it."""
    outside = {place: len(others) for place, others in around.items()}
    left, found, size = dict.fromkeys(sorted(places)), list[int](), 0
    opened: dict[int, None] = {}
    """Places taken that are together with some that were not; ordered, to be the same in every run."""

    def rank(place: int) -> tuple[int, int, int]:
        mine = [other for other in around[place] if other in opened]
        closed = sum(outside[other] == 1 for other in mine)
        return (outside[place] > 0) - closed, -len(mine), place

    place = start
    while True:
        found.append(place)
        del left[place]
        for other in around[place]:
            outside[other] -= 1
        opened[place] = None
        opened = {each: None for each in opened if outside[each]}
        size += 1 << len(opened)
        if not left:
            return size, found
        near = {other for each in opened for other in around[each] if other in left}
        place = min(near, key=rank) if near else next(iter(left))
