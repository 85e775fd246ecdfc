"""``bbtc fmt``: one layout, nothing lost, nothing touched without need."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.program import bbtc

ROUGH = """; a comment before
(define (domain d) ; and one behind
 (:predicates (a)   (b ?x)) (:action
   go :parameters (?X) ; the parameter
   :effect (B ?X)))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "rough.pddl").write_text(ROUGH)
    return tmp_path


def stamp(path: Path) -> tuple[int, int, bytes]:
    """Changes if the file is written again."""
    stat = path.stat()
    return stat.st_ino, stat.st_mtime_ns, path.read_bytes()


def test_a_file_is_laid_out_once_and_keeps_all_it_says(folder: Path) -> None:
    file = folder / "rough.pddl"
    assert bbtc("fmt", "rough.pddl", folder=folder).returncode == 0
    text = file.read_text()
    assert text != ROUGH
    assert text.split() == ROUGH.split() or "".join(text.split()) == "".join(ROUGH.split())
    before = stamp(file)
    assert bbtc("fmt", "rough.pddl", folder=folder).returncode == 0
    assert stamp(file) == before
    assert bbtc("fmt", "--check", "rough.pddl", folder=folder).returncode == 0


def test_check_writes_nothing_shows_a_diff_and_fails(folder: Path) -> None:
    before = stamp(folder / "rough.pddl")
    done = bbtc("fmt", "--check", "rough.pddl", folder=folder)
    assert done.returncode == 1
    assert "\n-(define (domain d) ; and one behind\n" in done.stderr or "\n- (:predicates" in done.stderr
    assert stamp(folder / "rough.pddl") == before


def test_standard_input_goes_to_standard_output(folder: Path) -> None:
    assert bbtc("fmt", "rough.pddl", folder=folder).returncode == 0
    laid_out = (folder / "rough.pddl").read_text()
    done = bbtc("fmt", "-", folder=folder, stdin=ROUGH)
    assert (done.returncode, done.stdout, done.stderr) == (0, laid_out, "")
    done = bbtc("fmt", "--check", "-", folder=folder, stdin=ROUGH)
    assert (done.returncode, done.stdout) == (1, "")
    assert bbtc("fmt", "--check", "-", folder=folder, stdin=laid_out).returncode == 0


def test_a_file_with_errors_is_left_alone_and_the_others_are_not(folder: Path) -> None:
    (folder / "broken.pddl").write_text("(define (domain x)\n  (:predicates (a))")
    before = stamp(folder / "broken.pddl")
    done = bbtc("fmt", "broken.pddl", "missing.pddl", "rough.pddl", folder=folder)
    assert done.returncode == 1
    assert "BBT0102" in done.stderr
    assert "missing.pddl" in done.stderr
    assert stamp(folder / "broken.pddl") == before
    assert (folder / "rough.pddl").read_text() != ROUGH


def test_windows_line_ends_become_unix_ones(folder: Path) -> None:
    (folder / "rough.pddl").write_bytes(ROUGH.replace("\n", "\r\n").encode())
    assert bbtc("fmt", "rough.pddl", folder=folder).returncode == 0
    assert b"\r" not in (folder / "rough.pddl").read_bytes()
