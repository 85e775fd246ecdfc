"""Planning for a deadline: never worse than planning without one, and told beside what is possible."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

import bbtc
from bbtc import pipeline
from bbtc.artefacts import load_tree, tree_to_json
from bbtc.artefacts.jsontext import dumps
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.deadline import plan as deadlines
from bbtc.planner.deadline.induction import induction
from bbtc.planner.deadline.process import timed_process
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from bbtc.tree.nodes import ConditionNode
from tests.cli.program import bbtc as program
from tests.long_form import LONG, amount
from tests.timing.test_curve import domain_text

F = Fraction

GRIP = """
(define (domain grip)
  (:predicates (held))
  (:action careful :precondition (not (held)) :effect (probabilistic 0.95 (held)) :duration (uniform 20 40))
  (:action quick :precondition (not (held)) :effect (probabilistic 0.7 (held)) :duration 8
    :on-timeout (and) :timeout 100))
(define (problem p) (:domain grip) (:init) (:goal (held)) (:goal-probability 0.9))
"""

WAYS = """
(define (domain ways)
  (:predicates (there) (lost))
  (:action drive_round :precondition (and (not (there)) (not (lost))) :effect (there) :duration 60)
  (:action short_cut
    :precondition (and (not (there)) (not (lost)))
    :effect (probabilistic 0.8 (there) 0.2 (lost))
    :duration (uniform 10 14)))
(define (problem p) (:domain ways) (:init) (:goal (there)) (:goal-probability 0.9))
"""


def planned(text: str, seconds: int) -> deadlines.DeadlinePlan:
    return planned_for(bbtc.compile(SourceFile("d.pddl", text)), seconds, Limits(seconds=60))


def planned_for(task: Task, seconds: int, limits: Limits) -> deadlines.DeadlinePlan:
    return deadlines.plan_by(
        task,
        F(seconds),
        pipeline.plan_task,
        None,
        limits,
        strategy="auto",
        progress=lambda _: None,
        options=Options(),
    )


def without(text: str, seconds: int) -> list[Plan]:
    """What is planned without a deadline, judged by it."""
    source = SourceFile("d.pddl", text)
    plans = [bbtc.plan(source, prefer=prefer) for prefer in ("success", "cost", "size")]
    return [deadlines.judged(plan, F(seconds), Limits()) for plan in plans]


def at_least(plan: Plan) -> Fraction:
    assert plan.tree.success_by is not None
    return plan.tree.success_by.at_least


def test_a_short_cut_is_taken_where_the_deadline_leaves_nothing_else() -> None:
    (best, *_) = without(WAYS, 30)
    assert best.tree.success_probability == 1
    assert at_least(best) == 0
    found = planned(WAYS, 30)
    assert float(found.by.at_least) == pytest.approx(0.8, abs=1e-6)
    assert found.by.at_least <= F(8, 10) <= found.by.at_most
    assert found.plan.tree.status == "out-of-reach"
    assert found.most is not None
    assert float(found.most) == pytest.approx(0.8, abs=1e-6)


def test_the_sure_way_is_taken_where_there_is_time() -> None:
    found = planned(WAYS, 60)
    assert found.plan.tree.status == "target-reached"
    assert found.plan.tree.success_probability == 1
    assert float(found.by.at_least) == pytest.approx(1, abs=1e-6)


def brute_force(seconds: int) -> float:
    """GRIP, where careful tries are drawn in fine steps and each policy without a clock is one action."""
    quick = 1 - 0.3 ** (seconds // 8)
    grains = 400
    done = [0.0] * (seconds * 10 + 1)
    careful = [0.0] * (seconds * 10 + 1)
    careful[0] = 1.0
    for at in range(seconds * 10 + 1):
        if careful[at]:
            for grain in range(grains):
                later = at + 200 + round((grain + 0.5) / grains * 200)
                if later < len(careful):
                    careful[later] += careful[at] * 0.05 / grains
                    done[later] += careful[at] * 0.95 / grains
    return max(quick, sum(done))


@pytest.mark.parametrize("seconds", [8, 23, 39, 47])
def test_the_better_of_two_actions_is_found(seconds: int) -> None:
    found = planned(GRIP, seconds)
    best = brute_force(seconds)
    assert float(found.by.at_least) <= best + 0.01
    assert float(found.by.at_most) >= best - 0.01
    assert found.most is None or float(found.most) >= best - 0.01


@pytest.mark.parametrize("seed", range(amount(4, 150)))
def test_no_tree_planned_without_a_deadline_is_better(seed: int) -> None:
    generator = random.Random(1000 + seed)
    for _ in itertools.count():
        text, seconds = domain_text(generator), generator.randint(5, 80)
        try:
            others = without(text, seconds)
            found = planned(text, seconds)
        except bbtc.BbtcError as error:
            codes = {each.code for each in error.diagnostics}
            assert codes & {"BBT0412", "BBT0446", "BBT0447", "BBT0301"} or "BBT0413" in codes
            continue
        assert found.by.at_least >= max(map(at_least, others))
        assert found.by.at_least <= found.by.at_most
        if found.most is not None:
            assert found.most >= max(at_least(each) for each in [found.plan, *others])
        return


def test_a_tree_says_what_it_claims_and_is_read_back(tmp_path: Path) -> None:
    file = tmp_path / "d.pddl"
    file.write_text(WAYS)
    done = program("plan", str(file), "--deadline", "30", "--target", "0.75", "-o", str(tmp_path / "t.json"))
    assert done.returncode == 0, done.stderr
    assert "target 3/4 (0.75) reached: success within 30 s" in done.stderr
    text = (tmp_path / "t.json").read_text()
    tree = load_tree(SourceFile("t.json", text))
    assert tree.success_by is not None
    assert tree.success_by.seconds == 30
    assert dumps(tree_to_json(tree)) == text


def test_a_deadline_that_no_run_can_meet_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "d.pddl"
    file.write_text(WAYS)
    done = program("plan", str(file), "--deadline", "9")
    assert done.returncode == 1
    assert "error[BBT0447]: no run can reach the goal within 9 s" in done.stderr
    assert "the soonest takes 10 s" in done.stderr


@pytest.mark.parametrize("seconds", ["0", "-3", "soon", "1e12"])
def test_a_deadline_is_a_number_of_seconds(tmp_path: Path, seconds: str) -> None:
    file = tmp_path / "d.pddl"
    file.write_text(WAYS)
    assert program("plan", str(file), "--deadline", seconds).returncode == 2


def test_a_task_without_durations_knows_no_deadline(tmp_path: Path) -> None:
    file = tmp_path / "d.pddl"
    file.write_text(
        "(define (domain d) (:predicates (a)) (:action x :effect (a)))"
        "(define (problem p) (:domain d) (:init) (:goal (a)))"
    )
    done = program("plan", str(file), "--deadline", "5")
    assert (done.returncode, "BBT0446" in done.stderr) == (1, True)


@pytest.mark.skipif(not LONG, reason="takes 10 s of processor time: part of the long form")
@pytest.mark.parametrize(
    ("problem", "seconds"), [("along-the-corridor", 100), ("letter-upstairs", 150), ("nearly-empty", 200)]
)
def test_a_deadline_pays_in_the_building(problem: str, seconds: int) -> None:
    task = bbtc.compile("domains/building/domain.pddl", f"domains/building/{problem}.pddl")
    base = deadlines.judged(bbtc.plan(task), F(seconds), Limits())
    found = planned_for(task, seconds, Limits(seconds=120))
    assert base.tree.success_by is not None
    assert found.by.at_least > base.tree.success_by.at_most


def test_backward_induction_counts_steps() -> None:
    text = (
        "(define (domain d) (:predicates (a)) (:action x :precondition (not (a)) "
        ":effect (probabilistic 0.5 (a)) :duration 3))"
        "(define (problem p) (:domain d) (:init) (:goal (a)))"
    )
    process = timed_process(bbtc.compile(SourceFile("d.pddl", text)), Limits())
    for late in (True, False):
        found = induction(process, F(1), 10, Limits(), late=late)
        assert found.settled
        (start,) = (state for _, state in process.space.initial)
        expected = [1 - 0.5 ** (left // 3) for left in range(11)]
        assert found.values[:, start].tolist() == pytest.approx(expected)
    spread = induction(process, F(2), 5, Limits(), late=True)  # 3 s are two steps of 2 s, rounded up
    assert spread.values[:, start].tolist() == pytest.approx([0, 0, 0.5, 0.5, 0.75, 0.75])


def test_the_best_of_all_trees_is_taken_whenever_it_comes() -> None:
    # An action that does not tell its time leaves only what is planned without a deadline.
    text = WAYS.replace(
        "(:action short_cut",
        "(:action idle :effect (lost) :timeout 5 :timeout-probability 0.5) (:action short_cut",
    )
    task = bbtc.compile(SourceFile("d.pddl", text))
    good = pipeline.plan_task(task, None, "auto", Limits(seconds=20), lambda _: None)
    poor = replace(good, tree=replace(good.tree, root=ConditionNode("n1", task.goal)), chain=None)
    for plans in ([good, poor, poor, poor], [poor, good, poor, poor], [poor, poor, poor, good]):
        left = iter(plans)
        found = deadlines.plan_by(
            task,
            F(60),
            lambda *_, **__: next(left),  # noqa: B023
            None,
            Limits(seconds=20),
            strategy="auto",
            progress=lambda _: None,
            options=Options(),
        )
        assert found.plan.tree.root == good.tree.root
