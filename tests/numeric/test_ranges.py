"""Which range a number gets that has none, and which effect is refused where there is none."""

from __future__ import annotations

from fractions import Fraction

import pytest

import bbtc
from bbtc.diagnostics import BbtcError
from bbtc.source import SourceFile
from tests.conftest import corpus_folder

_TEXT = """
(define (domain d) (:predicates (done)) (:functions (x) (y) (step ?a) {functions})
  (:constants one two)
  {actions}
  (:action finish :precondition {condition} :effect (done)))
(define (problem p) (:domain d)
  (:init (= (x) 3) (= (y) 0) (= (step one) 1) (= (step two) 4)) (:goal (done)))
"""


def _task(actions: str, condition: str = "(= (x) 3)", functions: str = "") -> bbtc.Task:
    text = _TEXT.format(actions=actions, condition=condition, functions=functions)
    return bbtc.compile(SourceFile("d.pddl", text))


def _doing(condition: str, effect: str, name: str = "a") -> str:
    """An action of one parameter."""
    return f"(:action {name} :parameters (?s) :precondition {condition} :effect {effect})"


_COUNTING = _doing("(< (y) 5)", "(increase (y) 1)")


@pytest.mark.parametrize(
    ("actions", "low", "high"),
    [
        # A bound of the number itself: the step before it may lead beyond.
        (_doing("(< (x) 9)", "(increase (x) 2)"), 3, 11),
        (_doing("(>= (x) 1)", "(decrease (x) 1)"), 0, 3),
        # A bound of what comes of it.
        (_doing("(>= (x) (step ?s))", "(decrease (x) (step ?s))"), 0, 3),
        (_doing("(<= (+ (x) (step ?s)) 10)", "(increase (x) (step ?s))"), 3, 10),
        (_doing("(not (< (x) 2))", "(decrease (x) 2)"), 0, 3),
        # A bound of a guard.
        (_doing("(and)", "(when (> 6 (x)) (increase (x) 1))"), 3, 7),
        # Assigned values.
        (_doing("(and)", "(assign (x) (* 5 (step ?s)))"), 3, 20),
        (_doing("(and)", "(scale-up (x) 0)"), 0, 3),
        # One number bounds the other.
        (_COUNTING + _doing("(and)", "(assign (x) (- (y) 2))", "b"), -2, 4),
        # What never happens widens nothing.
        (_doing("(> (x) 100)", "(increase (x) 1)") + _doing("(and)", "(assign (x) 4)", "b"), 3, 4),
        # Many steps are not counted one by one.
        (_doing("(<= (x) 1000000)", "(increase (x) 1)"), 3, 1000001),
    ],
)
def test_a_range_follows_from_the_problem(actions: str, low: int, high: int) -> None:
    (number,) = [each for each in _task(actions).numbers if each.function == "x"]
    assert (number.low, number.high, number.blocks) == (low, high, False)


_DOWN, _UP = "changes `x` downwards without a bound", "changes `x` upwards without a bound"


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        (_doing("(and)", "(increase (x) 1)"), f"`increase (x)` {_UP}"),
        (_doing("(and)", "(decrease (x) 1)"), f"`decrease (x)` {_DOWN}"),
        (
            _doing("(< (x) 9)", "(increase (x) 1)") + _doing("(and)", "(decrease (x) (step ?s))", "b"),
            f"`decrease (x)` {_DOWN}",
        ),
        (_doing("(and)", "(assign (x) (/ 6 (- (x) 3)))"), f"`assign (x)` {_DOWN}"),
        (_doing("(and)", "(scale-up (x) 2)"), f"`scale-up (x)` {_UP}"),
    ],
)
def test_what_grows_without_end_is_named(actions: str, words: str) -> None:
    with pytest.raises(BbtcError) as raised:
        _task(actions)
    (found,) = [each for each in raised.value.diagnostics if each.code == "BBT0438"]
    assert found.message == words
    assert found.span is not None


def test_a_number_whose_range_was_found_is_changed_once_at_a_time() -> None:
    """Each of the two is within bounds, both together are not."""
    with pytest.raises(BbtcError) as raised:
        _task("(:action a :precondition (>= (x) 1) :effect (and (decrease (x) 1) (decrease (x) 1)))")
    assert [each.code for each in raised.value.diagnostics] == ["BBT0440"]


def test_what_nothing_reads_is_no_part_of_the_state() -> None:
    task = _task("(:action a :effect (and (increase (y) 1) (assign (x) 2)))")
    assert [number.name for number in task.numbers] == ["x()"]


def test_a_metric_may_weigh_what_it_sums() -> None:
    text = """
    (define (domain d) (:predicates (p) (done)) (:functions (fuel) (noise))
      (:action loud :effect (and (p) (increase (noise) 3) (increase (fuel) 1)))
      (:action finish :precondition (p) :effect (and (done) (increase (fuel) 1/2))))
    (define (problem x) (:domain d) (:init (= (fuel) 0) (= (noise) 0)) (:goal (done))
      (:metric minimize (+ (* 4 (total-time)) (+ (* 2 (fuel)) (* 0 (noise))))))
    """
    assert bbtc.plan(SourceFile("d.pddl", text)).figures.cost == 2 * 4 + 2 * Fraction(3, 2)


_FAMILIES = {
    "depots": "`decrease (current_load ?z)` changes `current_load` downwards without a bound",
    "rovers": None,
    "satellite": "`decrease (fuel satellite0)` leads to a value that is no whole number",
    "settlers": "`increase (available ?r ?v)` changes `available` upwards without a bound",
    "zenotravel": "`decrease (onboard ?a)` changes `onboard` downwards without a bound",
}


@pytest.mark.skipif(corpus_folder() is None, reason="no corpus")
@pytest.mark.parametrize("family", _FAMILIES)
def test_numeric_families_load_or_are_refused_by_name(family: str) -> None:
    corpus = corpus_folder()
    assert corpus is not None
    folder = corpus / "classical" / f"ipc02-{family}-numeric-automatic"
    for problem in sorted(folder.glob("instance-*.pddl"))[:2]:
        if (words := _FAMILIES[family]) is None:
            assert bbtc.compile(folder / "domain.pddl", problem).numbers
            continue
        with pytest.raises(BbtcError) as raised:
            bbtc.compile(folder / "domain.pddl", problem)
        assert words in [each.message for each in raised.value.diagnostics]
