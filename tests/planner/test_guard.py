"""Guarded trees: the same runs in the simulation, with every precondition and the goal read."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.simulate import simulate
from bbtc.belief.tick import STARTED, NodeStatus, compile_tick
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import TRUE, And, Is, Or, conjuncts, evaluate
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task, simulate_tree
from bbtc.planner.guard import guarded
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.planner.strategies import STRATEGIES
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Tree, actions_of, walk
from bbtc.verifier.verdict import verify
from tests.domains.problems import PROBLEMS, Problem, plan_of
from tests.long_form import amount
from tests.profiles import examples
from tests.strategies import tasks


def planned(task: Task, strategy: str, options: Options, limits: Limits | None = None) -> Tree:
    return plan_task(task, None, strategy, limits or Limits(), lambda _: None, options=options).tree


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_guarded_trees_of_our_domains_succeed_as_often_at_the_same_cost(problem: Problem) -> None:
    plain = plan_of(problem, "auto").tree
    tree = planned(plain.task, "auto", Options(guarded=True))
    assert (tree.success_probability, tree.status) == (plain.success_probability, plain.status)
    ours, theirs = (simulate_tree(each, Limits())[0] for each in (tree, plain))
    assert (ours.success, ours.cost, ours.actions) == (theirs.success, theirs.cost, theirs.actions)
    assert ours.failure + ours.blocked == theirs.failure + theirs.blocked
    for node in actions_of(tree.root):
        assert node.guarded == (tree.task.action_by_name[node.action].precondition != TRUE)
    goal = conjuncts(tree.task.goal)
    assert isinstance(tree.root, ControlNode)
    assert tree.root.kind == "sequence"
    last = tree.root.children[-len(goal) :]
    assert tuple(node.condition for node in last if isinstance(node, ConditionNode)) == goal
    assert sum(1 for _ in walk(tree.root)) <= sum(1 for _ in walk(plain.root)) + len(goal) + 1
    assert verify(tree, Limits(), "own").problems == ()


@examples(amount(60, 2000))
@given(task=tasks(), strategy=st.sampled_from(list(STRATEGIES)))
def test_guards_cost_no_success(task: Task, strategy: str) -> None:
    limits = Limits(seconds=20, states=20_000, nodes=200)
    try:
        plain = planned(task, strategy, Options(), limits)
        # The limit on nodes counts the goal's checks.
        room = replace(limits, nodes=limits.nodes + len(conjuncts(task.goal)) + 1)
        tree = planned(task, strategy, Options(guarded=True), room)
    except LimitReached:
        return
    assert tree.success_probability == plain.success_probability
    assert verify(tree, Limits(), "own").problems == ()


def test_what_a_limit_allows_is_guarded_too() -> None:
    (problem,) = [each for each in PROBLEMS if str(each) == "doors/to-the-lab"]
    task = plan_of(problem).tree.task
    limits = Limits(nodes=12)
    tree = planned(task, "refine", Options(guarded=True), limits)
    assert tree.status == "limit-reached"
    assert sum(1 for _ in walk(tree.root)) <= limits.nodes
    assert tree.success_probability == simulate_tree(tree, Limits())[0].success
    assert tree.success_probability < Fraction(1)


def test_below_a_retry_node_a_test_takes_the_place_of_a_guard_that_would_block_the_tree() -> None:
    """The first action may make its own precondition unknown; then its attempts are used up, and the second
    one's turn comes."""
    ready, done, half = 0, 1, Fraction(1, 2)
    outcomes = (
        Outcome(half, (Effect(None, ((done, Truth.TRUE),)),)),
        Outcome(half, (Effect(None, ((ready, Truth.UNKNOWN),)),)),
    )
    needed = Or((And((Is(ready, Truth.TRUE), Is(done, Truth.FALSE))), Is(done, Truth.TRUE)))
    task = Task(
        domain="d",
        problem="p",
        variables=(Variable("ready", (), True), Variable("done", (), True)),
        initial=(InitialState(Fraction(1), (Truth.TRUE, Truth.FALSE)),),
        goal=Is(done, Truth.TRUE),
        actions=(
            GroundAction("first", (), needed, (Factor(outcomes),)),
            GroundAction("second", (), TRUE, (Factor((replace(outcomes[0], probability=Fraction(1)),)),)),
        ),
    )
    first, second = (ActionNode(name, f"{name}()", latched=False) for name in ("first", "second"))
    tries = ControlNode("tries", "retry", (first,), attempts=1)
    root = ControlNode("root", "fallback", (ConditionNode("goal", task.goal), tries, second))
    figures = simulate(task, root, Limits())
    tree = Tree(task, root, Fraction(1), Fraction(1), "target-reached")
    found = guarded(Plan(tree, figures, Fraction(0), ()), Limits())
    assert (figures.success, figures.cost) == (1, Fraction(3, 2))
    assert (found.figures.success, found.figures.cost) == (figures.success, figures.cost)
    assert verify(found.tree, Limits(), "own").problems == ()
    tick = compile_tick(task, found.tree.root)
    starts = [node.action for node in actions_of(found.tree.root)]
    for values in product(range(3), repeat=2):
        status = tick(values, 0)
        if values[done] == Truth.FALSE:
            # Whatever the world is like, the first one starts only where its precondition is true.
            expected = "first()" if evaluate(needed, values) is Truth.TRUE else "second()"
            assert starts[status - STARTED] == expected
        else:
            assert status == (NodeStatus.SUCCESS if values[done] == Truth.TRUE else NodeStatus.RUNNING)
