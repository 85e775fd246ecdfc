"""How far states are from the goal if nothing were ever undone: a guess that finds dead ends for sure.

The delete relaxation of a task over pairs of variable and value, in which every outcome of an action
can be had for one over its probability. The cost of a set of facts is the sum of theirs (the additive
heuristic of Bonet and Geffner 2001), for many states at a time. Where it is infinite, no policy
reaches the goal; elsewhere it is a guess that guides the search and proves nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc.ground.condition import TRUE, And, Condition
from bbtc.ground.task import Effect, Factor, Task
from bbtc.kleene import Truth
from bbtc.planner.mdp.packing import Cube, Packing, Words, bit_test, cubes, set_bits
from bbtc.planner.mdp.transitions import Index
from bbtc.rounding import rounded

Costs = npt.NDArray[np.float32]
"""Guessed numbers of actions; infinite where the goal is out of reach for sure."""

_CELLS = 1 << 18  # array cells worked on at a time
_MOST_CUBES = 32  # disjuncts of one condition; with more, it counts as true
_FEW = 8  # operators that add a fact, which are gone through one by one
_DEAREST = 100.0  # an outcome costs no more than this, however improbable


class Heuristic:
    """The relaxation of a task, indexed once and asked for many states.

    Facts are numbered: variable v is false (4 v), unknown, true, or known (not unknown).
    """

    def __init__(self, task: Task, packing: Packing) -> None:
        self.packing = packing
        self._facts = 4 * len(task.variables)
        goal = self._facts  # one more fact: the goal
        self._always = goal + 1  # and one that always holds
        operators: dict[tuple[tuple[int, ...], tuple[int, ...]], float] = {}

        def add(condition: Condition, effects: tuple[int, ...], cost: float) -> None:
            found = cubes(bit_test(packing, condition), _MOST_CUBES)
            for cube in [Cube(0, 0)] if found is None else found:
                needs = tuple(self._needs(cube)) or (self._always,)
                key = needs, effects
                operators[key] = min(cost, operators.get(key, np.inf))

        add(task.goal, (goal,), 0.0)
        for action in task.actions:
            for probability, effect in _effects(action.factors, Fraction(1)):
                cost = min(_DEAREST, rounded(1 / probability))
                when = TRUE if effect.when is None else effect.when
                condition = action.precondition if when == TRUE else And((action.precondition, when))
                add(condition, tuple(self._adds(effect)), cost)
        self._index(operators or {((self._always,), (self._always,)): 0.0})

    def _needs(self, cube: Cube) -> Iterator[int]:
        for variable in sorted({self.packing.owner(bit) for bit in set_bits(cube.mask)}):
            unknown = self.packing.unknown[variable]
            whether = 0 if unknown is None else cube.mask >> unknown & 1
            if cube.mask >> variable & 1:
                yield 4 * variable + (2 if cube.value >> variable & 1 else 0)
            elif whether:
                assert unknown is not None
                yield 4 * variable + (1 if cube.value >> unknown & 1 else 3)

    def _adds(self, effect: Effect) -> Iterator[int]:
        for variable, value in effect.sets:
            yield 4 * variable + int(value)
            if value is not Truth.UNKNOWN and self.packing.unknown[variable] is not None:
                yield 4 * variable + 3

    def _index(self, operators: dict[tuple[tuple[int, ...], tuple[int, ...]], float]) -> None:
        needs = [needs for needs, _ in operators]
        costs = np.array(list(operators.values()), dtype=np.float32)
        achievers: dict[int, list[int]] = {}
        adds = [adds for _, adds in operators]
        order = sorted(range(len(needs)), key=lambda number: -len(needs[number]))
        for place, number in enumerate(order):
            for fact in adds[number]:
                achievers.setdefault(fact, []).append(place)
        self._needs_of = _columns([needs[number] for number in order])
        self._cost: Costs = costs[order, None]
        facts = sorted(achievers, key=lambda fact: (-len(achievers[fact]), fact))
        self._added: Index = np.array(facts, dtype=np.int64)
        few = [fact for fact in facts if len(achievers[fact]) <= _FEW]
        many = [achievers[fact] for fact in facts if len(achievers[fact]) > _FEW]
        self._many: Index = np.array([number for group in many for number in group], dtype=np.int64)
        self._many_first: Index = np.cumsum([0, *map(len, many)])[:-1]
        self._few = _columns([achievers[fact] for fact in few])
        self._width = 1 + sum(map(len, needs)) + sum(map(len, achievers.values()))

    def estimate(self, states: Words) -> Costs:
        """The guess for each state."""
        step = max(1, _CELLS // self._width)
        pieces = [self._estimate(states[at : at + step]) for at in range(0, len(states), step)]
        return np.concatenate([np.empty(0, dtype=np.float32), *pieces])

    def _estimate(self, states: Words) -> Costs:
        values = self.packing.unpack(states).T
        cost = np.full((self._always + 1, len(states)), np.inf, dtype=np.float32)
        cost[self._always] = 0
        for value in Truth:
            cost[: self._facts].reshape(-1, 4, len(states))[:, int(value)][values == int(value)] = 0
        cost[: self._facts].reshape(-1, 4, len(states))[:, 3][values != int(Truth.UNKNOWN)] = 0
        live = np.arange(len(states))
        found = np.empty(len(states), dtype=np.float32)
        while len(live):
            reached = cost[self._needs_of[0]] + self._cost
            for column in self._needs_of[1:]:
                reached[: len(column)] += cost[column]
            before = cost[self._added]
            least = np.empty_like(before)
            if len(self._many_first):
                rows = reached[self._many]
                least[: len(self._many_first)] = np.minimum.reduceat(rows, self._many_first, axis=0)
            if self._few:
                rest = least[len(self._many_first) :]
                rest[:] = reached[self._few[0]]
                for column in self._few[1:]:
                    np.minimum(rest[: len(column)], reached[column], out=rest[: len(column)])
            moved = (least < before).any(axis=0)
            cost[self._added] = np.minimum(least, before)
            if not moved.all():
                found[live[~moved]] = cost[self._facts][~moved]
                live, cost = live[moved], cost[:, moved]
        return found


def _columns(rows: list[tuple[int, ...]] | list[list[int]]) -> list[Index]:
    """The first, second, … entries of rows that are ordered by length, longest first."""
    longest = len(rows[0]) if rows else 0
    return [np.array([row[at] for row in rows if len(row) > at], dtype=np.int64) for at in range(longest)]


def _effects(factors: Iterable[Factor], chance: Fraction) -> Iterator[tuple[Fraction, Effect]]:
    """Every effect that may happen, with its probability."""
    for factor in factors:
        for outcome in factor.outcomes:
            probability = chance * outcome.probability
            if probability:
                for effect in outcome.effects:
                    yield probability, effect
                yield from _effects(outcome.factors, probability)
