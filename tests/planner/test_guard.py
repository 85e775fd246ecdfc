"""Trees for worlds that others change: no action starts without its precondition, no root succeeds without
the goal, and in the simulation they do the same as those for a world of their own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.simulate import simulate
from bbtc.belief.tick import STARTED, NodeStatus, compile_tick, memory_of
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import TRUE, And, Is, Or, conjuncts, evaluate
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task, simulate_tree, verify_tree
from bbtc.planner.guard import guarded
from bbtc.planner.options import Options, Retries
from bbtc.planner.result import Plan
from bbtc.planner.strategies import DEFAULT, STRATEGIES
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree, actions_of, walk
from bbtc.verifier.verdict import verify
from tests.domains.problems import PROBLEMS, SHORTER, Problem, task_of, tree_of
from tests.long_form import amount
from tests.profiles import examples
from tests.strategies import tasks


def planned(task: Task, strategy: str, options: Options, limits: Limits | None = None) -> Tree:
    return plan_task(task, None, strategy, limits or Limits(), lambda _: None, options=options).tree


CLOSED = Options(closed_world=True)
RETRIES: tuple[Retries, ...] = ("unbounded", "least")


def keeps_to_its_conditions(task: Task, root: Node, states: Iterable[Sequence[int]], rng: Random) -> bool:
    """In these states, whatever the tree remembers, does it start actions only where their preconditions
    hold, and succeed only where the goal does?"""
    tick = compile_tick(task, root)
    needed = [task.action_by_name[node.action].precondition for node in actions_of(root)]
    memory = memory_of(root)
    most = [0, *(rng.randrange(sum(memory.started) * 3 + 1) for _ in range(3))]
    for values in states:
        for remembered in most:
            status = tick(values, remembered)
            wanted = needed[memory.action(status)] if status >= STARTED else task.goal
            if (
                status != NodeStatus.FAILURE
                and status != NodeStatus.RUNNING
                and evaluate(wanted, values) is not Truth.TRUE
            ):
                return False
    return True


def any_values(task: Task, rng: Random, count: int) -> Iterator[list[int]]:
    """States as anybody may have left the world."""
    for _ in range(count):
        yield [rng.choice([0, 1, 2] if each.three_valued else [0, 2]) for each in task.variables]


@pytest.mark.parametrize("problem", SHORTER, ids=str)
def test_trees_of_our_domains_keep_to_their_conditions_in_any_state(problem: Problem) -> None:
    rng = Random(7)
    for strategy in {problem.strategy, DEFAULT}:
        tree = tree_of(problem, strategy)
        task = tree.task  # with what the tree asks about what is believed
        assert keeps_to_its_conditions(task, tree.root, any_values(task, rng, amount(500, 2000)), rng)
        assert verify_tree(tree, Limits(), "own").problems == ()


@examples(amount(36, 2000))
@given(task=tasks(), strategy=st.sampled_from(list(STRATEGIES)), retries=st.sampled_from(RETRIES))
def test_trees_keep_to_their_conditions_in_any_state_and_succeed_as_often(
    task: Task, strategy: str, retries: Retries
) -> None:
    limits = Limits(states=20_000, nodes=200)
    options = Options(retries=retries)
    try:
        plain = planned(task, strategy, replace(options, closed_world=True), limits)
        # The limit on nodes counts the goal's checks.
        room = replace(limits, nodes=limits.nodes + len(conjuncts(task.goal)) + 1)
        tree = planned(task, strategy, options, room)
    except LimitReached:
        return
    if retries == "unbounded" or min(tree.success_probability, plain.success_probability) < tree.target:
        assert tree.success_probability == plain.success_probability
    states = product(*[(0, 1, 2) if each.three_valued else (0, 2) for each in task.variables])
    assert keeps_to_its_conditions(task, tree.root, states, Random(3))
    assert verify(tree, Limits(), "own").problems == ()


@pytest.mark.parametrize(
    "problem",
    [each for each in PROBLEMS if each.domain != "service-robot" and not task_of(each).numbers],
    ids=str,
)
def test_what_refinement_writes_reads_all_it_needs_by_itself(problem: Problem) -> None:
    """The published trees hold a condition for each precondition, so guards change nothing in them."""
    task = task_of(problem)
    closed = planned(task, "refine", CLOSED, Limits(nodes=100))
    tree = planned(task, "refine", Options(), Limits(nodes=101 + len(conjuncts(task.goal))))
    assert tree.root == closed.root


def test_what_a_limit_allows_is_guarded_too() -> None:
    (problem,) = [each for each in PROBLEMS if str(each) == "doors/to-the-lab"]
    task = tree_of(problem).task
    limits = Limits(nodes=12)
    tree = planned(task, "refine", Options(), limits)
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
    found = guarded(Plan(tree, figures, Fraction(0), ()))
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
