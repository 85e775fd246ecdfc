"""Of equally good choices, trees take those that others' changes harm least: beside every policy there is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import product
from math import prod

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bbtc.ground.condition import Is, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.exposure import SLIGHT
from bbtc.planner.recovering import recovering_tree
from bbtc.tree.nodes import Node
from tests.disturbance.reference import Exact, State, best_chances, outcomes_in
from tests.long_form import amount
from tests.planner.errands import errands
from tests.planner.journeys import journeys
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.replay.reference import value_of

T, F = Truth.TRUE, Truth.FALSE
MOST_POLICIES = 200

Way = list[tuple[float, State]]
"""Chances, and where an action leads."""


def test_of_two_ways_the_one_is_taken_that_nobody_can_bar() -> None:
    """Two ways of equal cost lead past one stop each, and after one of them a door has to be open."""
    assert stops(two_ways(Fraction(1))) == ["start", "field", "done"]


def test_what_others_do_never_costs_the_undisturbed_runs_anything() -> None:
    assert stops(two_ways(Fraction(11, 10))) == ["start", "door", "done"]


def two_ways(cost: Fraction) -> Task:
    acts = [
        action("by-the-door", Is(0, T), ("1", {0: F, 1: T})),
        replace(action("in-the-open", Is(0, T), ("1", {0: F, 2: T})), cost=cost),
        action("through", conjunction([Is(1, T), Is(4, T)]), ("1", {1: F, 3: T})),
        action("walk", Is(2, T), ("1", {2: F, 3: T})),
    ]
    return task("start door field done open", {0: T, 4: T}, Is(3, T), *acts)


def stops(of: Task) -> list[str]:
    """The places that a run comes by, where all actions are sure."""
    exact, found = Exact(of, tree_of(of), 0.0, lambda state: []), []
    after: Way = [(1.0, tuple(map(int, of.initial[0].values)))]
    while after:
        ((_, state),) = after
        found += [of.variables[at].predicate for at in range(4) if state[at] == T]
        after = [(p, key[0]) for p, _, key in exact.ticked((state, (), (), ()))[1]]
    return found


@examples(amount(42, 3000))
@given(of=st.one_of(journeys(), errands()))
def test_no_cheapest_policy_is_harmed_less(of: Task) -> None:
    world = World(of)
    if not 1 < world.count <= MOST_POLICIES:
        return
    harms = [world.harm(policy) for policy in world.policies()]
    own = world.harm(ways(of, tree_of(of)))
    assert min(harms) - 1e-6 <= own <= max(harms) + 1e-6
    assert own >= max(harms) - 1e-6 or max(harms) - min(harms) <= SLIGHT + 1e-6


def ways(of: Task, root: Node) -> Callable[[State], Way]:
    """Where a tree leads from each state."""
    exact = Exact(of, root, 0.0, lambda state: [])
    return lambda state: [(p, after[0]) for p, _, after in exact.ticked((state, (), (), ()))[1]]


class World:
    """What actions lead to, from the start and from after a change, the best chances there, and the cheapest
    ways to attain them."""

    def __init__(self, of: Task) -> None:
        self.task = of
        self.starts = {tuple(map(int, each.values)): float(each.probability) for each in of.initial}
        self.ways: dict[State, list[Way]] = {}
        self._explore([*self.starts])
        self.chances = best_chances(of, set(self.ways))
        self.cheapest = self._cheapest()
        self.visited = self._visited()
        self.count = prod(len(self.cheapest[state]) for state in self.visited if self.cheapest[state])
        facts = ChangingFacts.of(of, Limits())
        self.changes = {state: facts.changes(bytes(state)) for state in self.visited}
        if self.count > 1:
            self._explore([tuple(after) for ways in self.changes.values() for _, after in ways])
            self.chances = best_chances(of, set(self.ways))

    def policies(self) -> Iterator[Callable[[State], Way]]:
        """All that take a cheapest way in each state visited."""
        for taken in product(*(self.cheapest[state] or [[]] for state in self.visited)):
            yield dict(zip(self.visited, taken, strict=True)).__getitem__

    def harm(self, policy: Callable[[State], Way]) -> float:
        """How much success one change at some tick of an undisturbed run brings, summed up over all ticks."""
        visited = [*self.starts]
        for state in visited:  # grows
            visited += [after for _, after in policy(state) if after not in visited]
        number = {state: at for at, state in enumerate(visited)}
        matrix, own = np.eye(len(number)), np.zeros(len(number))
        for state, at in number.items():
            for p, after in policy(state):
                matrix[at, number[after]] -= p
            for chance, changed in self.changes[state]:
                own[at] += float(chance) * (self.chances[tuple(changed)] - self.chances[state])
        found = np.linalg.solve(matrix, own)
        return float(sum(p * found[number[state]] for state, p in self.starts.items()))

    def _explore(self, waiting: list[State]) -> None:
        while waiting:
            state = waiting.pop()
            if state in self.ways:
                continue
            ready = [each for each in self.task.actions if value_of(each.precondition, state) == "T"]
            found = [outcomes_in(each, state).items() for each in ready]
            self.ways[state] = [[(float(p), after) for (after, _), p in way] for way in found]
            waiting += [after for way in self.ways[state] for _, after in way]

    def _cheapest(self) -> dict[State, list[Way]]:
        """Every action costs 1; runs end in the goal, or where there is no hope."""
        best = {
            state: [
                way
                for way in ways
                if 0 < self.chances[state] <= sum(p * self.chances[after] for p, after in way) + 1e-9
                and value_of(self.task.goal, state) != "T"
            ]
            for state, ways in self.ways.items()
        }
        costs = dict.fromkeys(best, 0.0)

        def total(way: Way) -> float:
            return 1 + sum(p * costs[after] for p, after in way)

        moved = 1.0
        while moved > 1e-12:
            moved = 0.0
            for state, ways in best.items():
                if ways:
                    least = min(map(total, ways))
                    moved, costs[state] = max(moved, least - costs[state]), least
        return {
            state: [way for way in ways if total(way) <= costs[state] + 1e-8] for state, ways in best.items()
        }

    def _visited(self) -> list[State]:
        found = list(self.starts)
        for state in found:  # grows
            for way in self.cheapest[state]:
                found += [after for _, after in way if after not in found]
        return found


def tree_of(of: Task) -> Node:
    found = recovering_tree(of, Limits())
    assert found is not None
    return found.root
