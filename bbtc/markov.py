"""Finite Markov chains: their graph (what can be reached, strongly connected components), and linear systems
over them, exactly.

Components are found by depth-first search (Tarjan 1972). A system x = P x + c is solved one component at a
time; a component of one state is a plain sum, so acyclic chains cost one pass, and loops are solved by
Gaussian elimination over rationals, the state with the fewest links first (minimum degree: Markowitz 1957).

``bbtc.verifier`` has a solver of its own on purpose: what it recomputes must not rest on this one.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import gcd, lcm, prod
from typing import TypeAlias, TypeVar

Row: TypeAlias = dict[int, Fraction]
"""Probabilities by successor; what is missing to 1 leaves the chain."""

_N = TypeVar("_N", bound=Hashable)
_ZERO = Fraction(0)
_ONE = Fraction(1)


def reachable(start: Iterable[_N], successors: Callable[[_N], Iterable[_N]]) -> set[_N]:
    """All that can be reached from ``start``, itself included."""
    found = set(start)
    waiting = list(found)
    while waiting:
        for node in successors(waiting.pop()):
            if node not in found:
                found.add(node)
                waiting.append(node)
    return found


def distribution(parts: Iterable[tuple[_N, Fraction]]) -> dict[_N, Fraction]:
    """A distribution from its parts, those of equal outcomes added up, in order of appearance."""
    found: dict[_N, Fraction] = {}
    for outcome, probability in parts:
        found[outcome] = found[outcome] + probability if outcome in found else probability
    return found


def independent(parts: Iterable[Mapping[_N, Fraction]]) -> Iterator[tuple[tuple[_N, ...], Fraction]]:
    """One outcome of each of some independent draws, in every way, with the probability of that."""
    for drawn in product(*(part.items() for part in parts)):
        yield tuple(outcome for outcome, _ in drawn), prod((p for _, p in drawn), start=_ONE)


def weighted(pairs: Iterable[tuple[Fraction | int, Fraction]], more: Fraction | int = _ZERO) -> Fraction:
    """The sum of the products of pairs, and what is ``more``: what ``+`` and ``*`` give, but reduced at the
    end, and not at each step."""
    numerator, denominator = more.as_integer_ratio()
    for weight, value in pairs:
        part = weight.numerator * value.numerator
        if not part:
            continue
        below = weight.denominator * value.denominator
        if below == denominator:
            numerator += part
        else:
            common = gcd(below, denominator)
            scale = below // common
            numerator = numerator * scale + part * (denominator // common)
            denominator *= scale
    return Fraction(numerator, denominator)


def components(successors: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly connected components, each after all the components it can reach."""
    number = [0] * len(successors)
    low = [0] * len(successors)
    on_stack = [False] * len(successors)
    stack: list[int] = []
    found: list[list[int]] = []
    count = 0
    for root in range(len(successors)):
        if number[root]:
            continue
        work = [(root, 0)]
        while work:
            node, position = work.pop()
            if position == 0:
                count += 1
                number[node] = low[node] = count
                stack.append(node)
                on_stack[node] = True
            descend = False
            for at in range(position, len(successors[node])):
                successor = successors[node][at]
                if not number[successor]:
                    work.append((node, at + 1))
                    work.append((successor, 0))
                    descend = True
                    break
                if on_stack[successor]:
                    low[node] = min(low[node], low[successor])
            if descend:
                continue
            if low[node] == number[node]:
                component = []
                while True:
                    member = stack.pop()
                    on_stack[member] = False
                    component.append(member)
                    if member == node:
                        break
                found.append(component)
            if work:
                parent = work[-1][0]
                low[parent] = min(low[parent], low[node])
    return found


def solve(
    rows: Sequence[Mapping[int, Fraction]],
    constant: Sequence[Fraction],
    order: Iterable[Sequence[int]] | None = None,
    *,
    most_work: int | None = None,
    look: Callable[[], None] = lambda: None,
) -> list[Fraction] | None:
    """x with x = P x + c, exactly, for a chain that leaves every loop.

    ``order`` has the components of the chain, each after all that it can reach, where they are known; states
    that are in none of them get value 0. None if a component takes more than ``most_work`` steps of
    elimination. ``look`` is called now and then, and may raise an exception.
    """
    values: list[Fraction] = [_ZERO] * len(rows)
    for count, component in enumerate(components([tuple(row) for row in rows]) if order is None else order):
        if count % 256 == 0:
            look()
        if len(component) == 1:
            (state,) = component
            row = rows[state]
            loop = row.get(state)
            onward = ((p, values[successor]) for successor, p in row.items() if successor != state)
            total = weighted(onward, constant[state]) if row else constant[state]
            values[state] = total / (1 - loop) if loop else total
            continue
        inside = set(component)
        system: dict[int, Row] = {}
        known: dict[int, Fraction] = {}
        for state in component:
            row = rows[state]
            system[state] = {successor: p for successor, p in row.items() if successor in inside}
            onward = ((p, values[successor]) for successor, p in row.items() if successor not in inside)
            known[state] = weighted(onward, constant[state])
        if not _eliminate(system, known, values, most_work, look):
            return None
    return values


@dataclass(slots=True)
class _Equation:
    """``scale`` times a state's value is the sum of ``factors`` times those of others, and a ``constant``.
    All are whole numbers without a common divisor: they are reduced once a step, and not at each sum."""

    factors: dict[int, int]
    constant: int
    scale: int

    @classmethod
    def of(cls, row: Row, constant: Fraction) -> _Equation:
        """That a value is the sum of fractions of others, and a constant."""
        scale = lcm(constant.denominator, *(p.denominator for p in row.values()))
        factors = {state: p.numerator * (scale // p.denominator) for state, p in row.items()}
        return cls(factors, constant.numerator * (scale // constant.denominator), scale)

    def reduce(self) -> None:
        """Divide by what all numbers have in common."""
        common = gcd(self.scale, self.constant, *self.factors.values())
        if common > 1:
            self.scale //= common
            self.constant //= common
            self.factors = {state: factor // common for state, factor in self.factors.items()}

    def without(self, pivot: int, other: _Equation) -> None:
        """Put the value that another equation gives a state in its place."""
        factor = self.factors.pop(pivot)
        common = gcd(factor, other.scale)
        factor, times = factor // common, other.scale // common
        factors = {state: times * each for state, each in self.factors.items()}
        for state, each in other.factors.items():
            factors[state] = factors.get(state, 0) + factor * each
        self.factors = factors
        self.constant = times * self.constant + factor * other.constant
        self.scale *= times
        self.reduce()


def _eliminate(
    rows: dict[int, Row],
    constant: dict[int, Fraction],
    values: list[Fraction],
    most_work: int | None,
    look: Callable[[], None],
) -> bool:
    """Put the solution of one component into ``values``; False if it is too much work."""
    equations = {state: _Equation.of(row, constant[state]) for state, row in rows.items()}
    users: dict[int, set[int]] = {state: set() for state in rows}
    for state, row in rows.items():
        for successor in row:
            users[successor].add(state)
    order: list[int] = []
    work = 0
    buckets: dict[int, dict[int, None]] = {}

    def degree(state: int) -> int:
        return len(equations[state].factors) * len(users[state])

    place = {state: degree(state) for state in rows}
    for state in sorted(rows):
        buckets.setdefault(place[state], {})[state] = None
    left = len(rows)
    while left:
        if left % 64 == 0:
            look()
        lowest = min(key for key, members in buckets.items() if members)
        pivot = next(iter(buckets[lowest]))
        del buckets[lowest][pivot]
        left -= 1
        own = equations[pivot]
        own.scale -= own.factors.pop(pivot, 0)
        own.reduce()
        users[pivot].discard(pivot)
        for successor in own.factors:
            users[successor].discard(pivot)
        order.append(pivot)
        touched = set(users[pivot]) | own.factors.keys()
        for user in users[pivot]:
            work += len(own.factors) + 1
            equations[user].without(pivot, own)
            for successor in own.factors:
                users[successor].add(user)
        if most_work is not None and work > most_work:
            return False
        for state in sorted(touched):
            buckets[place[state]].pop(state, None)
            place[state] = degree(state)
            buckets.setdefault(place[state], {})[state] = None
    for state in reversed(order):
        own = equations[state]
        known = ((factor, values[other]) for other, factor in own.factors.items())
        values[state] = weighted(known, own.constant) / own.scale
    return True
