"""Time-outs of actions in exported trees, in the engines themselves, by the clock."""

from __future__ import annotations

import time
from fractions import Fraction

import pytest

import bbtc
from bbtc.durations import Fixed
from bbtc.ground.condition import TRUE, Is
from bbtc.ground.task import Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.replay.engines import BtcppReplay, PyTreesReplay
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree
from tests.replay.ticks import TickScript, TickWorld

DONE = Is(0, Truth.TRUE)
TICKS = 60


def tree_of(latched: bool) -> Tree:
    """Go, and if that does not do it, do."""
    late = Factor((Outcome(Fraction(1), (), timed_out=True),))
    go = GroundAction("go", (), TRUE, (late,), duration=Fixed(Fraction(9)), timeout=Fraction(1, 20))
    actions = (GroundAction("do", (), TRUE, ()), go)
    task = Task(
        "d", "p", (Variable("done", (), False),), (InitialState(Fraction(1), (Truth.FALSE,)),), DONE, actions
    )

    def attempt(number: int, action: str) -> Node:
        children = (ActionNode(f"a{number}", action, latched), ConditionNode(f"c{number}", DONE))
        return ControlNode(f"s{number}", "sequence", children)

    children = (ConditionNode("c", DONE), attempt(1, "go()"), attempt(2, "do()"))
    return Tree(task, ControlNode("r", "fallback", children), Fraction(0), Fraction(1), "stuck")


class SlowWorld(TickWorld):
    """Ticks come every few milliseconds."""

    def next_tick(self) -> None:
        super().next_tick()
        time.sleep(0.01)


@pytest.mark.parametrize("kind", [PyTreesReplay, BtcppReplay])
def test_an_action_is_given_up_and_counts_as_run(kind: type[PyTreesReplay] | type[BtcppReplay]) -> None:
    if kind is BtcppReplay:
        pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    engine = kind(tree_of(latched=True))
    script = TickScript(((0,),) * TICKS, (None,) * TICKS, ((1000, True), (3, True)), frozenset())
    world = SlowWorld(engine.task, script)
    engine.begin(world)
    for _ in range(TICKS):
        world.next_tick()
        status = engine.tick()
        world.tick_ended(status)
        if status != "running":
            break
    started = [action for tick in world.ticks for action in tick.started]
    cancelled = [action for tick in world.ticks for action in tick.cancelled]
    assert (started, cancelled, world.ticks[-1].status) == (["go()", "do()"], ["go()"], "failure")
    assert sum(len(tick.went_on) for tick in world.ticks) >= 3


@pytest.mark.parametrize("nodes", ["stock", "bbtc"])
@pytest.mark.parametrize("strategy", ["auto", "refine"])
def test_time_outs_are_read_back(nodes: str, strategy: str) -> None:
    text = SourceFile("d.pddl", DOMAIN)
    tree = bbtc.plan(text, strategy=strategy).tree
    written = bbtc.export(tree, "btcpp", nodes=nodes)
    assert '<Timeout msec="15500">' in written
    back = bbtc.import_tree(SourceFile("t.xml", written), text)
    assert back.success_probability == tree.success_probability
    assert bbtc.export(back, "btcpp", nodes=nodes) == written


DOMAIN = """
(define (domain grip)
  (:predicates (held) (clear))
  (:action clear_up :precondition (not (clear)) :effect (clear) :duration 2)
  (:action grasp :precondition (and (clear) (not (held))) :effect (held)
    :duration (uniform 5 20) :timeout 15.5 :on-timeout (not (clear))))
(define (problem p) (:domain grip) (:init) (:goal (held)) (:goal-probability 0.9))
"""


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('msec="15500"', 'msec="9000"', "has to be given up after 15500 ms"),
        ("<Timeout", "<Inverter", "no counterpart"),
    ],
)
def test_another_time_out_than_that_of_the_task_is_refused(before: str, after: str, said: str) -> None:
    text = SourceFile("d.pddl", DOMAIN)
    written = bbtc.export(bbtc.plan(text).tree, "btcpp")
    edited = written.replace(before, after)
    if "Inverter" in after:
        edited = edited.replace(' msec="15500"', "").replace("</Timeout>", "</Inverter>")
    with pytest.raises(bbtc.BbtcError, match=said):
        bbtc.import_tree(SourceFile("t.xml", edited), text)
