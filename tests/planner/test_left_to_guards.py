"""Tests that are left to the action behind them: no tick of any state tells the two trees apart."""

from __future__ import annotations

from dataclasses import replace
from itertools import count, product
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.tick import compile_tick, memory_of
from bbtc.ground.condition import And, Condition, Is, Known, Not, conjuncts
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.planner.guard import with_guards
from bbtc.rewrite.left_to_guards import left_to_guards
from bbtc.rewrite.simplify import numbered, size
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import conditions, nodes, tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def same_ticks(of: Task, one: Node, other: Node, rng: Random) -> bool:
    """Do both trees, whatever they remember, return and start the same in every state?"""
    ticks = [compile_tick(of, each) for each in (one, other)]
    most = 3 * sum(memory_of(one).started) + 1
    for values in product(*[(0, 1, 2) if each.three_valued else (0, 2) for each in of.variables]):
        for remembered in (0, *(rng.randrange(most) for _ in range(3))):
            if ticks[0](values, remembered) != ticks[1](values, remembered):
                return False
    return True


@examples(200)
@given(data=st.data())
def test_no_tick_of_any_state_changes(data: st.DataObject) -> None:
    """Random trees, before whose actions parts of the precondition stand, and other tests."""
    of = data.draw(tasks())
    fresh = count()

    def with_tests(node: Node) -> Node:
        if isinstance(node, ControlNode):
            return replace(node, children=tuple(with_tests(child) for child in node.children))
        if isinstance(node, ConditionNode):
            return node
        parts = conjuncts(of.action_by_name[node.action].precondition)
        some = st.one_of(st.sampled_from(parts), conditions(of.variables)) if parts else st.nothing()
        tests = data.draw(st.lists(some, max_size=3)) if parts else []
        before = [ConditionNode(f"t{next(fresh)}", test) for test in tests]
        own = replace(node, latched=data.draw(st.booleans()))
        return ControlNode(f"t{next(fresh)}", "sequence", (*before, own)) if before else own

    root = numbered(with_guards(of, numbered(with_tests(data.draw(nodes(of))))))
    smaller = left_to_guards(of, root)
    assert size(smaller) <= size(root)
    assert same_ticks(of, root, smaller, Random(3))


_OF = task(
    "goal here free item door",
    {3: U, 4: U},
    Is(0, T),
    action("pick", And((Is(1, T), Is(2, T), Is(3, T))), ("1", {0: T})),
    action("look", And((Is(1, T), Is(3, U))), ("1", {3: T})),
)
OF = replace(
    _OF, variables=tuple(replace(v, three_valued=v.predicate in {"item", "door"}) for v in _OF.variables)
)
HERE, FREE, ITEM, DOOR = (Is(number, T) for number in range(1, 5))


def sequence(*parts: Condition | str, latched: bool = False) -> Node:
    """Tests, and actions by their names."""
    children = [
        ActionNode("", f"{part}()", latched) if isinstance(part, str) else ConditionNode("", part)
        for part in parts
    ]
    return numbered(ControlNode("", "sequence", tuple(children)))


@pytest.mark.parametrize(
    ("before", "left"),
    [
        ((HERE, FREE, "pick"), []),
        ((FREE, HERE, "pick"), []),
        ((DOOR, HERE, "pick"), [DOOR]),
        ((HERE, DOOR, "pick"), [HERE, DOOR]),  # else the tree would wait for the door elsewhere
        ((And((HERE, FREE)), "pick"), []),
        ((Not(FREE), "pick"), [Not(FREE)]),
        ((ITEM, "pick"), [ITEM]),  # unknown it waits, where the guard fails if the robot is not there
        ((HERE, FREE, ITEM, "pick"), []),  # where it waits, the others hold
        ((Known(3), ITEM, "pick"), [Known(3)]),
        ((Is(3, U), "look"), []),
        ((Is(3, U), DOOR, "look"), [Is(3, U), DOOR]),
    ],
)
def test_what_the_action_reads_anyway(before: tuple[Condition | str, ...], left: list[Condition]) -> None:
    root = with_guards(OF, sequence(*before))
    found = left_to_guards(OF, root)
    *tests, last = found.children if isinstance(found, ControlNode) else (found,)
    assert [each.condition for each in tests if isinstance(each, ConditionNode)] == left
    assert isinstance(last, ActionNode)
    assert last.guarded
    assert same_ticks(OF, root, found, Random(0))


def test_what_latches_or_belongs_to_a_template_or_counts_attempts_stays() -> None:
    latched = with_guards(OF, sequence(HERE, "pick", latched=True))
    plain = with_guards(OF, sequence(HERE, "pick"))
    assert isinstance(plain, ControlNode)
    own = replace(plain, template="take")
    counted = numbered(ControlNode("", "retry", (plain,), attempts=2))
    for root in (latched, own, counted):
        assert left_to_guards(OF, root) == root
