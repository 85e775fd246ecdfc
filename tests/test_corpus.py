"""A sample of the corpus of public files loads; ``python -m tests.corpus`` tries all of it."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from tests import corpus as report
from tests.long_form import amount

EVERY = amount(24, 12)


def test_a_sample_of_every_family_loads(corpus: Path) -> None:
    found = report.tallies(report.read_corpus(corpus), every=EVERY)
    short = [verdict for tally in found if tally.family in report.REQUIRED and not tally.good
             for verdict in tally.verdicts if verdict.kind == "wrong"]  # fmt: skip
    assert not short, "\n".join(f"{verdict.path}: {verdict.why}" for verdict in short)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("(probabilistic .5 (a))", "(probabilistic .25 (a))"),
        ("(probabilistic .5 (a) .5 (b))", "(and (probabilistic .5 (a)) (probabilistic .5 (b)))"),
        ("(oneof (a) (b))", "(and (a) (b))"),
        ("(oneof (and (a) (b)) (c))", "(oneof (a) (b) (c))"),
        ("(when (a) (oneof (b) (c)))", "(oneof (when (a) (b)) (c))"),
        (":observe (a)", ""),
        ("(decrease (reward) 1)", "(decrease (total-cost) 1)"),
        ("(not (a))", "(a)"),
        ("(a) (a)", "(a)"),
    ],
)
def test_a_change_that_loses_something_is_seen(before: str, after: str) -> None:
    assert report.lost(before, after) is not None


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("(probabilistic .5 a)", "(probabilistic\n  .5 (a)) ; as it was"),
        ("(?b-block ?c - block)", "(?b - block ?c - block)"),
        ("(:action a :effect (b))", "(:action a :parameters () :effect (b))"),
    ],
)
def test_a_change_of_layout_loses_nothing(before: str, after: str) -> None:
    assert report.lost(before, after) is None


def test_probabilities_are_counted_without_the_parser() -> None:
    content = report.content_of("(probabilistic 1/2 (a) .25 (probabilistic 1e-1 b))")
    assert content.probabilities == {Fraction(1, 2): 1, Fraction(1, 4): 1, Fraction(1, 10): 1}
