"""Trees where facts are hidden, checked world by world: without beliefs, and without Bayes' rule."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given

from bbtc.artefacts.verdict_json import verdict_to_json
from bbtc.cli.commands.verify import verdict_report
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import Is, Known
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import verify_tree
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree
from bbtc.verifier import worlds
from bbtc.verifier.chain import solvable_chain
from bbtc.verifier.explore import explore
from bbtc.verifier.solve import Recomputed, recompute
from tests.ground.examples import task_of
from tests.profiles import examples
from tests.strategies import trees

DOORS = """(define (domain tiger) (:predicates (left) (dead) (out))
  (:action listen :observe {})
  (:action open-left :effect (and (out) (when (left) (dead))))
  (:action walk :precondition (left) :effect (out))
  (:action open-right :effect (and (out) (when (not (left)) (dead)))))
(define (problem x) (:domain tiger) (:init (unknown (left))) (:goal (and (out) (not (dead)))))"""


def _looked(tree: Tree) -> Recomputed:
    space = worlds.space_of(tree.task, tree.root, Limits())
    assert space is not None
    return recompute(space, Limits())


def _blind(told: str = "(left)") -> Tree:
    """Opens a door without listening."""
    return Tree(
        task_of(DOORS.format(told)), ActionNode("n1", "open-left()"), Fraction(1, 2), Fraction(1), "stuck"
    )


def test_stops_where_the_goal_is_not_true_are_told_apart() -> None:
    verdict = verify_tree(_blind(), Limits(), "own")
    assert verdict.problems == ()
    assert verdict.worlds is not None
    assert (verdict.worlds.success, verdict.worlds.without_goal) == (1, Fraction(1, 2))
    assert "worlds    1/2 (0.5), 1/2 (0.5) mistaken, 6 states" in verdict_report(verdict)
    found = verdict_to_json(verdict)["worlds"]
    assert (found["success"], found["mistaken"], found["failure"]) == ("1/2", "1/2", "0")


@pytest.mark.parametrize("claim", ["0", "49/100", "51/100", "1"])
def test_a_claim_that_counts_other_stops_is_refused(claim: str) -> None:
    tree = replace(_blind(), success_probability=Fraction(claim), status="limit-reached", target=Fraction(1))
    problems = verify_tree(tree, Limits(), "own").problems
    assert "BBT0801" in {each.code for each in problems}
    assert f"the tree claims a success probability of {claim}" in problems[0].message


def test_a_tree_that_listens_first() -> None:
    """One look that is right with 0.85 is not known to be right, so the tree fails; a sure one helps."""
    task = task_of(DOORS.format("(left)"))
    left = task.variable_index["left()"]

    def opens(number: int, value: Truth, action: str) -> Node:
        seen = ConditionNode(f"c{number}", Is(left, value))
        return ControlNode(f"s{number}", "sequence", (seen, ActionNode(f"a{number}", action)))

    doors = ControlNode(
        "f", "fallback", (opens(1, Truth.TRUE, "open-right()"), opens(2, Truth.FALSE, "open-left()"))
    )
    listens = ControlNode("g", "fallback", (ConditionNode("k", Known(left)), ActionNode("l", "listen()")))
    root = ControlNode("r", "sequence", (listens, doors))
    tree = Tree(task, root, Fraction(1), Fraction(1), "target-reached")
    found = _looked(tree)
    assert (found.success, found.without_goal, found.actions) == (1, 0, 2)
    noisy = task_of(DOORS.format("(probabilistic 0.85 (left))"))
    found = _looked(replace(tree, task=noisy))
    assert (found.success, found.blocked, found.actions) == (0, 1, 1)


def test_too_many_worlds_are_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worlds, "MOST_STATES", 3)
    verdict = verify_tree(_blind(), Limits(), "own")
    assert verdict.hidden
    assert verdict.worlds is None
    assert verdict.problems == ()
    assert "worlds    too many to be looked at one by one" in verdict_report(verdict)
    assert verdict_to_json(verdict)["worlds"] is None
    late = replace(_blind(), success_probability=Fraction(11, 10))
    assert "BBT0801" in {each.code for each in verify_tree(late, Limits(), "own").problems}


def test_time_ends_it() -> None:
    with pytest.raises(LimitReached):
        worlds.space_of(_blind().task, _blind().root, Limits(seconds=0))


@examples(150)
@given(tree=trees())
def test_where_nothing_is_hidden_runs_are_those_of_the_chain(tree: Tree) -> None:
    """Ticks, latches, retry nodes of both kinds, outcomes and costs: read twice from the pages."""
    chain = recompute(explore(solvable_chain(tree.task, tree.root), Limits()), Limits())
    assert replace(_looked(tree), states=chain.states) == chain


def test_belief_has_weights_where_something_is_believed() -> None:
    """A door that is believed in after two equal looks, by hand: P(two looks agree rightly) and so on."""
    task = task_of(DOORS.format("(probabilistic 0.85 (left))"))
    (component,) = [each for each in task.components if "left()" in each.facts]
    sure = replace(
        component, known=tuple(replace(each, at_least=Fraction(96, 100)) for each in component.known)
    )
    task = replace(task, components=tuple(sure if each is component else each for each in task.components))
    listen = ActionNode("l", "listen()", latched=False)
    root = ControlNode("r", "fallback", (ConditionNode("k", Known(task.variable_index["left()"])), listen))
    found = _looked(Tree(task, root, Fraction(0), Fraction(1), "stuck"))
    # Readings are a walk that ends at a difference of 2: e = 2 / (1 - 2 · 0.85 · 0.15).
    assert found.actions == Fraction(2) / (1 - 2 * Fraction(85 * 15, 10_000))
