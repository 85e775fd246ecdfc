"""What `bbtc verify` finds of the time that a tree takes, by code of its own."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction

import pytest

import bbtc
from bbtc import pipeline
from bbtc.durations import LogNormal
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.timing.figures import success_by
from bbtc.tree.nodes import SuccessBy
from bbtc.verifier.timed import time_found
from tests.long_form import amount
from tests.timing.test_curve import domain_text, planned, times

F = Fraction


@pytest.mark.parametrize("seed", range(amount(5, 300)))
def test_expected_time_and_success_by_a_deadline_agree(seed: int) -> None:
    generator = random.Random(5000 + seed)
    for _ in range(50):
        tree = planned(domain_text(generator))
        if tree is None or not any(action.duration for action in tree.task.actions):
            continue
        seconds = F(generator.randint(5, 90))
        own = time_found(tree.task, tree.root, Limits(), seconds)
        told = times(tree).figures
        assert told is not None
        assert own is not None
        if any(isinstance(action.duration, LogNormal) for action in tree.task.actions):
            if told.expected is not None:
                assert own.expected is not None
                assert float(own.expected) == pytest.approx(float(told.expected[1]), rel=1e-9)
        else:
            expected = None if told.expected is None else told.expected[0]
            given = None if told.given_success is None else told.given_success[0]
            assert (own.expected, own.given_success) == (expected, given)
        _, chain = pipeline.simulate_tree(tree, Limits())
        by = success_by(tree.task, chain, seconds, Limits())
        assert own.by is not None
        # Other steps, the same truth: both pairs of bounds hold it.
        assert own.by[0] <= float(by.at_most) + 1e-9
        assert float(by.at_least) <= own.by[1] + 1e-9
        verdict = bbtc.verify(replace(tree, success_by=by, status="stuck", target=F(1)), engine="own")
        assert not verdict.problems
        return
    raise AssertionError("no text has a tree")


@pytest.mark.parametrize(("least", "most"), [("0.9", "0.95"), ("0.1", "0.2")])
def test_a_wrong_claim_is_refused(least: str, most: str) -> None:
    tree = planned(
        "(define (domain d) (:predicates (a)) (:action x :precondition (not (a)) "
        ":effect (probabilistic 0.5 (a)) :duration (uniform 5 10)))"
        "(define (problem p) (:domain d) (:init) (:goal (a)))"
    )
    assert tree is not None
    wrong = replace(tree, status="stuck", success_by=SuccessBy(F(10), F(least), F(most)))
    (problem,) = bbtc.verify(wrong, engine="own").problems
    assert problem.code == "BBT0801"
    assert "the tree claims success within 10 s from" in problem.message


def test_the_status_is_one_of_the_deadline() -> None:
    text = (
        "(define (domain d) (:predicates (a)) (:action x :precondition (not (a)) "
        ":effect (probabilistic 0.5 (a)) :duration 5))"
        "(define (problem p) (:domain d) (:init) (:goal (a)) (:goal-probability 0.9))"
    )
    tree = bbtc.plan(SourceFile("d.pddl", text), deadline=5).tree
    assert tree.status == "out-of-reach"
    assert tree.success_probability == 1
    assert not bbtc.verify(tree, engine="own").problems
    (problem,) = bbtc.verify(replace(tree, status="target-reached"), engine="own").problems
    assert "but the target is 9/10" in problem.message


TIGER = """
(define (domain tiger)
  (:types door)
  (:constants left right - door)
  (:predicates (tiger ?d - door) (opened) (safe))
  (:action listen
    :precondition (not (opened)) :observe (probabilistic 0.85 (tiger left)) :duration 3)
  (:action open
    :parameters (?d - door)
    :precondition (and (not (opened)) (believed (not (tiger ?d)) 0.95))
    :effect (and (opened) (when (not (tiger ?d)) (safe))) :duration 3))
(define (problem two-doors)
  (:domain tiger)
  (:init (oneof (tiger left) (tiger right)))
  (:goal (believed (safe) 0.95))
  (:goal-probability 0.95))
"""


def test_success_in_time_counts_no_mistakes_where_facts_are_hidden() -> None:
    tree = bbtc.plan(SourceFile("d.pddl", TIGER), deadline=9).tree
    by = tree.success_by
    assert by is not None
    # Two readings that agree, then the door: right with 0.85² of 0.85² + 0.15².
    assert by.at_least <= F(85, 100) ** 2 <= by.at_most
    assert not bbtc.verify(tree, engine="own").problems
