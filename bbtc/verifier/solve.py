"""Exact figures of a Markov chain, backwards from its ends.

The states are put into strongly connected components, those that are reached last first (Kosaraju
and Sharir). In each, x = P x + c is solved for several right-hand sides at once by Gaussian
elimination over rationals, the sparsest row first (Markowitz 1957). A state from which no end can be
reached has value 0.

This solver stands apart from ``bbtc.markov`` on purpose, with other algorithms: a fault there must not show
here, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from bbtc.limits import Limits
from bbtc.verifier.explore import Space, Step

_ZERO, _ONE = Fraction(0), Fraction(1)

Row = Sequence[Step]


@dataclass(frozen=True, slots=True)
class Recomputed:
    """The figures of a tree. The probabilities of success, failure, blocked and endless sum to 1.
    Expected numbers of actions, costs and rewards are over all runs (None: infinite) and over those
    that succeed (None: none does). ``without_goal`` is the probability of success where the goal is
    not true; ``unready`` tells whether an action can start where its precondition is not true."""

    success: Fraction
    failure: Fraction
    blocked: Fraction
    endless: Fraction
    actions: Fraction | None
    cost: Fraction | None
    reward: Fraction | None
    actions_given_success: Fraction | None
    cost_given_success: Fraction | None
    without_goal: Fraction
    unready: bool
    states: int

    def figure(self, name: str) -> Fraction | None:
        """The probability or expectation of this name."""
        value: Fraction | None = getattr(self, name)
        return value


def recompute(space: Space, limits: Limits) -> Recomputed:
    """The figures of a chain made from a tree. Raises ``LimitReached`` when the time is over."""
    rows = [steps for ((_, steps),) in space.choices]
    ends = [space.labels[name] for name in ("success", "failure", "blocked")]
    ends.append(space.labels["success"] - space.labels["goal"])
    solver = Solver(rows, space.labels["finished"], limits)
    reached = solver.solve([dict.fromkeys(end, _ONE) for end in ends], None)
    success, failure, blocked, without_goal = (column[0] for column in reached)
    wins = reached[0]
    certain = [_ONE] * len(rows)
    actions, cost, reward = (solver.solve([{}], (number, certain))[0][0] for number in range(3))
    won_actions, won_cost = (solver.solve([{}], (number, wins))[0][0] for number in range(2))
    endless = 1 - success - failure - blocked
    return Recomputed(
        success=success,
        failure=failure,
        blocked=blocked,
        endless=endless,
        actions=None if endless else actions,
        cost=None if endless else cost,
        reward=None if endless else reward,
        actions_given_success=won_actions / success if success else None,
        cost_given_success=won_cost / success if success else None,
        without_goal=without_goal,
        unready=bool(space.labels["unready"]),
        states=len(rows),
    )


class Solver:
    """A chain with its components in order. ``last`` are its final states."""

    def __init__(self, rows: Sequence[Row], last: frozenset[int], limits: Limits) -> None:
        self._rows = rows
        self._limits = limits
        backward: list[list[int]] = [[] for _ in rows]
        for state, row in enumerate(rows):
            for step in row:
                if step.probability:
                    backward[step.successor].append(state)
        self._ending = _closure(backward, last)
        self._last = last
        self._components = _components(rows, backward)

    def solve(
        self, values: Sequence[Mapping[int, Fraction]], earned: tuple[int, Sequence[Fraction]] | None
    ) -> list[list[Fraction]]:
        """Columns x with x = P x, and with the given values in final states (others: 0). With
        ``earned`` = (r, w), every step adds its reward r, times w of the state it leads to."""
        columns = [[known.get(state, _ZERO) for state in range(len(self._rows))] for known in values]
        for count, component in enumerate(self._components):
            if count % 256 == 0:
                self._limits.check_time("the recomputation")
            inside = [state for state in component if state in self._ending and state not in self._last]
            if inside:
                self._solve_component(inside, columns, earned)
        return columns

    def _solve_component(
        self,
        inside: list[int],
        columns: list[list[Fraction]],
        earned: tuple[int, Sequence[Fraction]] | None,
    ) -> None:
        member = set(inside)
        system: dict[int, dict[int, Fraction]] = {}
        right: dict[int, list[Fraction]] = {}
        for state in inside:
            row: dict[int, Fraction] = {}
            constant = [_ZERO] * len(columns)
            for successor, p, rewards in self._rows[state]:
                if successor in member:
                    row[successor] = row.get(successor, _ZERO) + p
                elif successor in self._ending:
                    for number, column in enumerate(columns):
                        if column[successor]:
                            constant[number] += p * column[successor]
                if earned is not None and rewards[earned[0]]:
                    constant[0] += p * rewards[earned[0]] * earned[1][successor]
            system[state], right[state] = row, constant
        for state, solved in eliminate(system, right, self._limits).items():
            for column, value in zip(columns, solved, strict=True):
                column[state] = value


def eliminate(
    system: dict[int, dict[int, Fraction]], right: dict[int, list[Fraction]], limits: Limits
) -> dict[int, list[Fraction]]:
    """x with x = A x + c, for a substochastic A from which every row leaks in the end. Both
    arguments are used up."""
    users: dict[int, set[int]] = {state: set() for state in system}
    for state, row in system.items():
        for successor in row:
            users[successor].add(state)
    order: list[int] = []
    left = set(system)
    while left:
        if len(left) % 16 == 0:
            limits.check_time("the recomputation")
        # 1. The unknown whose elimination makes the least new entries.
        pivot = min(left, key=lambda s: (len(system[s]) * len(users[s] & left), s))
        left.remove(pivot)
        order.append(pivot)
        row, constant = system[pivot], right[pivot]
        # 2. x = a x + … becomes x = …/(1 - a).
        scale = 1 - row.pop(pivot, _ZERO)
        if scale != 1:
            for successor in row:
                row[successor] /= scale
            constant[:] = [value / scale for value in constant]
        # 3. It is put into the rows that use it.
        for user in sorted(users[pivot] & left):
            other = system[user]
            factor = other.pop(pivot)
            for successor, p in row.items():
                other[successor] = other.get(successor, _ZERO) + factor * p
                users[successor].add(user)
            right[user] = [a + factor * b for a, b in zip(right[user], constant, strict=True)]
    # 4. The last one eliminated uses none; the others only those eliminated after them.
    solution: dict[int, list[Fraction]] = {}
    for state in reversed(order):
        value = right[state]
        for successor, p in system[state].items():
            value = [a + p * b for a, b in zip(value, solution[successor], strict=True)]
        solution[state] = value
    return solution


def _closure(edges: Sequence[Sequence[int]], start: frozenset[int]) -> set[int]:
    found = set(start)
    stack = sorted(start)
    while stack:
        for state in edges[stack.pop()]:
            if state not in found:
                found.add(state)
                stack.append(state)
    return found


def _components(rows: Sequence[Row], backward: Sequence[Sequence[int]]) -> list[list[int]]:
    """Strongly connected components, each after those that it leads to."""
    # 1. Order the states by when a depth-first search along the arrows leaves them.
    left: list[int] = []
    seen = [False] * len(rows)
    for root in range(len(rows)):
        if seen[root]:
            continue
        seen[root] = True
        stack = [(root, iter(rows[root]))]
        while stack:
            state, steps = stack[-1]
            for step in steps:
                if step.probability and not seen[step.successor]:
                    seen[step.successor] = True
                    stack.append((step.successor, iter(rows[step.successor])))
                    break
            else:
                left.append(state)
                stack.pop()
    # 2. From the last left on, gather what leads to it.
    placed = [False] * len(rows)
    components: list[list[int]] = []
    for root in reversed(left):
        if placed[root]:
            continue
        placed[root] = True
        component = [root]
        for state in component:  # grows while it is read
            for source in backward[state]:
                if not placed[source]:
                    placed[source] = True
                    component.append(source)
        components.append(component)
    components.reverse()
    return components
