"""Retry nodes: attempts are counted, and then refused."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import TRUE, Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree
from bbtc.tree.validate import check_tree
from tests.planner.test_refine import action, task
from tests.replay.random_trees import random_tree
from tests.replay.reference import Ticking

T, F = Truth.TRUE, Truth.FALSE


def coin() -> Task:
    """Each throw shows heads with probability 1/2."""
    return task("heads", {}, Is(0, T), action("throw", TRUE, ("1/2", {0: T}), ("1/2", {})))


def throw(name: str = "t") -> Node:
    return ActionNode(name, "throw()", latched=False)


def retry(name: str, attempts: int, child: Node) -> Node:
    return ControlNode(name, "retry", (child,), attempts=attempts)


def until_heads(*children: Node) -> Node:
    return ControlNode("r", "fallback", (ConditionNode("h", Is(0, T)), *children))


def test_a_retry_tries_so_often_and_no_more() -> None:
    figures = simulate(coin(), until_heads(retry("again", 3, throw())), Limits())
    assert (figures.success, figures.failure, figures.endless) == (Fraction(7, 8), Fraction(1, 8), 0)
    assert figures.actions == 1 + Fraction(1, 2) + Fraction(1, 4)


def test_the_figures_name_the_retry_whose_attempts_are_used_up() -> None:
    figures = simulate(coin(), until_heads(retry("again", 1, throw())), Limits())
    assert [(s.node, s.condition, s.status) for s in figures.failures] == [
        ("again", None, NodeStatus.FAILURE)
    ]


def test_a_guarded_action_that_was_refused_lacks_no_precondition() -> None:
    guarded = ActionNode("t", "throw()", latched=False, guarded=True)  # precondition: none
    figures = simulate(coin(), until_heads(retry("again", 1, guarded)), Limits())
    assert [(s.node, s.condition) for s in figures.failures] == [("again", None)]


def test_conditions_below_a_retry_are_read_after_the_last_attempt() -> None:
    figures = simulate(coin(), retry("again", 2, until_heads(throw())), Limits())
    assert figures.success == Fraction(3, 4)


def test_used_up_attempts_fail_over() -> None:
    figures = simulate(coin(), until_heads(retry("a", 1, throw("t1")), retry("b", 2, throw("t2"))), Limits())
    assert figures.success == Fraction(7, 8)


def test_nested_retries_need_an_attempt_left_in_each() -> None:
    inner = retry("inner", 5, throw())
    assert simulate(coin(), until_heads(retry("outer", 2, inner)), Limits()).success == Fraction(3, 4)
    inner = retry("inner", 2, throw())
    assert simulate(coin(), until_heads(retry("outer", 5, inner)), Limits()).success == Fraction(3, 4)


def test_a_finished_latch_still_succeeds() -> None:
    latched = ActionNode("t", "throw()")
    figures = simulate(coin(), retry("again", 1, latched), Limits())
    assert figures.success == 1  # the latch: the root says success whatever came up


@pytest.mark.parametrize("seed", range(150))
def test_chains_of_random_trees_follow_the_reference(seed: int) -> None:
    tree = random_tree(seed, latched=0.6)
    chain = explore(tree.task, tree.root, Limits(states=3000))
    Memory = tuple[frozenset[str], tuple[tuple[str, int], ...]]
    todo: list[tuple[int, Memory]] = [(state, (frozenset(), ())) for _, state in chain.initial]
    seen: dict[int, Memory] = {}
    while todo:
        index, memory = todo.pop()
        if index in seen:
            assert seen[index] == memory, "one state of the chain, two memories"
            continue
        seen[index] = memory
        run = Ticking(tree.task, tuple(chain.states[index].values), set(memory[0]), dict(memory[1]))
        status = run.tick(tree.root)
        assert status == chain.status[index].word
        started = chain.action[index]
        assert run.started is (None if started < 0 else chain.actions[started])
        if run.started is not None and run.started.latched:
            run.finished.add(run.started.id)
        after = (frozenset(run.finished), tuple(sorted(run.tries.items())))
        todo.extend((edge.successor, after) for edge in chain.edges[index])
    assert len(seen) == len(chain.states)


@pytest.mark.parametrize(
    "root",
    [
        ControlNode("r", "retry", (throw(),)),
        ControlNode("r", "retry", (throw(),), attempts=0),
        ControlNode("r", "retry", (throw("a"), throw("b")), attempts=2),
        ControlNode("r", "sequence", (throw(),), attempts=2),
    ],
    ids=["no attempts", "none allowed", "two children", "another node"],
)
def test_the_shape_of_a_retry_is_checked(root: Node) -> None:
    with pytest.raises(BbtcError, match="BBT0613"):
        check_tree(Tree(coin(), root, Fraction(0), Fraction(1), "stuck"))
