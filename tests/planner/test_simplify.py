"""Smaller trees: what every simplification leaves as it was, and what it finds."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.same_runs import same_runs
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.ground.condition import TRUE, Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.rewrite.shrink import shrunk
from bbtc.rewrite.simplify import numbered, simplified, size, without_idle_branches
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree
from bbtc.tree.validate import check_tree
from tests.domains.brute_force import runs_of
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import nodes, tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN

MOST_ACTIONS = 3
"""Runs are compared up to so many actions."""


def idle(of: Task, root: Node) -> Node:
    return without_idle_branches(of, root, explore(of, root, Limits()), Limits())


def simple(of: Task, root: Node) -> Node:
    return simplified(of, root, Limits(), closed_world=True)


def simple_anywhere(of: Task, root: Node) -> Node:
    return simplified(of, root, Limits())


@pytest.mark.parametrize("simplification", [idle, simple, simple_anywhere])
@examples(80)
@given(data=st.data())
def test_no_simplification_changes_a_run(
    simplification: Callable[[Task, Node], Node], data: st.DataObject
) -> None:
    """Random trees on random tasks; the runs are told by an interpreter of the tests' own."""
    of = data.draw(tasks())
    root = data.draw(nodes(of))
    smaller = simplification(of, root)
    assert size(smaller) <= size(root)
    assert runs_of(of, smaller, MOST_ACTIONS) == runs_of(of, root, MOST_ACTIONS)
    before, after = (simulate(of, each, Limits()) for each in (root, smaller))
    assert (before.success, before.failure, before.blocked, before.endless, before.cost) == (
        after.success,
        after.failure,
        after.blocked,
        after.endless,
        after.cost,
    )
    check_tree(Tree(of, smaller, after.success, Fraction(1), "stuck"))


@examples(80)
@given(data=st.data())
def test_trees_do_the_same_if_their_runs_are_the_same(data: st.DataObject) -> None:
    of = data.draw(tasks())
    one, other = data.draw(nodes(of)), data.draw(nodes(of))
    said = same_runs(of, explore(of, one, Limits()), other)
    found = runs_of(of, one, MOST_ACTIONS) == runs_of(of, other, MOST_ACTIONS)
    assert found or not said
    if found and all(len(run) % 2 == 0 for run in runs_of(of, one, MOST_ACTIONS)):  # none was cut
        assert said


@examples(80)
@given(data=st.data(), target=st.sampled_from(["0.5", "0.9", "1"]))
def test_what_is_dropped_does_not_cost_the_target(data: st.DataObject, target: str) -> None:
    of = data.draw(tasks())
    root = data.draw(nodes(of))
    if violations(of, explore(of, root, Limits())):
        return
    before = simulate(of, root, Limits())
    smaller = shrunk(of, root, Fraction(target), Limits(), closed_world=data.draw(st.booleans()))
    after = simulate(of, smaller, Limits())
    assert after.success >= min(before.success, Fraction(target))
    assert size(smaller) <= size(root)
    assert violations(of, explore(of, smaller, Limits())) == []


def test_a_tree_that_is_blocked_where_another_starts_its_first_action_does_something_else() -> None:
    """Both are running in that state: only one of them does anything."""
    of = task("goal", {0: Truth.UNKNOWN}, Is(0, T), action("look", TRUE, ("1/2", {0: T}), ("1/2", {0: F})))
    looking = numbered(control("skipper", is_true(0), do("look()")))
    chain = explore(of, looking, Limits())
    assert same_runs(of, chain, looking)
    assert not same_runs(of, chain, ConditionNode("n1", Is(0, T)))
    assert not same_runs(of, explore(of, ConditionNode("n1", Is(0, T)), Limits()), looking)


# --- by example ------------------------------------------------------------------------------


def control(kind: ControlKind, *children: Node) -> Node:
    return ControlNode("", kind, children)


def is_true(variable: int) -> Node:
    return ConditionNode("", Is(variable, T))


def do(name: str) -> Node:
    return ActionNode("", name, latched=False)


def three() -> Task:
    return task(
        "goal a b",
        {1: T},
        Is(0, T),
        action("try", TRUE, ("1/2", {0: T}), ("1/2", {2: T})),
        action("again", TRUE, ("1/2", {0: T}), ("1/2", {})),
    )


def test_conditions_that_always_hold_are_dropped_and_dead_branches_too() -> None:
    dead = control("sequence", control("sequence", is_true(0), is_true(1)), do("again()"))
    root = control("fallback", is_true(0), dead, control("sequence", is_true(1), do("try()")), is_true(2))
    found = simple(three(), numbered(root))
    assert numbered(found) == numbered(control("fallback", is_true(0), do("try()")))


def test_a_test_that_neighbours_share_stands_once_wherever_it_stood() -> None:
    of = task(
        "goal a b",
        {},
        Is(0, T),
        action("toss", TRUE, ("1/2", {1: T}), ("1/2", {2: T, 1: T})),
        action("try", TRUE, ("1/2", {0: T}), ("1/2", {1: F})),
        action("again", TRUE, ("1/2", {0: T}), ("1/2", {1: F})),
    )
    first = control("sequence", is_true(2), is_true(1), do("try()"))
    second = control("sequence", is_true(1), do("again()"))
    root = control("fallback", is_true(0), first, second, do("toss()"))
    found = simple(of, numbered(root))
    choice = control("fallback", control("sequence", is_true(2), do("try()")), do("again()"))
    assert numbered(found) == numbered(
        control("fallback", is_true(0), control("sequence", is_true(1), choice), do("toss()"))
    )


def test_alternatives_are_dropped_as_long_as_the_target_is_reached() -> None:
    root = numbered(
        control("fallback", is_true(0), control("sequence", is_true(2), do("again()")), do("try()"))
    )
    of = task(
        "goal a b",
        {1: T},
        Is(0, T),
        action("try", Is(2, F), ("1/2", {0: T}), ("1/2", {2: T})),
        action("again", TRUE, ("1/2", {0: T}), ("1/2", {})),
    )
    assert size(shrunk(of, root, Fraction(9, 10), Limits())) == size(root)
