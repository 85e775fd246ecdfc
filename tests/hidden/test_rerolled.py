"""Trees that look again at what has not changed, and whose figures rest on it, are told."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from tests.cli.program import bbtc as program

WARD = """(define (domain ward) (:predicates (ill) (fresh) (treated) (well))
  {sense}
  (:action give :precondition (not (treated)) :effect (and (treated) (when (ill) (well))))
  (:action spare :precondition (not (treated)) :effect (and (treated) (when (not (ill)) (well)))))
(define (problem patient) (:domain ward) (:init (fresh) (unknown (ill)))
  (:goal (well)) (:goal-probability {}))"""
TEST = "(:action test :precondition (not (treated)) :observe (probabilistic 0.85 (ill)))"
ONCE = """(:action test :precondition (and (fresh) (not (treated))) :effect (not (fresh))
    :observe (probabilistic 0.85 (ill)))"""
FLIP = (
    ONCE
    + """
  (:action flip :precondition (not (fresh))
    :effect (and (fresh) (when (ill) (not (ill))) (when (not (ill)) (ill))))"""
)
WAIT = ONCE + " (:action wait :precondition (not (fresh)) :effect (fresh))"


@pytest.mark.parametrize(
    ("sense", "target", "told"),
    [
        (TEST, "0.9", ("test()",)),
        (TEST, "0.85", ()),
        (ONCE, "0.85", ()),
        (WAIT, "0.9", ("test()",)),
        (FLIP, "0.9", ()),
        (TEST.replace("(ill)))", "(ill)) :repeats)"), "0.85", ()),
        (TEST.replace("(probabilistic 0.85 (ill))", "(ill)"), "1", ()),
    ],
)
def test_who_looks_again_is_named(sense: str, target: str, told: tuple[str, ...]) -> None:
    text = WARD.replace("{sense}", sense).replace("{}", target)
    task = compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    options = Options(allow_guess=True)
    plan = plan_task(task, None, "policy", Limits(seconds=4), lambda _: None, options=options)
    assert plan.tree.status == "target-reached"
    assert plan.rerolled == told


def test_the_program_says_so(tmp_path: Path) -> None:
    (tmp_path / "ward.pddl").write_text(WARD.replace("{sense}", TEST).replace("{}", "0.9"), "utf-8")
    done = program(
        "plan", "ward.pddl", "--allow-guess", "--time-limit", "4", "-q", "-o", "tree.json", folder=tmp_path
    )
    assert "readings of test() are made again" in done.stderr
    assert "readings  of test() are made again" in program("simulate", "tree.json", folder=tmp_path).stdout
    shown = json.loads(program("simulate", "tree.json", "--json", folder=tmp_path).stdout)
    assert shown["rerolled"] == ["test()"]
