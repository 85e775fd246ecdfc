"""Names that nothing declares: what is inferred means what a declaration would, and slips stay errors."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.analysis.resolve import resolve
from bbtc.analysis.undeclared import distance, slip
from bbtc.diagnostics import Report, Severity
from bbtc.limits import Limits
from bbtc.model.domain import Model
from bbtc.pipeline import ground_model
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse

DOMAIN = """
(define (domain house)
  (:types room)
  {types}
  {constants}
  (:predicates (at ?r - room) {predicates})
  (:action go
    :parameters (?r - room)
    :precondition (and (not (at ?r)) (not (shut ?r)))
    :effect (and (forall (?o - room) (not (at ?o))) (at ?r) (seen ?r)))
  (:action unbar
    :parameters (?d - door)
    :precondition (and (at hall) (near ?d hall))
    :effect (and (moved) (not (shut kitchen)))))
(define (problem p)
  (:domain house)
  (:objects kitchen - room front - door)
  (:init (shut kitchen) (near front hall))
  (:goal (and (at kitchen) (moved))))
"""
LACKING = DOMAIN.format(types="", constants="", predicates="")
WHOLE = DOMAIN.format(
    types="(:types door)",
    constants="(:constants hall - room)",
    predicates="(shut ?x) (seen ?x) (near ?x ?y) (moved)",
)


def _resolved(text: str) -> tuple[Model | None, Report]:
    report = Report()
    document = parse(SourceFile("test.pddl", text), report)
    assert not report.errors
    found = {definition.kind: definition for definition in document.definitions}
    return resolve(found["domain"], found.get("problem"), report), report


def test_what_is_inferred_means_what_a_declaration_would() -> None:
    (lacking, told), (whole, _) = _resolved(LACKING), _resolved(WHOLE)
    assert lacking is not None
    assert whole is not None
    names = {line.split("`")[1] for d in told if d.code == "BBT0225" for line in [d.message]}
    assert names == {"door", "hall", "shut", "seen", "near", "moved"}
    one, other = (ground_model(model, Report(), Limits()) for model in (lacking, whole))
    assert {str(v) for v in one.variables} == {str(v) for v in other.variables}
    assert [a.name for a in one.actions] == [a.name for a in other.actions]
    assert lacking.init == whole.init
    assert lacking.goal == whole.goal


ONE_PLACE = "(define (domain d) (:predicates (opened ?x) (door1)) (:action a :parameters (?x) {}) {})"


@pytest.mark.parametrize(
    ("fields", "more", "severity"),
    [
        (":effect (opend ?x)", "", Severity.ERROR),  # one place, near
        (":effect (poened ?x)", "", Severity.ERROR),
        (":effect (opend)", "", Severity.WARNING),  # not near: as many arguments are wanted
        (":effect (door2)", "", Severity.WARNING),  # a number is no letter
        (":effect (k_opened ?x)", "", Severity.WARNING),
        (":effect (closed ?x)", "", Severity.WARNING),
        (":precondition (closed ?x)", "", Severity.ERROR),  # one place reads it, nothing sets it
        (":precondition (closed ?x)", "(:action b :effect (closed hall))", Severity.WARNING),
        (":precondition (opend ?x)", "(:action b :parameters (?x) :effect (opend ?x))", Severity.WARNING),
    ],
)
def test_a_likely_slip_is_an_error(fields: str, more: str, severity: Severity) -> None:
    _, report = _resolved(ONE_PLACE.format(fields, more))
    found = [d.severity for d in report if d.code in {"BBT0202", "BBT0225"} and "predicate" in d.message]
    assert found == [severity]


def test_a_type_that_is_misspelt_where_it_is_declared_is_an_error() -> None:
    actions = "".join(f"(:action a{n} :parameters (?r - room) :effect (p ?r))" for n in range(2))
    _, report = _resolved(f"(define (domain d) (:types rooom) (:predicates (p ?r - room)) {actions})")
    assert {d.code for d in report} == {"BBT0201"}
    _, report = _resolved(f"(define (domain d) (:types hall) (:predicates (p ?r - room)) {actions})")
    assert {d.code for d in report} == {"BBT0225"}


@pytest.mark.parametrize("what", ["object{}", "p{}"])
def test_thousands_of_names_are_reported_in_time(what: str) -> None:
    declared = " ".join(f"object{n}" for n in range(1500))
    used = " ".join(f"({name} object7)" if name[0] == "p" else f"(p {name})" for name in
                    (f"{what.format(n)}x" for n in range(3000)))  # fmt: skip
    start = time.process_time()
    _resolved(
        "(define (domain d) (:predicates (p ?x)))"
        f"(define (problem q) (:domain d) (:objects {declared}) (:init {used}) (:goal (p object7)))"
    )
    assert time.process_time() - start < 20  # minutes, if each were compared with each


def test_very_long_names_are_not_compared() -> None:
    assert slip("a" * 100_000, ["a" * 99_999]) is None


def test_many_names_are_told_in_sum() -> None:
    facts = " ".join(f"(fact{number}x)" for number in range(500))
    _, report = _resolved(
        f"(define (domain d) (:predicates (p))) (define (problem q) (:domain d) (:init {facts}) (:goal (p)))"
    )
    messages = [d.message for d in report if d.code == "BBT0225"]
    assert len(messages) == 11
    assert messages[-1] == "490 more predicates are not declared, `fact499x` the last of them"


WORDS = st.text("abc", min_size=0, max_size=5)


def _steps(word: str) -> set[str]:
    """Every word one step away."""
    cut = [(word[:i], word[i:]) for i in range(len(word) + 1)]
    return (
        {a + b[1:] for a, b in cut if b}
        | {a + letter + b for a, b in cut for letter in "abc"}
        | {a + letter + b[1:] for a, b in cut if b for letter in "abc"}
        | {a + b[1] + b[0] + b[2:] for a, b in cut if len(b) > 1}
    )


@given(WORDS, WORDS)
def test_one_step_is_one_edit(one: str, other: str) -> None:
    assert (distance(one, other, 1) <= 1) == (one == other or other in _steps(one))


@given(WORDS, WORDS)
def test_two_edits_are_within_two_steps(one: str, other: str) -> None:
    if distance(one, other, 2) <= 2:
        assert one == other or any(other == step or other in _steps(step) for step in _steps(one))


def test_the_nearest_of_several_is_offered() -> None:
    assert slip("luminosity", ["luminousity", "luminosty_x", "lumin"]) == "luminousity"
    assert slip("at", ["it"]) is None


def test_a_strict_check_refuses_what_is_inferred(tmp_path: Path) -> None:
    file = tmp_path / "house.pddl"
    file.write_text(LACKING)
    command = [sys.executable, "-m", "bbtc.cli.main", "check", str(file)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0
    strict = subprocess.run([*command, "--strict"], capture_output=True, text=True, check=False)
    assert strict.returncode == 1
    assert "warning[BBT0225]: type `door` is not declared" in strict.stderr
