"""How much of the failure a condition stands for, and what follows from it: templates are tried again as
long as they keep what they promise."""

from __future__ import annotations

from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.ground.condition import TRUE, Is
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.chaining.draft import Frozen
from bbtc.planner.chaining.flaws import Simulated
from bbtc.planner.chaining.refine import refine
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode
from tests.ground.examples import task_of
from tests.planner.test_refine import action, task

T, U, F = Truth.TRUE, Truth.UNKNOWN, Truth.FALSE


def test_the_probability_of_failing_with_a_condition_at_a_value() -> None:
    """Of the runs, 1/2 win; of the others 1/3 end with the light on, 1/6 in doubt about it. The light is on
    in half of those that win, too, which does not count."""
    toss = action("toss", TRUE, ("1/4", {0: T, 1: T}), ("1/4", {0: T}), ("1/3", {1: T}), ("1/6", {1: U}))
    of = task("won lit", {}, Is(0, T), toss)
    root = ControlNode("n1", "sequence", (ActionNode("n2", "toss()"), ConditionNode("n3", Is(0, T))))
    chain = explore(of, root, Limits())
    visits = Absorption(chain).visits()
    mass = {state: visits[state] or Fraction(0) for state in chain.final}
    simulated = Simulated(Frozen(of_goal(), {}, {}), chain, mass, Fraction(1, 2), Fraction(0))
    found = [simulated.failing(Is(1, T), value) for value in (T, U, F)]
    assert found == [Fraction(1, 3), Fraction(1, 6), 0]
    assert simulated.failing(Is(0, T), F) == Fraction(1, 2)


def of_goal() -> ConditionNode:
    """A tree without actions."""
    return ConditionNode("n1", Is(0, T))


_TRIES = """(define (domain d) (:requirements :templates) (:predicates (found) (near) (waved))
  (:action step :effect (near))
  (:action reach :precondition (near) :effect (and (not (near)) (probabilistic 1/2 (found))))
  (:action wave :effect (waved))
  (:template try :effect (probabilistic 1/2 (found)) :body BODY))
(define (problem p) (:domain d) (:init) (:goal (found)) (:goal-probability 0.9))"""


def inserted(body: str) -> list[str]:
    """What refinement inserts, in order."""
    done = refine(task_of(_TRIES.replace("BODY", body)), Fraction("0.9"), Limits(nodes=60), lambda _: None)
    return [step.inserted for step in done.refinements]


def test_a_template_that_keeps_its_promise_is_inserted_again_and_again() -> None:
    """Four times, since 1 - 1/16 is above 0.9."""
    assert inserted("(sequence (step) (reach) (condition (found)))") == ["try()"] * 4


def test_a_template_that_brings_nothing_of_its_promise_is_not_inserted_a_second_time() -> None:
    """It promises one half and only waves."""
    assert inserted("(sequence (wave) (condition (found)))").count("try()") == 1
