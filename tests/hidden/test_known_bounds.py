"""What is known of P* when a limit ends the search is told, where a policy was not found yet."""

from __future__ import annotations

import pickle
from fractions import Fraction

import pytest

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.bounds import task_value
from bbtc.planner.mdp import solve
from bbtc.planner.mdp.maxprob import Bounds
from tests.ground.examples import task_of

CLIFF = """
(define (domain cliff)
  (:predicates (fog) (fallen) (over))
  (:action listen :precondition (not (fallen)) :observe (probabilistic 0.8 (fog)))
  (:action jump :precondition (and (not (fallen)) (believed (fog) 0.9))
    :effect (probabilistic 0.7 (over) 0.3 (fallen)))
  (:action climb :precondition (and (not (fallen)) (believed (not (fog)) 0.9))
    :effect (probabilistic 0.6 (over) 0.4 (fallen))))
(define (problem one) (:domain cliff) (:init (unknown (fog))) (:goal (over)))
"""
"""Who sees everything jumps or climbs: 13/20, and no policy attains more."""


def _no_time(*_: object, **__: object) -> None:
    raise LimitReached([Diagnostic("BBT0007", "the time limit ended planning", None, None)])


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> Task:
    """A task for whose beliefs there is no time once it is known what one could do who sees everything."""
    monkeypatch.setattr(solve, "search_of", lambda *_: None)
    monkeypatch.setattr(solve, "search_bounds", _no_time)
    return task_of(CLIFF)


def test_bounds_tell_what_is_known(hurried: Task) -> None:
    found = task_value(hurried, Limits())
    assert found.lower == 0
    assert Fraction(13, 20) <= found.upper < 1
    assert found.stop is not None


def test_a_target_above_what_is_known_is_out_of_reach(hurried: Task) -> None:
    plan = plan_task(hurried, Fraction(9, 10), "refine", Limits(), lambda _: None)
    assert plan.tree.status == "out-of-reach"
    assert plan.tree.bounds is not None
    assert plan.tree.bounds[1] < 1


def test_what_is_known_goes_to_other_processes() -> None:
    """As plans of one worker do."""
    known = solve.OnlyBounds([Diagnostic("BBT0007", "m", None, None)], Bounds(Fraction(0), Fraction(1, 2)))
    again = pickle.loads(pickle.dumps(known))
    assert (again.bounds, again.diagnostics) == (known.bounds, known.diagnostics)
