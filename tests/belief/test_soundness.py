"""Every invariant of a sound tree is told where it is broken."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from bbtc.belief.chain import Chain, Edge, explore
from bbtc.belief.soundness import violations
from bbtc.ground.condition import Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode
from tests.planner.test_refine import action, task

T = Truth.TRUE


def light() -> Task:
    return task("lit plugged", {1: T}, Is(0, T), action("press", Is(1, T), ("1/2", {0: T}), ("1/2", {})))


def pressed(latched: bool = True) -> Chain:
    root = ControlNode(
        "n1", "sequence", (ActionNode("n2", "press()", latched), ConditionNode("n3", Is(0, T)))
    )
    return explore(light(), root, Limits())


def test_a_sound_tree_breaks_none() -> None:
    assert violations(light(), pressed()) == []


def test_an_action_without_its_precondition_is_told() -> None:
    unplugged = task("lit plugged", {}, Is(0, T), *light().actions)
    chain = explore(unplugged, ActionNode("n1", "press()"), Limits())
    assert "press() is started where its precondition is not true" in violations(unplugged, chain)


def test_success_without_the_goal_is_told() -> None:
    chain = explore(light(), ActionNode("n1", "press()"), Limits())
    assert violations(light(), chain) == ["the tree succeeds where the goal is not true"]


def test_latched_actions_that_never_end_are_told() -> None:
    """Which no tree does: the chain is bent by hand, so that the first state comes back to itself."""
    chain = pressed()
    (first,) = (index for index, action in enumerate(chain.action) if action >= 0)
    result = replace_probability(chain.edges[first][0], Fraction(1))
    bent = replace(chain, edges=tuple((result._replace(successor=first),) if i == first else e
                                      for i, e in enumerate(chain.edges)))  # fmt: skip
    assert violations(light(), bent) == ["a tree of latched actions never ends"]


def test_probability_that_is_lost_is_told() -> None:
    chain = pressed()
    short = tuple(edges[:1] for edges in chain.edges)
    (told,) = violations(light(), replace(chain, edges=short))
    assert told == "the probabilities of all ends sum to 1/2, not 1"


def replace_probability(edge: Edge, probability: Fraction) -> Edge:
    return edge._replace(result=edge.result._replace(probability=probability))
