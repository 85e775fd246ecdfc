"""Time where events abort actions: nobody knows when, so that figures hold for any moment of it."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc import pipeline
from bbtc.diagnostics import Report
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.timing.figures import times

ROAD = """
(define (domain road)
  (:predicates (there) (clear))
  (:exogenous blocks :precondition (clear) :effect (probabilistic 0.4 (not (clear))))
  (:exogenous clears :precondition (not (clear)) :effect (clear))
  (:action wait :precondition (not (clear)) :duration 1 :effect ())
  (:action drive :while (clear) :duration 4 :effect (there)))
(define (problem go) (:domain road) (:init (clear)) (:goal (there)) (:goal-probability 0.99))
"""
"""A drive is aborted with .4, each time, and begun again after one second: N times, a geometric number."""


def test_the_bounds_hold_whenever_an_abort_comes() -> None:
    task = pipeline.compile_sources([SourceFile("road.pddl", ROAD)], Report(), Limits())
    tree = pipeline.plan_task(task, None, "policy", Limits(), lambda _: None).tree
    chain = pipeline.simulate_tree(tree, Limits())[1]
    found = times(task, chain, tree.success_probability, Limits(), Fraction(1))
    assert found is not None
    assert found.figures is not None
    # The mean of N is 2/3. At once: one second each; at the end: five.
    assert found.figures.expected == (4 + Fraction(2, 3), 4 + Fraction(10, 3))
    for number, (late, early) in enumerate(
        zip(found.figures.curve.late, found.figures.curve.early, strict=True)
    ):
        assert late == pytest.approx(_at_most((number - 4) // 5), abs=1e-9)
        # A step of the curve holds all times before the next one.
        assert _at_most(number - 4) - 1e-9 <= early <= _at_most(number + 1 - 4) + 1e-9


def _at_most(count: int) -> float:
    """How probably N is no more."""
    return 0.0 if count < 0 else 1 - 0.4 ** (count + 1)
