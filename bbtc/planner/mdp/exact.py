"""Exact values of Markov chains given by rows of rationals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from bbtc.limits import Limits
from bbtc.markov import components

Row: TypeAlias = dict[int, Fraction]
"""Probabilities by target; what is missing to 1 leaves the chain."""

_ZERO = Fraction(0)
_MOST_WORK = 400_000  # elimination steps of one loop of states


def solve(
    rows: Sequence[Mapping[int, Fraction]], constant: Sequence[Fraction], limits: Limits | None = None
) -> list[Fraction] | None:
    """x with x = P x + c, exactly, for a chain that leaves every loop.

    Components are solved in topological order; within one, the state with the fewest links is
    eliminated first (minimum degree). None if a component is too large to be solved in rationals.
    Raises ``LimitReached`` when the time is over.
    """
    limits = limits or Limits()
    values: list[Fraction] = [_ZERO] * len(rows)
    for count, component in enumerate(components([tuple(row) for row in rows])):
        if count % 256 == 0:
            limits.check_time("the exact solution")
        if len(component) == 1:
            (state,) = component
            total, loop = constant[state], _ZERO
            for target, p in rows[state].items():
                if target == state:
                    loop = p
                else:
                    total += p * values[target]
            values[state] = total / (1 - loop) if loop else total
            continue
        inside = set(component)
        open_rows: dict[int, Row] = {}
        known: dict[int, Fraction] = {}
        for state in component:
            known[state] = constant[state]
            open_rows[state] = {}
            for target, p in rows[state].items():
                if target in inside:
                    open_rows[state][target] = p
                else:
                    known[state] += p * values[target]
        if not _eliminate(open_rows, known, values, limits):
            return None
    return values


def _eliminate(
    rows: dict[int, Row], constant: dict[int, Fraction], values: list[Fraction], limits: Limits
) -> bool:
    users: dict[int, set[int]] = {state: set() for state in rows}
    for state, row in rows.items():
        for target in row:
            users[target].add(state)
    order: list[int] = []
    work = 0
    buckets: dict[int, dict[int, None]] = {}

    def degree(state: int) -> int:
        return len(rows[state]) * len(users[state])

    place = {state: degree(state) for state in rows}
    for state in sorted(rows):
        buckets.setdefault(place[state], {})[state] = None
    left = len(rows)
    while left:
        if left % 64 == 0:
            limits.check_time("the exact solution")
        lowest = min(key for key, members in buckets.items() if members)
        pivot = next(iter(buckets[lowest]))
        del buckets[lowest][pivot]
        left -= 1
        row = rows[pivot]
        scale = 1 / (1 - row.pop(pivot, _ZERO))
        users[pivot].discard(pivot)
        for target in row:
            row[target] *= scale
            users[target].discard(pivot)
        constant[pivot] *= scale
        order.append(pivot)
        touched = set(users[pivot]) | set(row)
        for user in users[pivot]:
            factor = rows[user].pop(pivot)
            other = rows[user]
            work += len(row) + 1
            for target, p in row.items():
                other[target] = other.get(target, _ZERO) + factor * p
                users[target].add(user)
            constant[user] += factor * constant[pivot]
        if work > _MOST_WORK:
            return False
        for state in sorted(touched):
            buckets[place[state]].pop(state, None)
            place[state] = degree(state)
            buckets.setdefault(place[state], {})[state] = None
    for state in reversed(order):
        values[state] = constant[state] + sum((p * values[t] for t, p in rows[state].items()), _ZERO)
    return True
