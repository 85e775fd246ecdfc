"""What the engines do to actions that run for several ticks, case by case."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.ground.condition import TRUE, Condition, Is
from bbtc.ground.task import GroundAction, InitialState, Task, Variable
from bbtc.kleene import Truth
from bbtc.replay.engines import BtcppReplay, PyTreesReplay
from bbtc.replay.script import TIMINGS, Run, Script, Timing
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree
from tests.replay.ticks import Tick, TickScript, TickWorld, trace

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


# --- docs/multi-tick-actions.md, rule by rule --------------------------------------------------


def script(*before: tuple[int, int, int], runs: tuple[tuple[int, bool], ...], halts: int = -1) -> TickScript:
    """The values of p, q, r before each tick; they do not change within one."""
    return TickScript(before, (None,) * len(before), runs, frozenset({halts}))


def shown(ticks: list[Tick]) -> list[str]:
    """A tick as one line: ``+`` starts, ``.`` goes on, ``-`` is cancelled."""
    return [
        " ".join(
            [*("+" + a for a in t.started), *("." + a for a in t.went_on), *("-" + a for a in t.cancelled)]
        )
        + f" {t.status}"
        for t in ticks
    ]


N, Y, U = (FALSE_, 0, 0), (TRUE_, 0, 0), (UNKNOWN_, 0, 0)
WANTED = control("fallback", check(P), control("sequence", ActionNode("a", "go()"), check(P)))


def test_an_action_is_called_until_it_ends_and_its_end_shows_in_the_next_tick(engine: Engine) -> None:
    ticks = trace(engine(tree_of(WANTED)), script(N, N, N, N, runs=((3, True),)))
    assert shown(ticks) == ["+go() running", ".go() running", ".go() running", " failure"]


def test_an_action_that_ends_in_the_tick_that_starts_it_is_running_in_it(engine: Engine) -> None:
    ticks = trace(engine(tree_of(WANTED)), script(N, Y, runs=((1, True),)))
    assert shown(ticks) == ["+go() running", " success"]


def test_an_action_is_cancelled_in_the_tick_that_does_without_it(engine: Engine) -> None:
    ticks = trace(engine(tree_of(WANTED)), script(N, N, Y, Y, runs=((9, True),)))
    assert shown(ticks) == ["+go() running", ".go() running", "-go() running", " success"]


def test_what_is_true_while_an_action_is_cancelled_need_not_be_true_in_the_next_tick(engine: Engine) -> None:
    ticks = trace(engine(tree_of(WANTED)), script(N, N, Y, N, runs=((9, True),)))
    assert shown(ticks) == ["+go() running", ".go() running", "-go() running", " failure"]


def test_an_action_is_cancelled_where_a_precondition_fails_and_does_not_start_again(engine: Engine) -> None:
    root = control(
        "fallback",
        control("sequence", check(P), ActionNode("a", "go()"), check(Q)),
        control("sequence", ActionNode("b", "do()"), check(Q)),
    )
    ticks = trace(engine(tree_of(root)), script(Y, N, N, Y, Y, runs=((9, True), (2, True))))
    assert shown(ticks) == ["+go() running", "-go() running", "+do() running", ".do() running", " failure"]


def test_the_same_action_starts_anew_for_a_node_to_the_left(engine: Engine) -> None:
    root = control(
        "fallback",
        control("sequence", check(P), ActionNode("a", "go()"), check(Q)),
        control("sequence", ActionNode("b", "go()"), check(Q)),
    )
    ticks = trace(engine(tree_of(root)), script(N, Y, Y, Y, runs=((9, True), (2, True))))
    assert shown(ticks) == ["+go() running", "-go() running", "+go() running", ".go() running"]


def test_an_action_whose_condition_becomes_unknown_is_cancelled_and_nothing_goes_on(engine: Engine) -> None:
    ticks = trace(engine(tree_of(WANTED)), script(N, U, U, runs=((9, True),)))
    assert shown(ticks) == ["+go() running", "-go() running", " failure"]


def test_a_failed_action_fails_once_it_has_ended_and_is_not_tried_again(engine: Engine) -> None:
    root = control("fallback", ActionNode("a", "go()"), ActionNode("b", "do()"))
    ticks = trace(engine(tree_of(root)), script(N, N, N, N, runs=((2, False), (1, True))))
    assert shown(ticks) == ["+go() running", ".go() running", "+do() running", " success"]


def test_an_action_that_is_not_latched_starts_again_after_every_end(engine: Engine) -> None:
    root = control("fallback", check(P), ActionNode("a", "go()", latched=False))
    ticks = trace(engine(tree_of(root)), script(N, N, N, N, Y, Y, runs=((2, True), (1, False), (9, True))))
    starts = ["+go() running", ".go() running", "+go() running", "+go() running"]
    assert shown(ticks) == [*starts, "-go() running", " success"]


def test_an_action_that_fails_at_once_is_tried_once_a_tick_also_without_end(engine: Engine) -> None:
    root = control("fallback", check(P), ActionNode("a", "go()", latched=False))
    ticks = trace(engine(tree_of(root)), script(N, N, N, Y, runs=((1, False),) * 9))
    assert shown(ticks) == ["+go() running", "+go() running", "+go() running", " success"]


def test_a_cancelled_attempt_counts_below_a_retry_node(engine: Engine) -> None:
    go = ActionNode("a", "go()", latched=False)
    tries = control("fallback", control("sequence", check(P), go), check(Q))
    root = control("fallback", ControlNode("r", "retry", (tries,), attempts=2), ActionNode("b", "do()"))
    ticks = trace(engine(tree_of(root)), script(Y, N, N, Y, Y, runs=((9, True), (1, True), (1, True))))
    starts = ["+do() running", "+go() running"]
    assert shown(ticks) == ["+go() running", "-go() running", *starts, " success"]


def test_a_tree_that_is_halted_by_a_larger_one_cancels_what_runs_and_can_go_on(engine: Engine) -> None:
    root = control("sequence", ActionNode("a", "go()"), ActionNode("b", "do()"))
    ticks = trace(engine(tree_of(root)), script(N, N, N, N, runs=((9, True), (2, True)), halts=1))
    assert shown(ticks) == ["+go() running", ".go() -go() running", "+do() running", ".do() running"]


def test_halting_all_of_behaviortree_cpp_cancels_what_runs() -> None:
    pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    root = control("sequence", ActionNode("a", "go()"), ActionNode("b", "do()"))
    replay = BtcppReplay(tree_of(root))
    world = TickWorld(replay.task, script(N, runs=((9, True),)))
    replay.begin(world)
    world.next_tick()
    assert replay.tick() == "running"
    replay.halt_all()
    assert shown(world.ticks) == ["+go() -go() "]


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
