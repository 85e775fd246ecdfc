"""What the engines do to actions that run for several ticks, case by case."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.ground.condition import TRUE, Condition, Is
from bbtc.ground.task import GroundAction, InitialState, Task, Variable
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree
from tests.replay.engines import BtcppReplay, PyTreesReplay
from tests.replay.script import TIMINGS, Run, Script, Timing

P, Q, R = (Is(index, Truth.TRUE) for index in range(3))
TRUE_, FALSE_, UNKNOWN_ = 2, 0, 1


def tree_of(root: Node, guard: Condition = TRUE) -> Tree:
    """A tree on three three-valued variables p, q, r and two actions; ``go()`` needs the guard."""
    variables = tuple(Variable(name, (), True) for name in "pqr")
    actions = (GroundAction("do", (), TRUE, ()), GroundAction("go", (), guard, ()))
    initial = (InitialState(Fraction(1), (Truth.FALSE,) * 3),)
    return Tree(Task("d", "p", variables, initial, TRUE, actions), root, Fraction(1), Fraction(1), "stuck")


def control(kind: ControlKind, *children: Node) -> ControlNode:
    return ControlNode("c", kind, children)


def check(condition: Condition) -> ConditionNode:
    return ConditionNode("k", condition)


@pytest.fixture(params=[PyTreesReplay, BtcppReplay])
def engine(request: pytest.FixtureRequest) -> type[PyTreesReplay] | type[BtcppReplay]:
    """Each engine in turn."""
    if request.param is BtcppReplay:
        pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    kind: type[PyTreesReplay] | type[BtcppReplay] = request.param
    return kind


Engine = type[PyTreesReplay] | type[BtcppReplay]


@pytest.mark.parametrize("timing", TIMINGS)
@pytest.mark.parametrize("latched", [True, False])
def test_an_action_runs_on_when_its_own_effect_ends_its_guard(
    engine: Engine, latched: bool, timing: Timing
) -> None:
    go = ActionNode("a", "go()", latched=latched, guarded=True)
    replay = engine(tree_of(control("sequence", go, check(Q)), guard=P))
    run = replay.run(Script((TRUE_, FALSE_, 0), (("go()", (FALSE_, TRUE_, 0)),)), timing)
    assert run == Run(("go()",), "success" if latched else "failure", (FALSE_, TRUE_, 0))
    assert replay.world is not None
    assert replay.world.cancelled == []


def test_a_guard_is_read_again_after_an_interruption(engine: Engine) -> None:
    go = ActionNode("a", "go()", latched=False, guarded=True)
    replay = engine(
        tree_of(control("sequence", control("fallback", check(P), go), ActionNode("b", "do()")), Q)
    )
    steps = (("go()", (TRUE_, TRUE_, 0)), ("do()", (FALSE_, FALSE_, 0)))
    run = replay.run(Script((FALSE_, TRUE_, 0), steps), "between")
    assert run == Run(("go()", "do()"), "failure", (FALSE_, FALSE_, 0))
    assert replay.world is not None
    assert replay.world.cancelled == ["go()", "do()"]


def test_an_action_whose_effect_makes_it_needless_is_cancelled_and_counts_as_run(engine: Engine) -> None:
    root = control("sequence", control("fallback", check(P), ActionNode("a", "go()")), check(Q))
    replay = engine(tree_of(root))
    run = replay.run(Script((FALSE_, TRUE_, 0), (("go()", (TRUE_, TRUE_, 0)),)), "between")
    assert run == Run(("go()",), "success", (TRUE_, TRUE_, 0))
    assert replay.world is not None
    assert replay.world.cancelled == ["go()"]


def test_the_second_of_two_nodes_for_one_action_starts_it_anew(engine: Engine) -> None:
    first = control("fallback", check(P), ActionNode("a", "go()"))
    replay = engine(tree_of(control("sequence", first, ActionNode("b", "go()"), check(Q))))
    steps = (("go()", (TRUE_, FALSE_, 0)), ("go()", (TRUE_, TRUE_, 0)))
    run = replay.run(Script((FALSE_, FALSE_, 0), steps), "between")
    assert run == Run(("go()", "go()"), "success", (TRUE_, TRUE_, 0))


@pytest.mark.parametrize("timing", TIMINGS)
def test_a_tree_that_nothing_can_unblock_fails(engine: Engine, timing: Timing) -> None:
    root = control("sequence", control("skipper", check(P), ActionNode("a", "go()")), check(Q))
    run = engine(tree_of(root)).run(Script((1, 1, 0), (("go()", (TRUE_, UNKNOWN_, 0)),)), timing)
    assert run == Run(("go()",), "failure", (TRUE_, UNKNOWN_, 0))


def test_a_failure_of_the_real_action_is_withheld_and_kept() -> None:
    import py_trees

    from bbtc.runtime import Latch, StopWhenBlocked, fallback

    calls = []

    def fail(name: str) -> py_trees.common.Status:
        calls.append(name)
        return py_trees.common.Status.FAILURE

    first = Latch("a", lambda: fail("a"), calls.append)
    second = Latch("b", lambda: fail("b"), calls.append)
    root = StopWhenBlocked(None, fallback("try", first, second))
    seen = []
    for _ in range(4):
        root.tick_once()
        seen.append(root.status.value)
    assert seen == ["RUNNING", "RUNNING", "FAILURE", "FAILURE"]
    assert calls == ["a", "b"]
