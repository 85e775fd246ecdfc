"""Readings that stay until a fact that they tell of changes."""

from __future__ import annotations

import json
from fractions import Fraction

import pytest

from bbtc.artefacts import dumps, task_from_json, task_to_json
from bbtc.diagnostics import Report
from bbtc.ground.task import effects_of
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, verify_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from tests.ground.examples import task_of

WARD = """(define (domain ward) (:predicates (ill) (cold) (treated) (well))
  {sense}
  {more}
  (:action give :precondition (not (treated)) :effect (and (treated) (when (ill) (well))))
  (:action spare :precondition (not (treated)) :effect (and (treated) (when (not (ill)) (well)))))
(define (problem patient) (:domain ward) (:init (unknown (ill))) (:goal (well)) (:goal-probability 0.9))"""
TEST = "(:action test :precondition (not (treated)) :observe (probabilistic 0.85 (ill)) {})"


def planned(text: str, max_actions: int | None = None) -> Plan:
    task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    options = Options(max_actions=max_actions, allow_guess=True)
    return plan_task(task, None, "policy", Limits(), lambda _: None, options=options)


@pytest.mark.parametrize("looks", [1, 2, 3, 4])
def test_looking_again_tells_nothing_new(looks: int) -> None:
    """Of k looks that are drawn anew the majority is right; with `:repeats` one look is as good as all. To
    treat and to stop are actions, too."""
    text = WARD.format(sense=TEST.format(":repeats"), more="")
    kept = planned(text, max_actions=looks + 2)
    assert kept.figures.success == Fraction(17, 20)
    anew = planned(WARD.format(sense=TEST.format(""), more=""), max_actions=looks + 2)
    assert anew.figures.success == Fraction(17, 20) if looks < 3 else anew.figures.success > Fraction(9, 10)


def test_p_star_is_exact_where_readings_stay() -> None:
    """Beliefs come to an end, so that the bounds meet."""
    plan = planned(WARD.format(sense=TEST.format(":repeats"), more=""))
    assert plan.tree.status == "out-of-reach"
    assert plan.tree.bounds == (Fraction(17, 20), Fraction(17, 20))


def test_a_noisy_sensor_that_stays() -> None:
    sensor = "(:sensor eye :sensed (probabilistic 0.85 (ill)) :repeats)"
    plan = planned(WARD.format(sense=sensor, more=""))
    assert (plan.figures.success, plan.figures.actions) == (Fraction(17, 20), 1)


@pytest.mark.parametrize(
    "change",
    [
        "(:action flip :effect (and (when (ill) (not (ill))) (when (not (ill)) (ill))))",
        "(:action stir :effect (unknown (ill)))",
        "(:action heal :effect (probabilistic 0.3 (not (ill))))",
    ],
)
def test_a_reading_is_drawn_anew_where_what_it_tells_of_changes(change: str) -> None:
    task = task_of(WARD.format(sense=TEST.format(":repeats"), more=change))
    (component,) = task.components
    (wrong,) = (at for at, fact in enumerate(component.facts) if fact.startswith("misread"))
    (action,) = (each for each in task.actions if each.schema == change.split()[1])
    (made,) = action.changes
    sets = {pair for effect in effects_of(made.factors) for pair in effect.sets}
    assert {value for number, value in sets if number == wrong} == {0, 2}


@pytest.mark.parametrize(
    "change",
    [
        "(:action cool :effect (cold))",
        "(:action same :effect (and (when (ill) (ill)) (when (not (ill)) (not (ill)))))",
    ],
)
def test_what_changes_nothing_that_a_reading_tells_of_leaves_it(change: str) -> None:
    plan = planned(WARD.format(sense=TEST.format(":repeats"), more=change), max_actions=7)
    assert plan.figures.success == Fraction(17, 20)


def test_flipping_gives_an_independent_look() -> None:
    """Turned over and looked at again, up to three times: as good as three independent looks."""
    flip = "(:action flip :effect (and (when (ill) (not (ill))) (when (not (ill)) (ill))))"
    plan = planned(WARD.format(sense=TEST.format(":repeats"), more=flip), max_actions=7)
    three = Fraction(17, 20) ** 3 + 3 * Fraction(17, 20) ** 2 * Fraction(3, 20)
    assert plan.figures.success == three


def test_figures_are_verified_world_by_world() -> None:
    flip = "(:action flip :effect (and (when (ill) (not (ill))) (when (not (ill)) (ill))))"
    plan = planned(WARD.format(sense=TEST.format(":repeats"), more=flip), max_actions=4)
    verdict = verify_tree(plan.tree, Limits(), "own")
    assert verdict.problems == ()


def test_tasks_with_readings_that_stay_are_written_and_read() -> None:
    task = task_of(WARD.format(sense=TEST.format(":repeats"), more=""))
    text = dumps(task_to_json(task))
    assert task_from_json(json.loads(text)) == task
    again = task_value(task_from_json(json.loads(text)), Limits(), Options(max_actions=3))
    assert again.upper == task_value(task, Limits(), Options(max_actions=3)).upper


def test_the_worst_world_does_not_choose_the_noise() -> None:
    """That the reading is wrong is drawn, in every world: the patient, ill or not, is treated rightly with
    .85."""
    worst = planned(WARD.format(sense=TEST.format(":repeats"), more="")).figures.worst
    assert worst is not None
    assert worst.success == Fraction(17, 20)
    assert not any("misread" in fact for fact in worst.facts)


def test_repeats_without_noise_is_warned_of() -> None:
    report = Report()
    text = WARD.format(sense="(:action test :observe (ill) :repeats)", more="")
    compile_sources([SourceFile("x.pddl", text)], report, Limits())
    assert "BBT0419" in {each.code for each in report}
