"""What ``bbtc simulate --json`` and ``bbtc plan --bounds --json`` write is as their schemas say."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from tests.artefacts.test_artefacts import validator
from tests.cli.program import bbtc as program
from tests.conftest import GOLDEN
from tests.domains.problems import PROBLEMS, Problem

FIGURES = validator("figures")
BOUNDS = validator("bounds")
HIDING = [each for each in PROBLEMS if each.domain in {"corridors", "diagnosis", "press", "shelves"}]
SOME = [*HIDING, *(each for each in PROBLEMS if each.domain in {"doors", "household", "kitting"})]
FEW = {"press/in-the-dark", "shelves/blurred-camera"}  # with no end to what is believed


@functools.cache
def figures_of(problem: Problem, *more: str) -> dict[str, Any]:
    """The figures of the tree that is planned for a problem."""
    tree = GOLDEN / str(problem) / "tree.json"
    done = program("simulate", tree, "--json", *more)
    found = json.loads(done.stdout)
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("problem", SOME, ids=str)
def test_figures_match_their_schema(problem: Problem) -> None:
    everything = ["--scenarios", "2", "--samples", "20", "--perturb", "0.2", "--runs", "30"]
    if str(problem) not in FEW and problem.domain != "kitting":
        everything.append("--recovery")
    value = figures_of(problem, *everything)
    assert list(FIGURES.iter_errors(value)) == []
    parts = (value[key] for key in ("success", "failure", "blocked", "endless"))
    assert sum(map(Fraction, parts), Fraction(value.get("mistaken", "0"))) == 1


def _without(value: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield {key: each for key, each in value.items() if key != "success"}
    yield value | {"sucess": "1"}
    yield value | {"success": 0.5}
    yield value | {"worst_world": {"success": "1/2", "facts": {"ill()": True}}}


def test_the_schema_refuses_other_fields() -> None:
    value = figures_of(Problem("press", "in-the-dark"))
    assert "worst_world" in value
    assert list(FIGURES.iter_errors(value)) == []
    assert all(list(FIGURES.iter_errors(each)) for each in _without(value))


GUESS = """
(define (domain ward)
  (:predicates (infected) (treated) (cured))
  (:action test :precondition (not (treated)) :observe (probabilistic 0.85 (infected)))
  (:action treat :precondition (not (treated)) :effect (and (treated) (when (infected) (cured))))
  (:action wait :precondition (not (treated)) :effect (and (treated) (when (not (infected)) (cured)))))
(define (problem patient)
  (:domain ward) (:init (unknown (infected))) (:goal (cured)) (:goal-probability 0.9))
"""


def test_what_hidden_state_adds_matches_too(tmp_path: Path) -> None:
    """How often the tree only thinks so, the worst world, readings that are made again, and bounds that stay
    apart."""
    (tmp_path / "p.pddl").write_text(GUESS, "utf-8")
    options = ("--allow-guess", "--time-limit", "4")
    program("plan", "p.pddl", *options, "-q", "-o", "t.json", folder=tmp_path)
    value = json.loads(program("simulate", "t.json", "--json", folder=tmp_path).stdout)
    assert list(FIGURES.iter_errors(value)) == []
    assert {"mistaken", "worst_world", "rerolled"} <= value.keys()
    bounds = json.loads(program("plan", "p.pddl", *options, "--bounds", "--json", folder=tmp_path).stdout)
    assert list(BOUNDS.iter_errors(bounds)) == []
    assert Fraction(bounds["lower"]) < Fraction(bounds["upper"])


@pytest.mark.parametrize("name", ["doors/to-the-archive", "shelves/sharp-camera"])
def test_bounds_match_their_schema(name: str) -> None:
    domain, _, problem = name.partition("/")
    files = Problem(domain, problem).files
    for more in ([], ["--max-actions", "2"]):
        value = json.loads(program("plan", *files, "--bounds", "--json", *more).stdout)
        assert list(BOUNDS.iter_errors(value)) == []
