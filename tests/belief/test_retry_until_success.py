"""Retry-until-success: attempts of its child are counted, and each begins with nothing remembered."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from bbtc.backends.shape import fit
from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.belief.stepper import Stepper
from bbtc.ground.condition import TRUE, Condition, Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import (
    ActionNode,
    ConditionNode,
    ControlKind,
    ControlNode,
    Node,
    tree_depth,
    tries_without_end,
    walk,
)
from tests.domains.brute_force import brute_force
from tests.planner.test_refine import action, task

T, F = Truth.TRUE, Truth.FALSE
HEADS, FLAT, LIT = (Is(index, T) for index in range(3))


def coin(goal: Condition = HEADS) -> Task:
    """A coin that is laid flat, then thrown, with heads by a chance of 1/2, and a lamp."""
    return task(
        "heads flat lit",
        {},
        goal,
        action("flatten", TRUE, ("1", {1: T})),
        action("throw", TRUE, ("1/2", {0: T}), ("1/2", {1: F})),
        action("shine", TRUE, ("1/2", {2: T}), ("1/2", {0: F})),
    )


def of(kind: ControlKind, *children: Node, attempts: int | None = None) -> ControlNode:
    return ControlNode(f"{kind}{len(children)}", kind, children, attempts=attempts)


def check(condition: Condition) -> Node:
    return ConditionNode("c", condition)


def do(name: str) -> Node:
    return ActionNode(name, f"{name}()")


def until(attempts: int, child: Node) -> ControlNode:
    return ControlNode("until", "retry-until-success", (child,), attempts=attempts)


ATTEMPT = of("sequence", do("flatten"), do("throw"), check(HEADS))
"""Two latched actions, and whether they achieved it."""


@pytest.mark.parametrize(("attempts", "success"), [(1, "1/2"), (2, "3/4"), (3, "7/8")])
def test_it_tries_so_often_and_its_actions_run_in_each_attempt(attempts: int, success: str) -> None:
    root = of("fallback", check(HEADS), until(attempts, ATTEMPT))
    figures = simulate(coin(), root, Limits())
    assert (figures.success, figures.failure) == (Fraction(success), 1 - Fraction(success))
    # Each attempt flattens and throws.
    assert figures.actions == 2 * sum(Fraction(1, 2**made) for made in range(attempts))
    assert figures.actions == brute_force(coin(), root).actions


def test_it_is_running_while_an_action_is_and_begins_the_next_attempt_in_the_same_tick() -> None:
    stepper = Stepper(coin(), until(2, ATTEMPT))
    stepper.start(0)
    for name in ("flatten", "throw", "flatten", "throw"):
        assert stepper.now.action is not None
        assert stepper.now.action.id == name
        assert stepper.now.statuses["until"].word == "running"
        tails = [number for number, each in enumerate(stepper.now.branches) if not each.values[0]]
        stepper.step(tails[0])
    assert stepper.finished
    assert stepper.now.status.word == "failure"


def test_an_attempt_that_fails_at_once_is_the_last() -> None:
    root = of("fallback", until(1_000_000, of("sequence", check(LIT), do("throw"))), do("flatten"))
    chain = explore(coin(), root, Limits())
    assert [chain.actions[started].id for started in chain.action if started >= 0] == ["flatten"]


def test_a_halted_one_begins_anew() -> None:
    """Each time that it fails, something else has to be done first, and the attempt is forgotten."""
    ajar = task(
        "shut ajar",
        {},
        Is(0, T),
        action("push", TRUE, ("1/2", {0: T}), ("1/2", {1: T})),
        action("clear", TRUE, ("1", {1: F})),
    )
    clear = of("sequence", ConditionNode("ajar", Is(1, T)), ActionNode("clear", "clear()", latched=False))
    push = of("sequence", do("push"), ConditionNode("d", HEADS))
    root = of("fallback", check(HEADS), clear, until(2, push))
    figures = simulate(ajar, root, Limits())
    assert (figures.success, figures.actions) == (1, 3)
    assert abs(brute_force(ajar, root).actions - 3) < Fraction(1, 10**9)


def test_latched_actions_below_it_may_go_on_without_end() -> None:
    stiff = task(
        "shut ajar", {}, HEADS, action("push", TRUE, ("1", {1: T})), action("clear", TRUE, ("1", {1: F}))
    )
    clear = of("sequence", ConditionNode("ajar", Is(1, T)), replace(until(1, do("clear")), id="clearing"))
    root = of(
        "fallback", check(HEADS), clear, until(2, of("sequence", do("push"), ConditionNode("d", HEADS)))
    )
    assert simulate(stiff, root, Limits()).endless == 1
    assert violations(stiff, explore(stiff, root, Limits())) == []
    assert tries_without_end(root)


def test_what_is_below_gets_its_attempts_back() -> None:
    once = of("retry", ActionNode("throw", "throw()", latched=False), attempts=1)
    attempt = of("sequence", of("fallback", check(HEADS), once), check(HEADS))
    assert simulate(coin(), until(3, attempt), Limits()).success == Fraction(7, 8)


def test_an_attempt_budget_above_goes_on_counting() -> None:
    root = of("fallback", check(HEADS), of("retry", until(5, ATTEMPT), attempts=4))
    assert simulate(coin(), root, Limits()).success == Fraction(3, 4)  # two attempts of two actions


def test_nested_ones_multiply() -> None:
    inner = replace(until(2, ATTEMPT), id="inner")
    root = of("fallback", check(HEADS), until(2, inner))
    assert simulate(coin(), root, Limits()).success == Fraction(15, 16)


def test_a_tree_that_gives_up_what_runs_is_unsound() -> None:
    """After a success the node begins anew in the next tick, and takes the place of what runs then."""
    anew = of("sequence", until(2, of("sequence", do("flatten"), check(FLAT))), do("shine"))
    chain = explore(coin(LIT), anew, Limits())
    assert violations(coin(LIT), chain) == [
        "the tree succeeds where the goal is not true",
        "shine() is given up while it runs",
    ]
    # Behind what it is there for, it does not.
    asked = of("sequence", of("fallback", check(FLAT), anew.children[0]), do("shine"), check(LIT))
    assert violations(coin(LIT), explore(coin(LIT), asked, Limits())) == []


@pytest.mark.parametrize("kind", ["retry", "retry-until-success"])
def test_nested_ones_of_a_tree_too_deep_for_an_engine_stay_two(kind: ControlKind) -> None:
    """Nodes that stand directly in others of their kind are put together, but not those that count."""
    node: Node = of(kind, of(kind, do("throw"), attempts=2), attempts=3)
    for _ in range(250):
        node = of("sequence", node, check(HEADS))
    found = fit(node, "an engine")
    assert tree_depth(found) < 10
    assert [n.attempts for n in walk(found) if isinstance(n, ControlNode) and n.kind == kind] == [3, 2]
