"""What `bbtc plan` and `bbtc simulate` say of figures: whence a difference, and what they rest on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.domains.problems import bbtc

COIN = """(define (domain coin) (:predicates (heads) (shown))
  (:action toss :precondition (not (heads)) :effect (probabilistic 1/2 (heads)))
  (:action show :precondition (heads) :effect (shown)))
(define (problem toss) (:domain coin) (:goal (shown)))"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The coin."""
    (tmp_path / "coin.pddl").write_text(COIN)
    return tmp_path / "coin.pddl"


def test_the_last_step_and_the_tree_do_not_differ_without_a_word(file: Path) -> None:
    """Tossed without end it comes up heads for sure; three tosses are enough for 0.8."""
    done = bbtc("plan", str(file), "--strategy", "search", "--retries", "least", "--target", "0.8")
    assert [line.strip() for line in done.err.splitlines()[-4:-1]] == [
        "success 1, 7 nodes",
        "then simplified, with no more attempts than the target takes:",
        "success 7/8 (0.875), 8 nodes",
    ]


def test_a_tree_that_stays_as_it_is_gets_no_such_line(file: Path) -> None:
    done = bbtc("plan", str(file), "--strategy", "search", "--retries", "unbounded", "--target", "1")
    assert "simplified" not in done.err


def test_chances_that_nobody_knows_are_named(tmp_path: Path) -> None:
    """One action has a `oneof`, one another within a draw, one none."""
    file, tree = tmp_path / "walk.pddl", str(tmp_path / "tree.json")
    file.write_text(
        """(define (domain walk) (:predicates (there) (back) (rested))
          (:action go :precondition (not (there)) :effect (oneof (there) (and)))
          (:action come :precondition (there) :effect (probabilistic 1/2 (oneof (back) (and))))
          (:action rest :precondition (back) :effect (rested)))
        (define (problem stroll) (:domain walk) (:goal (rested)))"""
    )
    note = "outcomes of come, go count as equally likely"
    assert f"oneof: {note}\n" in bbtc("plan", str(file), "--bounds").out.decode()
    bbtc("plan", str(file), "-q", "-o", tree)
    assert f"oneof     {note}\n" in bbtc("simulate", tree).out.decode()


@pytest.mark.parametrize(
    ("target", "told"), [("0.5", "the only attempt used up"), ("0.8", "all 3 attempts used up")]
)
def test_used_up_attempts_are_counted(file: Path, tmp_path: Path, target: str, told: str) -> None:
    tree = str(tmp_path / "tree.json")
    least = ("--strategy", "search", "--retries", "least")
    bbtc("plan", str(file), *least, "--target", target, "-q", "-o", tree)
    assert told in bbtc("simulate", tree).out.decode()
