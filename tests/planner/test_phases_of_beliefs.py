"""Trees that count their actions where beliefs read alike and nothing is asked of them."""

from __future__ import annotations

from fractions import Fraction

from bbtc.diagnostics import LimitReached
from bbtc.limits import Effort, Limits
from bbtc.pipeline import plan_task
from tests.ground.examples import task_of

VAULT = """(define (domain vault)
  (:predicates (usual) (loose) (spent) (observed (open)) (observed (shut)) (observed (jammed)) (in))
  (:action look :observe (usual))
  (:action turn-left :precondition (not (spent))
    :effect (and (spent) (when (or (usual) (loose)) (open))
      (when (and (not (usual)) (not (loose))) (jammed))))
  (:action turn-right :precondition (not (spent))
    :effect (and (spent) (when (not (usual)) (shut)) (when (usual) (jammed))))
  (:action push :precondition (open) :effect (in))
  (:action pull :precondition (shut) :effect (in)))
(define (problem night) (:domain vault)
  (:init (probabilistic 0.9995 (usual)) (unknown (loose)))
  (:goal (in)))"""
"""After it looked, a robot reads the same whatever it was told: a tree that asks nothing turns left."""


def test_a_state_that_was_given_up_starts_nothing_without_its_precondition() -> None:
    """Where the lock turns out to be neither usual nor loose, the tree that counts has nothing left to do.
    Planning may be ended when only that tree is known; it is checked before it is written."""
    found = set()
    for looks in range(40):
        try:
            plan = plan_task(task_of(VAULT), None, "policy", Limits(effort=Effort(looks)), lambda _: None)
        except LimitReached:
            continue
        found.add(plan.tree.success_probability)
    assert Fraction(3_999, 4_000) in found
