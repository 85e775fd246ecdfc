"""Alternatives that the target does not need are dropped, unless that makes it dearer."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from bbtc.ground.condition import TRUE, Is
from bbtc.limits import Limits
from bbtc.rewrite.shrink import shrunk
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, actions_of
from tests.planner.test_refine import T, action, task


@pytest.mark.parametrize(("lift", "stairs", "left"), [(1, 10, ["ride()"]), (10, 1, ["climb()"])])
def test_a_cheap_way_stays_where_the_other_would_do_at_a_higher_cost(
    lift: int, stairs: int, left: list[str]
) -> None:
    """To the first floor by the lift, if that works (it does), else by the stairs; each is safe."""
    up, works = 0, 1
    ride = replace(action("ride", Is(works, T), ("1", {up: T})), cost=Fraction(lift))
    climb = replace(action("climb", TRUE, ("1", {up: T})), cost=Fraction(stairs))
    of = task("up works", {works: T}, Is(up, T), climb, ride)
    riding = ControlNode("n3", "sequence", (ConditionNode("n4", Is(works, T)), ActionNode("n5", "ride()")))
    root = ControlNode(
        "n1", "fallback", (ConditionNode("n2", Is(up, T)), riding, ActionNode("n6", "climb()"))
    )
    smaller = shrunk(of, root, Fraction(1), Limits())
    assert [node.action for node in actions_of(smaller)] == left
