"""Rules of trees that recover: none could be left out, and the nearest to the goal stand first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from hypothesis import example, given

from bbtc.ground.condition import Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.recovering import recovering_tree
from bbtc.rewrite.simplify import size
from bbtc.tree.nodes import ConditionNode, ControlNode, Node, actions_of
from tests.disturbance.reference import State, best_chances, outcomes_in
from tests.domains.problems import Problem, plan_of
from tests.long_form import amount
from tests.planner.errands import errand, errands
from tests.planner.test_exposure import World, ways
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.replay.reference import Ticking, value_of

T, F = Truth.TRUE, Truth.FALSE


def test_what_is_nearest_to_the_goal_is_looked_at_first() -> None:
    """A corridor: each room leads to the next, and from the second one may slip back."""
    steps = [("one", 0, 1), ("two", 1, 2), ("three", 2, 3), ("four", 3, 4)]
    acts = [action(name, Is(here, T), ("1", {here: F, there: T})) for name, here, there in steps]
    acts[1] = action("two", Is(1, T), ("1/2", {1: F, 2: T}), ("1/2", {1: F, 0: T}))
    of = task("a b c d e", {0: T}, Is(4, T), *acts)
    of = replace(of, variables=tuple(replace(each, three_valued=False) for each in of.variables))
    assert [node.action for node in actions_of(tree_of(of))] == ["four()", "three()", "two()", "one()"]


@pytest.mark.parametrize(
    ("problem", "most"),
    [("charging/after-a-shift", 12), ("corridors/short-cut", 20), ("kitting/gift-set", 19)],
)
def test_trees_have_no_more_rules_than_they_need(problem: str, most: int) -> None:
    domain, name = problem.split("/")
    assert size(plan_of(Problem(domain, name), "auto").tree.root) <= most


@examples(amount(28, 1000))
@given(of=errands())
@example(of=errand(6816))  # one of two ways that cost the same is harder to bar
@example(of=errand(94))  # to go from p2 to p1 is the only way from one state, and a circle in another
def test_without_any_rule_something_goes_wrong(of: Task) -> None:
    root = tree_of(of)
    assert isinstance(root, ControlNode)
    world = Everything(of)
    assert world.fault(root) is None
    deciding = root
    for node in actions_of(root):
        there = [state for state in world.states if started(of, root, state) == node.id]
        assert there, f"{node.action} never starts"
        if not any(world.chances[state] for state in there):
            deciding = without(deciding, node.id)  # it waits for others
    for node in actions_of(deciding):
        rest = without(deciding, node.id)
        needed = world.fault(rest) is not None or exposed_more(of, rest, deciding)
        assert needed, f"{node.action} is not needed"


def exposed_more(of: Task, one: Node, other: Node) -> bool:
    """Do others' changes harm the runs of one tree more (``test_exposure.py``)?"""
    world = World(of)
    return world.count > 1 and world.harm(ways(of, one)) < world.harm(ways(of, other)) - 1e-6


def tree_of(of: Task) -> Node:
    found = recovering_tree(of, Limits())
    assert found is not None
    return found.root


def started(of: Task, root: Node, state: State) -> str | None:
    """The id of the action node that a tick starts."""
    run = Ticking(of, state, set(), {}, lost={})
    run.tick_all(root)
    return None if run.started is None else run.started.id


def without(node: ControlNode, gone: str) -> ControlNode:
    """A tree without an action, and the conditions that stand before it alone."""
    children = []
    for child in node.children:
        if child.id == gone:
            continue
        left = without(child, gone) if isinstance(child, ControlNode) else child
        if isinstance(left, ConditionNode) or any(actions_of(left)):
            children.append(left)
    return replace(node, children=tuple(children))


class Everything:
    """All states that actions and changes lead to, what can be attained there, and at what cost."""

    def __init__(self, of: Task) -> None:
        self.task = of
        facts = ChangingFacts.of(of, Limits())
        self.start = tuple(map(int, of.initial[0].values))
        self.ways: dict[State, dict[str, list[tuple[float, State]]]] = {}
        waiting = [self.start]
        while waiting:
            state = waiting.pop()
            if state not in self.ways:
                self.ways[state] = {
                    each.name: [(float(p), after) for (after, _), p in outcomes_in(each, state).items()]
                    for each in of.actions
                    if value_of(each.precondition, state) == "T"
                }
                waiting += [after for way in self.ways[state].values() for _, after in way]
                waiting += [tuple(after) for after in facts.changed(bytes(state))]
        self.states = [*self.ways]
        self.chances = best_chances(of, set(self.states))
        self.costs = dict.fromkeys(self.states, 0.0)
        moved = 1.0
        while moved > 1e-12:
            moved = 0.0
            for state in self.states:
                totals = [1 + self._after(self.costs, way) for way in self._good(state)]
                if totals:
                    moved = max(moved, min(totals) - self.costs[state])
                    self.costs[state] = min(totals)

    def fault(self, root: Node) -> str | None:
        """What is wrong with what a tree does: where there is hope it has to go on, by what attains the best;
        at the least cost where its runs come by, elsewhere with a detour of one and a half steps at most."""
        taken: dict[State, list[tuple[float, State]]] = {}
        for state in self.states:
            run = Ticking(self.task, state, set(), {}, lost={})
            run.tick_all(root)
            if self.chances[state] and run.started is None and value_of(self.task.goal, state) != "T":
                return "a run stops where there is hope"
            taken[state] = [] if run.started is None else self.ways[state][run.started.action]
        visited = [self.start]
        for state in visited:  # grows
            visited += [after for _, after in taken[state] if after not in visited]
        for state, way in taken.items():
            if not self.chances[state]:
                if way and state in visited:
                    return "a run goes on where there is no hope"
                continue
            if way and self._after(self.chances, way) < self.chances[state] - 1e-9:
                return "something better can be attained"
            detour = 1 + self._after(self.costs, way) - self.costs[state]
            if way and detour > (1e-6 if state in visited else 1.5 + 1e-6):
                return "it takes a detour"
        arriving = {state for state in self.states if value_of(self.task.goal, state) == "T"}
        before = -1
        while len(arriving) > before:
            before = len(arriving)
            arriving |= {s for s, way in taken.items() if any(after in arriving for _, after in way)}
        if any(self.chances[state] and state not in arriving for state in self.states):
            return "it goes round in circles"
        return None

    def _good(self, state: State) -> Iterator[list[tuple[float, State]]]:
        if self.chances[state] and value_of(self.task.goal, state) != "T":
            for way in self.ways[state].values():
                if self._after(self.chances, way) >= self.chances[state] - 1e-9:
                    yield way

    @staticmethod
    def _after(values: dict[State, float], way: list[tuple[float, State]]) -> float:
        return sum(p * values[after] for p, after in way)
