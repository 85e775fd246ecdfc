"""``(believed f q)`` in domains: conditions, preconditions and goals on how probable something is."""

from __future__ import annotations

from fractions import Fraction

import pytest

import bbtc
from bbtc.artefacts import load_tree
from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.condition import variables
from bbtc.ground.task import BodyCondition, walk_body
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, export_tree, plan_task, verify_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from tests.ground.examples import task_of

RIGHT, WRONG = Fraction(17, 20), Fraction(3, 20)

DOORS = """(define (domain doors) (:types door)
  (:predicates (tiger ?d - door) (opened) (safe))
  (:constants left right - door)
  (:action listen :precondition (not (opened)) :observe (probabilistic 0.85 (tiger left)))
  (:action open :parameters (?d - door)
    :precondition (and (not (opened)) (believed (not (tiger ?d)) {q}))
    :effect (and (opened) (when (not (tiger ?d)) (safe)))))
(define (problem p) (:domain doors) (:init (oneof (tiger left) (tiger right)))
  (:goal {goal}) (:goal-probability {target}))"""


def planned(text: str) -> Plan:
    task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    return plan_task(task, None, "auto", Limits(seconds=20), lambda _: None)


def walk(difference: int) -> tuple[Fraction, Fraction]:
    """Success and expected looks of listening until so many more sounds spoke for one side: a random walk."""
    odds = (RIGHT / WRONG) ** difference
    success = odds / (1 + odds)
    return success, difference * (2 * success - 1) / (2 * RIGHT - 1)


@pytest.mark.parametrize(
    ("q", "difference"), [("0.6", 1), ("0.85", 1), ("0.86", 2), ("0.95", 2), ("0.99", 3)]
)
def test_the_tiger_is_listened_to_until_enough_is_believed(q: str, difference: int) -> None:
    """The goal may be stopped at where it is believed; what counts is whether it is true."""
    success, looks = walk(difference)
    plan = planned(DOORS.format(q=q, goal=f"(believed (safe) {q})", target=success))
    assert plan.figures.success == success
    assert plan.figures.mistaken == 1 - success
    assert plan.figures.actions == looks + 1
    verdict = verify_tree(plan.tree, Limits(), "own")
    assert verdict.problems == ()


TESTED = """(define (domain d) (:predicates (ill) (seen) (done) (mild) (bad))
  (:action test :precondition (not (seen)) :effect (seen) :observe (probabilistic 0.8 (ill)))
  (:action end :precondition {} :effect (done)))
(define (problem p) (:domain d) (:init (probabilistic {} (ill))) (:goal (done)))"""


@pytest.mark.parametrize(
    ("condition", "prior", "expected"),
    [
        # After a test the odds of 1 to 3 are 4 to 3 or 1 to 12.
        ("(believed (ill) 0.55)", "1/4", Fraction(7, 20)),
        ("(believed (ill) 0.6)", "1/4", Fraction(0)),
        ("(believed (not (ill)) 0.9)", "1/4", Fraction(13, 20)),
        ("(not (believed (ill) 0.9))", "1/4", Fraction(13, 20)),
        ("(believed (not (ill)) 3/4)", "1/4", Fraction(1)),
        ("(unknown (believed (ill) 0.9))", "1/4", Fraction(1)),
        ("(and (seen) (unknown (believed (ill) 0.9)))", "1/4", Fraction(7, 20)),
        ("(and (seen) (known (believed (ill) 0.9)))", "1/4", Fraction(13, 20)),
        ("(or (believed (ill) 0.55) (believed (not (ill)) 0.9))", "1/4", Fraction(1)),
        ("(imply (seen) (believed (ill) 0.55))", "1/4", Fraction(1)),
        ("(believed (or (ill) (not (ill))) 1)", "1/4", Fraction(1)),
    ],
)
def test_beliefs_are_those_of_bayes(condition: str, prior: str, expected: Fraction) -> None:
    text = TESTED.format(condition, prior)
    if expected == 0:
        task = task_of(text)
        assert task_value(task, Limits()).upper == 0
    else:
        assert task_value(task_of(text), Limits()).lower == expected


@pytest.mark.parametrize(
    ("condition", "value"),
    [
        ("(believed (ill) 3/4)", Truth.FALSE),
        ("(believed (not (ill)) 3/4)", Truth.TRUE),
        ("(believed (ill) 0.8)", Truth.UNKNOWN),
    ],
)
def test_the_start_has_the_value_of_the_prior(condition: str, value: Truth) -> None:
    task = task_of(TESTED.format(condition, "1/4"))
    (at,) = (number for number, each in enumerate(task.variables) if each.name.startswith("believed"))
    assert {state.values[at] for state in task.initial} == {value}


def test_a_belief_in_a_formula_joins_what_it_reads() -> None:
    """Two independent coins, each seen rightly with 0.8: both are heads with 16/25, one is with 24/25."""
    text = """(define (domain d) (:types coin) (:predicates (heads ?c - coin) (seen ?c - coin) (done))
      (:action look :parameters (?c - coin) :precondition (not (seen ?c)) :effect (seen ?c)
        :observe (probabilistic 0.8 (heads ?c)))
      (:action end :precondition (believed ({} (?c - coin) (heads ?c)) {}) :effect (done)))
    (define (problem p) (:domain d) (:objects a b - coin) (:init (unknown (heads a)) (unknown (heads b)))
      (:goal (done)))"""
    assert task_value(task_of(text.format("forall", "16/25")), Limits()).lower == Fraction(1, 4)
    assert task_value(task_of(text.format("forall", "0.65")), Limits()).upper == 0
    assert task_value(task_of(text.format("exists", "0.84")), Limits()).lower == Fraction(3, 4)
    task = task_of(text.format("exists", "0.96"))
    assert task_value(task, Limits()).lower == Fraction(1, 4)
    assert any(variable.name == "believed-formula-1(0.96)" for variable in task.variables)


def test_templates_may_ask_what_is_believed() -> None:
    template = """
      (:template attempt :parameters (?d - door) :precondition (not (opened)) :effect (safe)
        :body (sequence (condition (believed (not (tiger ?d)) 0.95)) (open ?d))))
    (define (problem"""
    text = DOORS.format(q="0.95", goal="(believed (safe) 0.95)", target="0.9")
    task = task_of(text.replace(")\n(define (problem", template))
    read = {
        task.variables[number].name
        for made in task.templates
        for part in walk_body(made.body)
        if isinstance(part, BodyCondition)
        for number in variables(part.condition)
    }
    assert read == {"believed-not-tiger(left,0.95)", "believed-not-tiger(right,0.95)"}


def test_trees_that_ask_what_is_believed_are_written_and_read() -> None:
    plan = planned(DOORS.format(q="0.95", goal="(believed (safe) 0.95)", target="0.9"))
    text = bbtc.dumps(plan)
    assert "believed-not-tiger(left,0.95)" in text
    assert bbtc.simulate(load_tree(SourceFile("tree.json", text))).success == plan.figures.success


@pytest.mark.parametrize("form", ["py_trees", "btcpp", "dot"])
def test_trees_that_ask_what_is_believed_are_exported(form: str) -> None:
    plan = planned(DOORS.format(q="0.95", goal="(believed (safe) 0.95)", target="0.9"))
    assert "believed" in str(export_tree(plan.tree, form, {}, Limits()))


@pytest.mark.parametrize(
    ("condition", "told"),
    [
        ("(believed (ill) 0.5)", "above 1/2"),
        ("(believed (ill) 1.5)", "above 1/2"),
        ("(believed (ill) 95)", "above 1/2"),
        ("(believed (seen) 0.9)", "seen() is seen"),
        ("(believed (known (ill)) 0.9)", "about facts"),
        ("(believed (believed (ill) 0.9) 0.9)", "about facts"),
    ],
)
def test_what_cannot_be_asked_is_told(condition: str, told: str) -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(TESTED.format(condition, "1/4"))
    (error,) = caught.value.diagnostics
    assert error.code == "BBT0420"
    assert told in error.message


def test_nothing_is_believed_where_nothing_is_hidden() -> None:
    text = TESTED.format("(believed (ill) 0.9)", "1/4").replace(":observe (probabilistic 0.8 (ill))", "")
    with pytest.raises(BbtcError) as caught:
        task_of(text)
    assert "BBT0420" in {each.code for each in caught.value.diagnostics}


@pytest.mark.parametrize(
    ("where", "code"),
    [
        (("(:init (prob", "(:init (or (believed (ill) 0.9) (mild)) (prob"), "BBT0405"),
        ((":observe (probabilistic 0.8 (ill))", ":observe (believed (ill) 0.9)"), "BBT0406"),
    ],
)
def test_beliefs_are_no_facts(where: tuple[str, str], code: str) -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(TESTED.format("(ill)", "1/4").replace(*where))
    assert code in {each.code for each in caught.value.diagnostics}
