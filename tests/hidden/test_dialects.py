"""Forms of other planners: read as what they mean, or refused by name."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

from bbtc.diagnostics import BbtcError, Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, format_source
from bbtc.planner.bounds import task_value
from bbtc.source import SourceFile
from tests.ground.examples import task_of

DOMAIN = """(define (domain d) (:predicates (p) (q) (done))
  {}
  (:action end :precondition (p) :effect (done)))
(define (problem x) (:domain d) (:init {}) (:goal (done)))"""


@pytest.mark.parametrize(
    ("form", "named"),
    [
        ("(:percepts (q))", "`:percepts`"),
        ("(:observation o :effect (q) :branches (or (and (p)) (and (q))))", "`:branches`"),
        ("(:observe n :execution (end) :effect (q))", "`:observe`"),
        ("(:action look :observe-agent ?a (p))", "`:observe-agent`"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(form: str, named: str) -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(DOMAIN.format(form, "(unknown (p))"))
    (error,) = caught.value.diagnostics
    assert error.code == "BBT0212"
    assert named in error.message
    if named in {"`:percepts`", "`:observe`"}:
        assert error.hint is not None
        assert "DT-PDDL" in error.hint, "nothing is said of time"


def test_a_sensor_of_k_replanner_and_its_invariants_are_read() -> None:
    """`(invariant (p) (not (p)))` says that nobody knows; a sensor without a condition tells at the start."""
    task = task_of(DOMAIN.format("(:sensor eye :sense (p))", "(invariant (p) (not (p)))"))
    (component,) = task.components
    assert component.facts == ("p()",)
    assert [weight for _, weight in component.prior] == [component.prior[0][1]] * 2
    assert len(component.first) == 1


def best(text: str) -> tuple[Fraction, Fraction | None]:
    """P* and the least expected number of actions."""
    task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    found = task_value(task, Limits(), costs=True)
    assert found.lower == found.upper
    return found.lower, found.cost


def test_named_axioms_derive_what_is_observable() -> None:
    """Nobody knows the column; a step to the left at the wall changes nothing. Told is whether the left wall
    is there, so that at most two steps are needed, one in the mean."""
    text = """(define (domain row) (:types col)
      (:predicates (next ?a ?b - col) (at ?c - col) (first ?c - col) (wall) (free))
      (:action left :effect
        (forall (?a ?b - col) (when (and (next ?a ?b) (at ?b)) (and (at ?a) (not (at ?b))))))
      (:axiom set-wall :parameters (?c - col) :body (and (first ?c) (at ?c)) :head (wall))
      (:axiom set-free :parameters (?c - col) :body (and (not (first ?c)) (at ?c)) :head (and (free)))
      (:observable (wall) (free)))
    (define (problem three) (:domain row) (:objects a b c - col)
      (:init (next a b) (next b c) (first a) (oneof (at a) (at b) (at c))) (:goal (at a)))"""
    assert best(text) == (1, 1)


def test_what_is_sticky_stays() -> None:
    """To have been at both ends, in either order: from the middle of three, three steps."""
    text = """(define (domain row) (:types col)
      (:predicates (next ?a ?b - col) (at ?c - col) (been ?c - col))
      (:action left :parameters (?a ?b - col) :precondition (and (next ?a ?b) (at ?b))
        :effect (and (at ?a) (not (at ?b))))
      (:action right :parameters (?a ?b - col) :precondition (and (next ?a ?b) (at ?a))
        :effect (and (at ?b) (not (at ?a))))
      (:axiom visit :parameters (?c - col) :body (at ?c) :head (been ?c))
      (:sticky (forall (?c - col) (been ?c))))
    (define (problem three) (:domain row) (:objects a b c - col)
      (:init (next a b) (next b c) (at b)) (:goal (and (been a) (been c))))"""
    assert best(text) == (1, 3)


CLINIC = """(define (domain clinic) (:types illness)
  (:predicates (cured) (dead) (ill ?i - illness) (stain ?i - illness) (clean))
  (:variable disease (cured) (forall (?i - illness) (ill ?i)))
  (:variable life (dead))
  (:obs-variable result (clean) (forall (?i - illness) (stain ?i)))
  (:action treat :parameters (?i - illness) :precondition (not (dead))
    :effect (and (when (ill ?i) (cured))
      (forall (?j - illness) (when (and (ill ?j) (not (= ?i ?j))) (dead)))))
  (:action test :precondition (not (dead))
    :sensing-model (and (when (cured) (clean)) (forall (?i - illness) (when (ill ?i) (stain ?i))))))
(define (problem p) (:domain clinic) (:objects flu cold - illness) (:init (not (dead)){}) (:goal {}))"""


def test_a_variable_has_one_value_at_a_time() -> None:
    """One of flu, cold and cured: a test, and for two of them a treatment; who is cured is not ill."""
    assert best(CLINIC.format(" (not (cured))", "(cured)")) == (1, 2)
    assert best(CLINIC.format("", "(cured)")) == (1, Fraction(5, 3))
    assert best(CLINIC.format(" (ill flu)", "(and (cured) (not (ill flu)))")) == (1, 1)
    assert best(CLINIC.format(" (not (cured)) (not (ill flu))", "(and (cured) (not (ill cold)))")) == (1, 1)


def test_a_variable_without_values_left_is_refused() -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(CLINIC.format(" (not (cured)) (not (ill flu)) (not (ill cold))", "(cured)"))
    assert {each.code for each in caught.value.diagnostics} == {"BBT0414"}


def test_a_variable_with_one_value_is_a_hidden_fact_unless_init_says_it() -> None:
    text = """(define (domain rocks) (:types rock)
      (:predicates (good ?r - rock) (taken) (some ?r - rock))
      (:variable (status ?r - rock) (good ?r))
      (:obs-variable (seen ?r - rock) (some ?r))
      (:action look :parameters (?r - rock) :sensing-model
        (and (when (good ?r) (some ?r)) (when (not (good ?r)) (not (some ?r)))))
      (:action take :parameters (?r - rock) :precondition (good ?r) :effect (taken)))
    (define (problem p) (:domain rocks) (:objects a b - rock) (:init {}) (:goal (taken)))"""
    probability, _ = best(text.format(""))
    assert probability == Fraction(3, 4)
    assert best(text.format("(good a)")) == (1, 1)
    assert best(text.format("(not (good a))"))[0] == Fraction(1, 2)


def test_a_model_of_sensing_that_all_actions_share() -> None:
    """Which of two rooms is told by its exits, after each action; an exit that is read by a precondition is
    one where the model says so."""
    text = """(define (domain rooms) (:types room)
      (:predicates (at ?r - room) (up) (down) (begun) (out))
      (:constants cellar attic - room)
      (:variable place (forall (?r - room) (at ?r)))
      (:obs-variable u (up)) (:obs-variable d (down))
      (:default-sensing-model
        (and (when (at cellar) (and (up) (not (down)))) (when (at attic) (and (down) (not (up))))))
      (:action wait :effect (begun))
      (:action climb :precondition (and (begun) (up)) :effect (and (at attic) (not (at cellar))))
      (:action jump :precondition (and (begun) (at attic)) :effect (out)))
    (define (problem p) (:domain rooms) (:init) (:goal (out)))"""
    assert best(text) == (1, Fraction(5, 2))


def test_at_least_one_is_as_an_invariant() -> None:
    task = task_of(DOMAIN.format("(:sensor eye :sense (p) (q))", "(at-least-one (p) (q))"))
    (component,) = task.components
    assert (len(component.prior), len(component.first)) == (3, 2)


@pytest.mark.parametrize(
    ("form", "code"),
    [
        ("(:action look :sensing-model (when (p) (probabilistic 0.9 (q))))", "BBT0212"),
        ("(:variable v (or (p) (q)))", "BBT0101"),
        ("(:axiom tell :body (p) :head (or (q) (done)))", "BBT0101"),
        ("(:variable v (nowhere))", "BBT0202"),
        ("(:sticky (nowhere))", "BBT0202"),
        ("(:observable (forall (?x) (p ?x)))", "BBT0206"),
    ],
)
def test_what_is_wrong_in_forms_of_k_replanner_is_told(form: str, code: str) -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(DOMAIN.format(form, "(unknown (p))"))
    assert code in {each.code for each in caught.value.diagnostics}


@pytest.mark.parametrize(
    "form",
    [
        "(:axiom tell :parameters (?x) :body (p) :head (and (q) (done)))",
        "(:axiom :vars (?x) :context (p) :implies (q))",
        "(:sensor eye :sense (p))",
        "(:sensor eye :sensed (probabilistic 0.9 (p)) :repeats)",
        "(:action look :sensing-model (when (p) (q)))",
        "(:action look :observation (when (p) (q)))",
        "(:variable v (p) (forall (?x) (q ?x)))",
        "(:init-belief (prob (p) 0.5) (joint 1 (and (p) (not (q)))))",
    ],
)
def test_the_layout_keeps_the_words_of_each_form(form: str) -> None:
    text = f"(define (domain d) {form})"
    shown = format_source(SourceFile("x.pddl", text))
    assert re.sub(r"\s+", "", shown) == re.sub(r"\s+", "", text)
    assert format_source(SourceFile("x.pddl", shown)) == shown
