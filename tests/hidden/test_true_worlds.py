"""Runs begin where the problem says that they do; plans and figures do not."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from bbtc.artefacts import dumps, load_task, load_tree, task_to_json, tree_to_json
from bbtc.backends.exporter import Files
from bbtc.belief.hidden import belief_in
from bbtc.belief.monitored import with_hidden
from bbtc.belief.stepper import Stepper
from bbtc.diagnostics import Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, export_tree, plan_task, simulate_tree
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from tests.cli.program import bbtc as program
from tests.long_form import amount

SHELVES = """
(define (domain shelves)
  (:types shelf)
  (:predicates (can ?s - shelf) (dark) (lamp) (have))
  (:action look :parameters (?s - shelf) :precondition (lamp) :observe (can ?s))
  (:action switch :effect (lamp) :observe (dark))
  (:action take :parameters (?s - shelf) :precondition (can ?s) :effect (have)))
(define (problem three)
  (:domain shelves)
  (:objects a b c - shelf)
  (:init (oneof (can a) (can b) (can c)) (unknown (dark)))
  {true}
  (:goal (have)))
"""
ALONE = """
(define (domain alone)
  (:predicates (ill) (seen) (well))
  (:action look :effect (seen) :observe (ill))
  (:action treat :precondition (ill) :effect (well))
  (:action leave :precondition (not (ill)) :effect (well)))
(define (problem patient)
  (:domain alone) (:init (unknown (ill))) {true} (:goal (well)))
"""
SENSED = """
(define (domain sensed)
  (:predicates (wet) (umbrella) (out))
  (:sensor window :sensed (probabilistic 0.9 (wet)))
  (:action feel :observe (wet))
  (:action go :precondition (not (wet)) :effect (out))
  (:action open :effect (umbrella))
  (:action walk :precondition (and (wet) (umbrella)) :effect (out)))
(define (problem walk)
  (:domain sensed) (:init (probabilistic 0.2 (wet))) {true} (:goal (out)))
"""
BELIEVED = """
(define (domain coin) (:predicates (heads) (called) (won)) (:observables (o))
  (:action look)
  (:action call :precondition (heads) :effect (won))
  (:action turn :effect (when (not (heads)) (heads)))
  (:observation yes :condition (heads) :distribution (o))
  (:observation no :condition (not (heads)) :distribution (not (o))))
(define (problem p) (:domain coin) {true} (:init-belief (prob (heads) 0.1)) (:goal (won)))
"""


def compiled(text: str, true: str, limits: Limits | None = None) -> tuple[Plan, Report]:
    """The plan of a text, in which this is said to be true."""
    report = Report()
    source = SourceFile("x.pddl", text.replace("{true}", true))
    task = compile_sources([source], report, limits or Limits())
    return plan_task(task, None, "policy", Limits(seconds=20), lambda _: None), report


def runs(tree: Tree, seeds: int = 30) -> list[tuple[frozenset[str], tuple[str, ...], str]]:
    """What is true at the start of some runs, what they do, and how they end."""
    task, found = with_hidden(tree.task), []
    for seed in range(seeds):
        stepper = Stepper(task, tree.root, seed)
        stepper.start()
        while not stepper.finished:
            stepper.step()
        done = tuple(each.action.action for each in stepper.moments if each.action is not None)
        truth = frozenset(stepper.truth.facts(stepper.moments[0].worlds))
        found.append((truth, done, stepper.now.status.name))
    return found


@pytest.mark.parametrize(
    ("text", "true", "worlds"),
    [
        (SHELVES, "(:hidden (can c))", [{"can(c)"}]),
        (SHELVES, "(:hidden (can b) (dark))", [{"can(b)"}]),
        (SHELVES, "(:hidden (can a)) (:hidden (can c))", [{"can(a)"}, {"can(c)"}]),
        (SHELVES, "(:hidden (not (can a)) (not (can b)))", [{"can(c)"}]),
        (ALONE, "(:hidden (ill))", [{"ill()"}]),
        (ALONE, "(:hidden)", [set()]),
        (SENSED, "(:hidden (wet))", [{"wet()"}]),
        (SENSED, "(:hidden)", [set()]),
        (BELIEVED, "(:init (heads))", [{"heads()"}]),
        (BELIEVED, "(:init (called))", [set()]),
        (BELIEVED, "(:hidden (heads))", [{"heads()"}]),
    ],
)
def test_runs_begin_in_the_world_that_is_given(text: str, true: str, worlds: list[set[str]]) -> None:
    """Whatever else is likelier; in one of several. What is not mentioned is false, where that can be."""
    plan, report = compiled(text, true)
    assert [each for each in report if each.code == "BBT0431"] == []
    found = runs(plan.tree)
    assert {truth for truth, _, _ in found} == {frozenset(world) for world in worlds}
    assert {status for _, _, status in found} == {"SUCCESS"}


@pytest.mark.parametrize(("accuracy", "least", "most"), [("1", 100, 100), ("0.9", 80, 98)])
def test_what_is_told_at_first_follows_from_what_is_true(accuracy: str, least: int, most: int) -> None:
    """Of a hundred runs in the rain, though it seldom rains."""
    plan, _ = compiled(SENSED.replace("0.9", accuracy), "(:hidden (wet))")
    task, wet = with_hidden(plan.tree.task), 0
    for seed in range(100):
        stepper = Stepper(task, plan.tree.root, seed)
        stepper.start()
        belief = dict(belief_in(task, stepper.now.state.values, 0))
        wet += belief.get(1, 0) > belief.get(0, 0) / 2  # told so, 9 to 4; else 1 to 36
        assert stepper.truth.facts(stepper.now.worlds) == ["wet()"]
    assert least <= wet <= most


def test_what_the_robot_does_follows_from_what_is_true() -> None:
    """It looks until it finds the can, or knows where it has to be."""
    taken = {}
    for shelf in "abc":
        plan, _ = compiled(SHELVES, f"(:hidden (can {shelf}))")
        (taken[shelf],) = {done[-1] for _, done, _ in runs(plan.tree)}
    assert taken == {shelf: f"take({shelf})" for shelf in "abc"}


@pytest.mark.parametrize("text", [SHELVES, ALONE, SENSED])
def test_plans_and_figures_never_read_it(text: str) -> None:
    without, _ = compiled(text, "")
    for true in ("(:hidden)", "(:hidden (can c))" if text is SHELVES else "(:hidden)"):
        plan, _ = compiled(text, true)
        assert plan.tree.root == without.tree.root
        assert plan.tree.bounds == without.tree.bounds
        assert simulate_tree(plan.tree, Limits())[0] == simulate_tree(without.tree, Limits())[0]
        task = replace(plan.tree.task, true_worlds=(), origin=without.tree.task.origin)
        assert task == without.tree.task


def test_artefacts_keep_it() -> None:
    plan, _ = compiled(SHELVES, "(:hidden (can c) (not (dark)))")
    task = load_task(SourceFile("t.json", dumps(task_to_json(plan.tree.task))))
    assert task.true_worlds == plan.tree.task.true_worlds
    tree = load_tree(SourceFile("t.json", dumps(tree_to_json(plan.tree))))
    assert {truth for truth, _, _ in runs(tree, 10)} == {frozenset(["can(c)"])}


@pytest.mark.parametrize(
    ("text", "true"),
    [(SHELVES, "(:hidden (can a) (can b))"), (BELIEVED.replace("0.1", "1.0"), "(:hidden (not (heads)))")],
)
def test_a_world_that_cannot_be_is_warned_of(text: str, true: str) -> None:
    """Runs begin in one that can."""
    report = Report()
    compile_sources([SourceFile("x.pddl", text.replace("{true}", true))], report, Limits())
    expected = ["BBT0431"] if text is SHELVES else []
    assert [each.code for each in report if each.code == "BBT0431"] == expected
    if text is SHELVES:
        plan, _ = compiled(text, true)
        assert {truth for truth, _, _ in runs(plan.tree)} == {frozenset([f"can({shelf})"]) for shelf in "abc"}


@pytest.mark.parametrize("text", [SHELVES, ALONE])
def test_simulated_worlds_of_exports_begin_there(text: str, tmp_path: Path) -> None:
    """Each of two worlds, and no other, as the seed has it."""
    shown = {SHELVES: ("really can(c)", "really can(a)"), ALONE: ("really ill()", "nothing")}[text]
    said = {SHELVES: "(:hidden (can c)) (:hidden (can a))", ALONE: "(:hidden (ill)) (:hidden)"}[text]
    plan, _ = compiled(text, said)
    module = tmp_path / "robot.py"
    written = export_tree(plan.tree, "py_trees", {}, Limits())
    assert isinstance(written, str)
    module.write_text(written, "utf-8")
    truths: set[str] = set()
    for seed in range(8):
        done = subprocess.run(
            [sys.executable, module, "--seed", str(seed)],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
        truths.update(line for line in done.stdout.splitlines() if line.startswith("the truth: "))
        assert "success" in done.stdout.lower()
    assert truths == {f"the truth: {each}" for each in shown}


def test_worlds_that_are_not_listed_are_given_too(tmp_path: Path) -> None:
    """Two balls are somewhere."""
    cups = [f"c{number}" for number in range(amount(6, 13))]
    text = f"""(define (domain many) (:predicates (ball ?c) (found))
      (:action look :parameters (?c) :observe (ball ?c))
      (:action ask :observe (exists (?c) (ball ?c)))
      (:action take :parameters (?c) :precondition (ball ?c) :effect (found)))
    (define (problem p) (:domain many) (:objects {" ".join(cups)})
      (:init (or {" ".join(f"(ball {cup})" for cup in cups)})) {{true}} (:goal (found)))"""
    plan, _ = compiled(text, "(:hidden (ball c3) (ball c5))", Limits(worlds=2 ** len(cups) - 2))
    (component,) = with_hidden(plan.tree.task).components
    assert component.diagram is not None
    assert {truth for truth, _, _ in runs(plan.tree, 3)} == {frozenset(["ball(c3)", "ball(c5)"])}
    written = export_tree(plan.tree, "py_trees", {}, Limits())
    assert isinstance(written, str)
    (tmp_path / "many.py").write_text(written, "utf-8")
    done = subprocess.run(
        [sys.executable, tmp_path / "many.py"], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout.startswith("the truth: really ball(c3), really ball(c5)\n")


def test_robots_in_cpp_begin_there() -> None:
    """The world of the project draws nothing at the start."""
    plan, _ = compiled(SHELVES, "(:hidden (can c))")
    files = export_tree(plan.tree, "btcpp_project", {}, Limits())
    assert isinstance(files, Files)
    (header,) = (text for name, text in files.texts.items() if name.endswith("simulated_robot.hpp"))
    priors = header.partition("/*priors=*/")[2].partition("/*tellings=*/")[0]
    assert priors.count("Truth::True") == 1
    assert priors.count("Truth::False") == 2


def test_the_program_runs_there(tmp_path: Path) -> None:
    (tmp_path / "p.pddl").write_text(ALONE.replace("{true}", "(:hidden (ill))"), "utf-8")
    program("plan", "p.pddl", "-q", "-o", "tree.json", folder=tmp_path)
    for seed in range(6):
        shown = program("run", "tree.json", "--batch", "--seed", str(seed), folder=tmp_path).stdout
        assert "treat" in shown
        assert "leave()  running" not in shown
