"""Noisy readings that err more often one way than the other."""

from __future__ import annotations

import json
import runpy
from fractions import Fraction
from pathlib import Path

import pytest

from bbtc.artefacts import dumps, load_task, load_tree, task_to_json, tree_to_json
from bbtc.belief.worst_world import worst_world
from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, export_tree, plan_task, simulate_tree, verify_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from tests.ground.examples import task_of

WARD = """
(define (domain ward)
  (:predicates (ill) (done) (well))
  (:action test :precondition (not (done)) :observe {told} {repeats})
  (:action treat :precondition (and (not (done)) {treat})
    :effect (and (done) (when (ill) (well))))
  (:action leave :precondition (and (not (done)) {leave})
    :effect (and (done) (when (not (ill)) (well)))))
(define (problem patient)
  (:domain ward) (:init (probabilistic 0.1 (ill))) (:goal (well)) (:goal-probability 1/2))
"""
BOTH = "(probabilistic 0.9 (ill) 0.7 (not (ill)))"


def ward(told: str = BOTH, repeats: str = "", treat: str = "(and)", leave: str = "(and)") -> str:
    return WARD.format(told=told, repeats=repeats, treat=treat, leave=leave)


def best(text: str, looks: int) -> Fraction:
    """P* with so many looks, one thing to do, and a stop where the goal is left open."""
    found = task_value(task_of(text), Limits(), Options(max_actions=looks + 2, allow_guess=True))
    assert found.lower == found.upper
    return found.lower


def planned(text: str, seconds: float = 5) -> Plan:
    task: Task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    options = Options(allow_guess=True, max_actions=3)
    return plan_task(
        task, Fraction(79, 100), "policy", Limits(seconds=seconds), lambda _: None, options=options
    )


def test_figures_are_those_of_bayes() -> None:
    """One of ten is ill. Told so, .09 rightly and .27 wrongly; told so twice, .081 and .081. Three readings
    are worth something: told so each time, .0729 and .0243."""
    assert [best(ward(), looks) for looks in (0, 1, 2)] == [Fraction(9, 10)] * 3, "it is better to leave"
    thrice = Fraction(1, 10) * Fraction(9, 10) ** 3, Fraction(9, 10) * Fraction(3, 10) ** 3
    assert best(ward(), 3) == Fraction(9, 10) + thrice[0] - thrice[1]


@pytest.mark.parametrize(("threshold", "told"), [("0.74", True), ("0.76", False)])
def test_what_is_believed_after_one_reading(threshold: str, told: bool) -> None:
    """Told that he is ill, with .36, he is well with 3/4; told not, with 63/64. To leave is safe enough after
    both readings, or after one."""
    text = """(define (domain ward) (:predicates (ill) (done) (tested) (well))
      (:action test :precondition (not (tested)) :effect (tested) :observe {both})
      (:action leave :precondition (and (tested) (believed (not (ill)) {threshold})) :effect (well)))
    (define (problem p) (:domain ward) (:init (probabilistic 0.1 (ill))) (:goal (well)))"""
    found = task_value(task_of(text.format(both=BOTH, threshold=threshold)), Limits())
    assert found.lower == found.upper == (1 if told else Fraction(64, 100))


@pytest.mark.parametrize("order", [BOTH, "(probabilistic 0.7 (not (ill)) 0.9 (ill))"])
def test_the_order_says_nothing(order: str) -> None:
    assert best(ward(order), 3) == best(ward(), 3)


def test_what_is_right_equally_often_is_as_before() -> None:
    assert task_of(ward("(probabilistic 0.9 (ill) 0.9 (not (ill)))")) == task_of(
        ward("(probabilistic 0.9 (ill))")
    )


def test_a_sensor_that_errs_one_way_only_makes_sure() -> None:
    """Told ill, he is ill; and a tree for that needs no guess."""
    text = ward("(probabilistic 0.5 (ill) 1 (not (ill)))", treat="(ill)", leave="(not (and))")
    found = task_value(task_of(text), Limits(), Options(max_actions=3))
    assert found.lower == found.upper == Fraction(1, 10) * Fraction(3, 4)


def test_readings_that_stay_err_one_way_each() -> None:
    """Who is told twice learns nothing more."""
    text = ward(repeats=":repeats")
    assert best(text, 1) == best(text, 3) == Fraction(9, 10)
    likely = text.replace("0.1 (ill)", "0.5 (ill)")
    assert best(likely, 1) == best(likely, 3) == Fraction(1, 2) * (Fraction(9, 10) + Fraction(7, 10))


def test_trees_are_simulated_verified_and_exported() -> None:
    plan = planned(ward().replace("0.1 (ill)", "0.5 (ill)"))
    figures, _ = simulate_tree(plan.tree, Limits())
    assert figures.success == best(ward().replace("0.1 (ill)", "0.5 (ill)"), 1) == Fraction(4, 5)
    assert verify_tree(plan.tree, Limits(), "own").problems == ()
    tree = load_tree(SourceFile("t.json", dumps(tree_to_json(plan.tree))))
    assert simulate_tree(tree, Limits())[0] == figures
    worst = worst_world(plan.tree.task, plan.tree.root, Limits())
    assert worst is not None
    assert worst.success == Fraction(7, 10), "where he is well, the test errs more often"
    assert worst.true == frozenset()
    for form in ("py_trees", "prism", "jani", "json"):
        assert export_tree(plan.tree, form, {}, Limits())


def test_the_simulated_world_of_an_export_errs_so(tmp_path: Path) -> None:
    """In each world one reading is made, under one name, and as often right as the domain says."""
    plan = planned(ward().replace("0.1 (ill)", "0.5 (ill)"))
    written = export_tree(plan.tree, "py_trees", {}, Limits())
    assert isinstance(written, str)
    (tmp_path / "ward.py").write_text(written, "utf-8")
    tellings = runpy.run_path(str(tmp_path / "ward.py"))["TELLINGS"]["test",]
    assert len(tellings) == 2
    assert len({each.name for each in tellings}) == 1
    for ill, accuracy in ((True, "9/10"), (False, "7/10")):
        (made,) = (each for each in tellings if each.when({("really ill",): ill}))
        assert made.accuracy == accuracy
        assert made.tells({("really ill",): ill}) is ill


def test_a_task_is_written_and_read() -> None:
    task = task_of(ward())
    saved = dumps(task_to_json(task))
    assert load_task(SourceFile("t.json", saved)) == task
    assert json.loads(saved)["actions"][1]["changes"][0]["observations"] == [
        {"condition": ["is", "ill()", "true"], "accuracy": "0.9", "accuracy_false": "0.7"}
    ]


@pytest.mark.parametrize(
    ("told", "code"),
    [
        ("(probabilistic 0.9 (ill) 0.1 (not (ill)))", "BBT0432"),
        ("(probabilistic 0.2 (ill) 0.3 (not (ill)))", "BBT0432"),
        ("(probabilistic 0.9 (ill) 1.2 (not (ill)))", "BBT0210"),
        ("(probabilistic 0.9 (ill) 0.7 (not (done)))", "BBT0211"),
        ("(probabilistic 0.5 (ill) 0.5 (not (done)))", "BBT0406"),
        ("(probabilistic 0.5 (ill) 0.3 (ill))", "BBT0406"),
    ],
)
def test_what_tells_nothing_is_refused(told: str, code: str) -> None:
    with pytest.raises(BbtcError) as refused:
        task_of(ward(told))
    assert code in {each.code for each in refused.value.diagnostics}
