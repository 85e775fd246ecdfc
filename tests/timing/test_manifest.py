"""What a manifest expects of success by a deadline."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.program import bbtc

DOMAIN = """
(define (domain ways)
  (:predicates (there))
  (:action drive :precondition (not (there)) :effect (probabilistic 0.5 (there)) :duration 10))
(define (problem p) (:domain ways) (:init) (:goal (there)) (:goal-probability 0.9))
"""


def built(folder: Path, expected: str) -> tuple[int, str]:
    (folder / "ways.pddl").write_text(DOMAIN)
    (folder / "bbtc.yaml").write_text(
        f"trees:\n  ways:\n    domain: ways.pddl\n    expect:\n      - {expected}\n"
    )
    done = bbtc("build", folder=folder)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    ("seconds", "at_least", "met"),
    [
        ("10", "0.49", True),
        ("10", "0.51", False),
        ("39", "0.87", True),
        ("39", "0.88", False),
        ("40", "90%", True),
    ],
)
def test_success_by_a_deadline_is_met_or_not(tmp_path: Path, seconds: str, at_least: str, met: bool) -> None:
    status, told = built(tmp_path, f"success_by: {{seconds: {seconds}, at_least: {at_least}}}")
    assert status == (0 if met else 1), told
    if not met:
        assert (
            f"expected success_by {seconds} >= {at_least}, but success within {seconds} s is between" in told
        )


@pytest.mark.parametrize(
    "wrong",
    [
        "success_by: {seconds: 0, at_least: 0.5}",
        "success_by: {seconds: soon, at_least: 0.5}",
        "success_by: {seconds: 5, at_least: 2}",
        "success_by: {seconds: 5}",
        "success_by: {seconds: 5, at_least: 0.5, more: 1}",
        "success_bye: {seconds: 5, at_least: 0.5}",
    ],
)
def test_what_makes_no_sense_is_an_error_with_its_place(tmp_path: Path, wrong: str) -> None:
    status, told = built(tmp_path, wrong)
    assert status == 1
    assert "bbtc.yaml:5" in told
    assert "Traceback" not in told


def test_a_tree_without_durations_meets_no_deadline(tmp_path: Path) -> None:
    text = DOMAIN.replace(":duration 10", "")
    (tmp_path / "ways.pddl").write_text(text)
    (tmp_path / "bbtc.yaml").write_text(
        "trees:\n  ways:\n    domain: ways.pddl\n    expect: [success_by: {seconds: 5, at_least: 0.5}]\n"
    )
    done = bbtc("build", folder=tmp_path)
    assert done.returncode == 1
    assert "BBT0446" in done.stderr
