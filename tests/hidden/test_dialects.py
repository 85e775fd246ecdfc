"""Forms of other planners: read as what they mean, or refused by name."""

from __future__ import annotations

import pytest

from bbtc.diagnostics import BbtcError
from tests.ground.examples import task_of

DOMAIN = """(define (domain d) (:predicates (p) (q) (done))
  {}
  (:action end :precondition (p) :effect (done)))
(define (problem x) (:domain d) (:init {}) (:goal (done)))"""


@pytest.mark.parametrize(
    ("form", "named"),
    [
        (
            "(:action look :sensing-model (and (when (p) (q)) (when (not (p)) (not (q)))))",
            "`:sensing-model`",
        ),
        ("(:axiom tell :parameters () :body (p) :head (and (q) (done)))", "`:axiom NAME`"),
        ("(:variable (place) (p) (q))", "`:variable`"),
        ("(:observables (q))", "`:observables`"),
        ("(:action look :observe-agent ?a (p))", "`:observe-agent`"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(form: str, named: str) -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(DOMAIN.format(form, "(unknown (p))"))
    (error,) = caught.value.diagnostics
    assert error.code == "BBT0212"
    assert named in error.message


def test_a_sensor_of_k_replanner_and_its_invariants_are_read() -> None:
    """`(invariant (p) (not (p)))` says that nobody knows; a sensor without a condition tells at the start."""
    task = task_of(DOMAIN.format("(:sensor eye :sense (p))", "(invariant (p) (not (p)))"))
    (component,) = task.components
    assert component.facts == ("p()",)
    assert [weight for _, weight in component.prior] == [component.prior[0][1]] * 2
    assert len(component.first) == 1
