"""A command loads what it needs and no more: editors and build systems run them often, and on small inputs
loading takes most of the time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.program import bbtc

_DOMAIN = """(define (domain lamps)
  (:predicates (lit) (powered))
  (:action power :effect (powered))
  (:action light :precondition (powered) :effect (lit)))
"""
_PROBLEM = "(define (problem evening)\n  (:domain lamps)\n  (:init)\n  (:goal (lit)))\n"
_RUN = """
import sys
from bbtc.cli.main import main
try:
    main()
except SystemExit as ended:
    print(ended.code, *sorted(sys.modules))
"""
_LATER = ("planner", "verifier", "rewrite", "belief", "backends", "replay", "builder")


def loaded(folder: Path, *arguments: str) -> tuple[str, set[str]]:
    """The exit status of a command in a fresh process, and every module it has loaded at its end."""
    run = subprocess.run(
        [sys.executable, "-c", _RUN, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    status, *modules = run.stdout.splitlines()[-1].split()
    return status, set(modules)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "domain.pddl").write_text(_DOMAIN)
    (tmp_path / "problem.pddl").write_text(_PROBLEM)
    return tmp_path


@pytest.mark.parametrize("form", ["text", "json", "sarif"])
@pytest.mark.parametrize("command", ["check", "fmt"])
def test_check_and_fmt_load_no_planner_and_no_verifier(folder: Path, command: str, form: str) -> None:
    status, modules = loaded(folder, "--format", form, command, "domain.pddl", "problem.pddl")
    assert status == "0"
    assert {"bbtc.pipeline", "bbtc.syntax.parser"} <= modules
    assert sorted(each for each in modules if each.startswith(tuple(f"bbtc.{name}" for name in _LATER))) == []


_TREE = "plan -q domain.pddl problem.pddl -o tree.json"
_TEXT = ("syntax.ast", "syntax.parser", "analysis", "model")
_COSTLY = ("numpy", "lark", "yaml", "hmac")


@pytest.mark.parametrize(
    ("command", "later", "others"),
    [
        ("check domain.pddl problem.pddl", (*_LATER, "artefacts"), _COSTLY),
        ("fmt --check domain.pddl", (*_LATER, "artefacts", "analysis"), (*_COSTLY, "clingo")),
        (
            "compile domain.pddl problem.pddl -o task.json",
            ("planner", "verifier", "rewrite", "belief"),
            _COSTLY,
        ),
        (_TREE, ("verifier", "replay", "builder", "cli.commands.verify"), ("lark", "yaml", "hmac")),
        (f"{_TREE} --strategy strong-cyclic", ("verifier", "planner.chaining", "planner.synthesis"), _COSTLY),
        (
            f"{_TREE} --strategy refine",
            ("verifier", "planner.synthesis", "planner.strong_cyclic"),
            ("lark", "hmac"),
        ),
        ("simulate tree.json", (*_TEXT, "verifier", "planner.mdp", "planner.why_not"), (*_COSTLY, "clingo")),
        ("verify tree.json --engine own", (*_TEXT, "planner", "rewrite"), (*_COSTLY, "clingo")),
        ("export tree.json --to dot -o tree.dot", (*_TEXT, "verifier", "planner.mdp"), (*_COSTLY, "clingo")),
        (
            "export tree.json --to btcpp -o tree.xml",
            (*_TEXT, "verifier", "planner.mdp"),
            (*_COSTLY, "clingo"),
        ),
        ("run --batch tree.json", (*_TEXT, "verifier", "planner"), (*_COSTLY, "clingo")),
        ("diff tree.json tree.json", (*_TEXT, "verifier", "planner"), (*_COSTLY, "clingo")),
    ],
)
def test_a_command_loads_no_more_than_it_needs(
    folder: Path, command: str, later: tuple[str, ...], others: tuple[str, ...]
) -> None:
    if "tree.json" in command and not command.startswith(_TREE):
        assert bbtc(*_TREE.split(), folder=folder).returncode == 0
    _, modules = loaded(folder, *command.split())
    assert "bbtc.cli.output" in modules
    unneeded = (*(f"bbtc.{name}" for name in later), *others)
    assert sorted(each for each in modules if _is_in(each, unneeded)) == []


def _is_in(module: str, packages: tuple[str, ...]) -> bool:
    return any(module == package or module.startswith(f"{package}.") for package in packages)


def test_figures_of_a_tree_that_fails_load_what_explains_it(folder: Path) -> None:
    (folder / "match.pddl").write_text(
        "(define (domain d) (:predicates (new) (lit)) (:action strike :precondition (new)"
        " :effect (and (not (new)) (probabilistic 1/2 (lit)))))"
        "(define (problem q) (:domain d) (:init (new)) (:goal (lit)))"
    )
    plan = bbtc("plan", "match.pddl", "--target", "0.5", "-o", "tree.json", folder=folder)
    assert plan.returncode == 0
    _, modules = loaded(folder, "simulate", "tree.json")
    assert {"bbtc.planner.why_not", "numpy"} <= modules


def test_planning_is_seen_to_load_the_planner(folder: Path) -> None:
    status, modules = loaded(folder, "plan", "-q", "domain.pddl", "problem.pddl", "-o", "tree.json")
    assert status == "0"
    assert {"bbtc.planner.auto", "bbtc.belief.chain"} <= modules
