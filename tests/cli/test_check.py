"""``bbtc check``: which doubts are shown, how gravely, and what the exit status says."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOMAIN = """(define (domain d)
  (:predicates (a) (b) (c) (unused))
  (:action make-a :effect (a))
  (:action make-b :effect (b))
  (:action make-c :effect (c)))
"""
FOR_A = "(define (problem pa) (:domain d) (:goal (a)))\n"
FOR_B = "(define (problem pb) (:domain d) (:goal (b)))\n"


def bbtc(*arguments: str, folder: Path) -> tuple[int, str]:
    """Exit status and messages."""
    done = subprocess.run(
        [sys.executable, "-m", "bbtc.cli.main", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    return done.returncode, done.stderr


def findings(messages: str) -> set[tuple[str, str, str]]:
    """Severity, code and the name between backquotes, of each message."""
    return set(re.findall(r"(error|warning|note)\[(BBT\d{4})\]: [^`\n]*`([\w-]+)`", messages))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    (tmp_path / "a.pddl").write_text(FOR_A)
    (tmp_path / "b.pddl").write_text(FOR_B)
    return tmp_path


UNUSED = ("warning", "BBT0301", "unused")


def test_what_one_problem_does_not_need_is_a_note(folder: Path) -> None:
    status, messages = bbtc("check", "domain.pddl", "a.pddl", folder=folder)
    assert status == 0
    assert findings(messages) == {
        UNUSED,
        ("note", "BBT0301", "b"),
        ("note", "BBT0301", "c"),
        ("note", "BBT0307", "make-b"),
        ("note", "BBT0307", "make-c"),
    }
    assert "2 files checked, 1 warning, 4 notes\n" in messages


def test_what_none_of_several_problems_needs_is_a_warning(folder: Path) -> None:
    status, messages = bbtc("check", "domain.pddl", "a.pddl", "b.pddl", folder=folder)
    assert status == 0
    assert findings(messages) == {UNUSED, ("warning", "BBT0301", "c"), ("warning", "BBT0307", "make-c")}


def test_a_doubt_about_a_problem_is_not_hidden_by_another_problem(folder: Path) -> None:
    (folder / "b.pddl").write_text(FOR_B.replace("(b)", "(and (b) (unused))"))
    _, messages = bbtc("check", "domain.pddl", "a.pddl", "b.pddl", folder=folder)
    assert ("warning", "BBT0304", "unused") in findings(messages)
    assert UNUSED not in findings(messages), "the second problem's goal reads it"


def test_both_definitions_in_one_file_are_told_apart(folder: Path) -> None:
    for text in (DOMAIN + FOR_A, FOR_A + DOMAIN):
        (folder / "both.pddl").write_text(text.replace("(:goal (a))", "(:goal (a))"))
        _, messages = bbtc("check", "both.pddl", folder=folder)
        assert ("note", "BBT0307", "make-c") in findings(messages)
        (folder / "both.pddl").write_text(text.replace("(:goal (a))", "(:goal (and (a) (unused)))"))
        _, messages = bbtc("check", "both.pddl", folder=folder)
        assert ("warning", "BBT0304", "unused") in findings(messages)


@pytest.mark.parametrize(
    ("options", "codes"),
    [
        (["--select", "BBT0307"], {"BBT0307"}),
        (["--select", "bbt030", "--ignore", "BBT0307"], {"BBT0301"}),
        (["--ignore", "BBT03"], set()),
        (["--ignore", "BBT03", "--select", "BBT0301"], {"BBT0301"}),
        (["--select", "BBT0301,BBT0307"], {"BBT0301", "BBT0307"}),
    ],
)
def test_codes_are_selected_and_ignored_by_prefix(folder: Path, options: list[str], codes: set[str]) -> None:
    status, messages = bbtc("check", "domain.pddl", "a.pddl", *options, folder=folder)
    assert status == 0
    assert {code for _, code, _ in findings(messages)} == codes


def test_errors_cannot_be_ignored(folder: Path) -> None:
    (folder / "a.pddl").write_text(FOR_A.replace("(a)", "(missing)"))
    status, messages = bbtc("check", "domain.pddl", "a.pddl", "--ignore", "BBT", folder=folder)
    assert status == 1
    assert findings(messages) == {("error", "BBT0202", "missing")}


def test_a_prefix_of_no_code_is_wrong_usage(folder: Path) -> None:
    status, messages = bbtc("check", "domain.pddl", "--ignore", "E501", folder=folder)
    assert status == 2
    assert "E501" in messages


def test_strict_fails_on_warnings_but_not_on_notes(folder: Path) -> None:
    assert bbtc("check", "domain.pddl", "a.pddl", "--strict", folder=folder)[0] == 1
    assert bbtc("check", "domain.pddl", "a.pddl", "--strict", "--ignore", "BBT0301", folder=folder)[0] == 0


@pytest.mark.parametrize("command", ["compile", "plan"])
def test_other_commands_show_warnings_but_no_notes(folder: Path, command: str) -> None:
    status, messages = bbtc(command, "domain.pddl", "a.pddl", "-o", "out.json", folder=folder)
    assert status == 0
    assert findings(messages) == {UNUSED}


def test_a_problem_without_its_domain_is_noted(folder: Path) -> None:
    status, messages = bbtc("check", "a.pddl", folder=folder)
    assert status == 0
    assert findings(messages) == {("note", "BBT0006", "pa")}


def test_two_domains_of_one_name_are_both_checked(folder: Path) -> None:
    (folder / "other.pddl").write_text(DOMAIN.replace("(unused)", "(idle)"))
    status, messages = bbtc(
        "check", "domain.pddl", "other.pddl", "a.pddl", "--select", "BBT02", folder=folder
    )
    assert status == 0
    assert findings(messages) == {("warning", "BBT0208", "d")}
    _, messages = bbtc("check", "domain.pddl", "other.pddl", "a.pddl", folder=folder)
    assert {UNUSED, ("warning", "BBT0301", "idle")} <= findings(messages)


NOT_YET = """(define (domain look)
  (:requirements :contingent)
  (:predicates (unknown (seen)) (here) (there))
  (:action look :precondition (unknown (seen)) :observe (seen))
  (:action go :precondition (here) :effect (there)))
(define (problem p) (:domain look)
  (:init (unknown (seen)) (oneof (here) (there)) (or (here) (there)))
  (:metric minimize (total-cost)))
"""


def test_what_compile_will_refuse_is_noted(tmp_path: Path) -> None:
    """Each construct that is read and checked, but not compiled yet, has one note: the error of compile."""
    (tmp_path / "look.pddl").write_text(NOT_YET)
    status, checked = bbtc("check", "look.pddl", folder=tmp_path)
    noted = set(re.findall(r"(\S+): note\[(BBT04\d\d)\]", checked))
    assert {code for _, code in noted} == {"BBT0404", "BBT0405", "BBT0406", "BBT0411"}
    assert status == 0
    status, compiled = bbtc("compile", "look.pddl", folder=tmp_path)
    assert set(re.findall(r"(\S+): error\[(BBT04\d\d)\]", compiled)) == noted
    assert status == 1
