"""Names that are slips, read as planners do: as others than those declared; and the problem that is meant."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner

import bbtc
from bbtc.cli.group import cli
from bbtc.diagnostics import BbtcError, Report
from bbtc.source import SourceFile
from tests.domains.lifted import Lifted

# `{}` is where a slip may stand. A box that is opened jams the one it stands on, if its name is right.
SHED = """(define (domain shed)
  (:types box)
  (:constants red blue - box)
  (:predicates (open ?b - box) (on ?a ?b - box) (done))
  (:functions (total-cost))
  (:action lift :parameters (?b - box) :precondition (and (on ?b blue) {condition})
    :effect (and (not (on ?b {deleted})) (open ?b) (increase (total-cost) 2)))
  (:action force :parameters (?b - box) :precondition (not (on red blue))
    :effect (and (probabilistic 1/2 (open ?b)) {added} (increase (total-cost) 1)))
  (:action close_up :precondition (forall (?b - box) (and (open ?b) (on red {read}))) :effect (done)))
(define (problem s1) (:domain shed) (:objects green - box) (:init (on red blue) {start}) (:goal (done)))"""
RIGHT = {"condition": "()", "deleted": "blue", "added": "()", "read": "blue", "start": "(on green blue)"}
SLIPS = [
    {"deleted": "bleu"},
    {"deleted": "bleu", "read": "bleu"},
    {"condition": "(not (open gren))"},
    {"condition": "(open gren)"},
    {"deleted": "bleu", "start": "(on green blue) (on blue blue)"},
    {"start": "(on green blue) (on blue bleu)", "deleted": "bleu"},
    {"added": "(opne ?b)"},
    {"condition": "(not (opne ?b))", "deleted": "bleu", "start": "(on green blue) (on blue blue)"},
    {"added": "(on red bleu)", "read": "bleu"},
]


@pytest.mark.parametrize("slip", SLIPS, ids=str)
def test_a_slip_is_a_name_of_its_own(slip: dict[str, str]) -> None:
    """An interpreter that knows no declarations, to which every word is what it says, is the judge."""
    text = SHED.format(**{**RIGHT, **slip})
    space = Lifted.of(text).space
    expected = space.mean(space.best)
    report = Report()
    model = bbtc.load(SourceFile("shed.pddl", text), lenient=True, report=report)
    assert "BBT0230" in {each.code for each in report}
    try:
        found = bbtc.bounds(model)
    except BbtcError:  # hopeless even if nothing were ever undone
        assert expected == 0
    else:
        assert float(found.lower) == pytest.approx(expected, abs=1e-8)
        assert float(found.upper) == pytest.approx(expected, abs=1e-8)


def test_a_misspelt_delete_effect_deletes_nothing() -> None:
    text = SHED.format(**{**RIGHT, "deleted": "bleu", "start": "(on green blue) (on blue blue)"})
    plan = bbtc.plan(SourceFile("shed.pddl", text), lenient=True)
    assert plan.tree.success_probability == 1
    assert not any("bleu" in variable.name for variable in plan.tree.task.variables)


@pytest.mark.parametrize(
    "arguments",
    [
        ["check"],
        ["compile"],
        ["compile", "--emit", "model"],
        ["compile", "--emit", "prism"],
        ["plan", "-q"],
        ["plan", "--bounds"],
        ["export", "--to", "text"],
    ],
    ids=" ".join,
)
def test_every_command_that_reads_a_domain_reads_it_leniently(tmp_path: Path, arguments: list[str]) -> None:
    file = tmp_path / "shed.pddl"
    file.write_text(SHED.format(**{**RIGHT, "deleted": "bleu", "start": "(on green blue) (on blue blue)"}))
    strict = CliRunner().invoke(cli, [*arguments, str(file)])
    assert (strict.exit_code, "BBT0203" in strict.output) == (1, True)
    lenient = CliRunner().invoke(cli, [*arguments, "--lenient", str(file)])
    assert (lenient.exit_code, "BBT0230" in lenient.output) == (0, True)


# --- several problems ------------------------------------------------------------------------

ROOMS = """(define (problem Morning) (:domain rooms)
  (:init (at hall)) (:goal (at attic)) (:goal-probability 1/4))
(define (domain rooms) (:constants hall attic) (:predicates (at ?r))
  (:action go :parameters (?r) :effect (at ?r)))
(define (problem Evening) (:domain rooms) (:init (at attic)) (:goal (at hall)) (:goal-probability 1/2))"""
GARDEN = """(define (domain garden) (:predicates (wet)) (:action water :effect (wet)))
(define (problem noon) (:domain garden) (:init) (:goal (wet)))"""


@pytest.mark.parametrize("name", ["evening", "EVENING", "Evening"])
def test_of_several_problems_one_is_named(tmp_path: Path, name: str) -> None:
    file, tree = tmp_path / "rooms.pddl", tmp_path / "tree.json"
    file.write_text(ROOMS)
    result = CliRunner().invoke(cli, ["plan", "-q", str(file), "--problem", name, "-o", str(tree)])
    assert result.exit_code == 0
    assert json.loads(tree.read_text())["target"] == "0.5"
    source = SourceFile("rooms.pddl", ROOMS)
    assert bbtc.compile(source, problem=name).goal_probability == Fraction(1, 2)
    assert bbtc.load(source, problem=name).problem == "evening"
    assert bbtc.plan(source, problem=name).tree.task.problem == "evening"
    assert bbtc.bounds(source, problem=name).lower == 1
    xml = tmp_path / "tree.xml"
    xml.write_text(str(bbtc.export(str(tree), "btcpp")))
    assert bbtc.import_tree(xml, source, problem=name).task.problem == "evening"


def test_the_domain_is_that_of_the_problem_named() -> None:
    source = SourceFile("all.pddl", f"{ROOMS}\n{GARDEN}")
    assert bbtc.compile(source, problem="noon").domain == "garden"
    assert bbtc.compile(source, problem="morning").domain == "rooms"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "name it: --problem Morning, --problem Evening"),
        (["--problem", "evning"], "did you mean `evening`?"),
        (["--problem", "xyz"], "there is --problem Morning, --problem Evening"),
    ],
)
def test_without_a_name_that_fits_those_there_are_are_told(
    tmp_path: Path, arguments: list[str], told: str
) -> None:
    file = tmp_path / "rooms.pddl"
    file.write_text(ROOMS)
    result = CliRunner().invoke(cli, ["compile", str(file), *arguments])
    assert (result.exit_code, "BBT0006" in result.output, told in result.output) == (1, True, True)


def test_a_project_names_the_problem_and_the_reading(tmp_path: Path) -> None:
    (tmp_path / "rooms.pddl").write_text(ROOMS)
    (tmp_path / "shed.pddl").write_text(
        SHED.format(**{**RIGHT, "deleted": "bleu", "start": "(on green blue) (on blue blue)"})
    )
    manifest = tmp_path / "bbtc.yaml"
    trees = """trees:
  rooms: {domain: rooms.pddl, problem-name: evening}
  shed: {domain: shed.pddl, lenient: true}
"""
    manifest.write_text(trees)
    report = bbtc.build(manifest, jobs=1)
    assert [each.status for each in report.outcomes] == ["built", "built"]
    made = json.loads((tmp_path / "build" / "rooms.tree.json").read_text())
    assert (made["problem"], made["target"]) == ("evening", "0.5")
    manifest.write_text(trees.replace("evening", "morning"))
    assert [each.status for each in bbtc.build(manifest, jobs=1).outcomes] == ["built", "unchanged"]
