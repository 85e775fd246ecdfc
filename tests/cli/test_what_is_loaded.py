"""Commands that only read text load neither the planner nor what follows it: editors run them often."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

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


def test_planning_is_seen_to_load_the_planner(folder: Path) -> None:
    status, modules = loaded(folder, "plan", "-q", "domain.pddl", "problem.pddl", "-o", "tree.json")
    assert status == "0"
    assert {"bbtc.planner.auto", "bbtc.belief.chain"} <= modules
