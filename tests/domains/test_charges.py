"""Costs and rewards that depend on the state: the figures that the words of a text give them, everywhere."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner

import bbtc
from bbtc.cli.group import cli
from bbtc.diagnostics import Severity
from bbtc.source import SourceFile
from tests.long_form import LONG

# A courier crosses once; what that costs and earns besides the 2 of the way is `{}`. All that it may depend
# on can change, but too late.
COURIER = """(define (domain courier)
  (:requirements :typing :mdp :rewards :action-costs :conditional-effects :probabilistic-effects
    :non-deterministic :negative-preconditions :universal-effects :unknown)
  (:types lane)
  (:predicates (there) (wet) (icy) (dark) (shut ?l - lane))
  (:functions (total-cost) (toll ?l - lane))
  (:action change :precondition (there)
    :effect (and (not (wet)) (not (icy)) (dark) (forall (?l - lane) (oneof (shut ?l) (not (shut ?l))))))
  (:action cross :precondition (not (there))
    :effect (and (there) (increase (total-cost) 2) {})))
(define (problem one-way) (:domain courier) (:objects a b c - lane)
  (:init (wet) (unknown (icy)) (shut a) (shut b) (= (toll a) 5) (= (toll b) 1/2) (= (toll c) 7))
  (:goal (there)))"""

CASES = {
    "(when (wet) (increase (total-cost) 3))": (5, 0),
    "(when (not (wet)) (increase (total-cost) 3))": (2, 0),
    "(when (icy) (increase (total-cost) 3))": (2, 0),
    "(when (not (icy)) (increase (total-cost) 3))": (2, 0),
    "(when (unknown (icy)) (increase (total-cost) 3))": (5, 0),
    "(when (and (wet) (icy)) (increase (reward) 3))": (2, 0),
    "(when (or (wet) (icy)) (increase (reward) 3))": (2, 3),
    "(when (wet) (not (wet))) (when (wet) (decrease (reward) 4))": (2, -4),
    "(forall (?l - lane) (when (shut ?l) (increase (total-cost) (toll ?l))))": (Fraction(15, 2), 0),
    "(forall (?l - lane) (when (not (shut ?l)) (decrease (reward) (toll ?l))))": (2, -7),
    "(probabilistic 1/4 (when (wet) (increase (total-cost) 8)))": (4, 0),
    "(when (wet) (probabilistic 1/4 (increase (total-cost) 8) 1/2 (increase (reward) 6)))": (4, 3),
    "(when (dark) (probabilistic 1/4 (increase (total-cost) 8)))": (2, 0),
    "(when (wet) (when (unknown (icy)) (increase (total-cost) 8)))": (10, 0),
    "(when (wet) (oneof (increase (total-cost) 8) (and) (increase (total-cost) 1)))": (5, 0),
    "(oneof (when (wet) (increase (total-cost) 9)) (when (dark) (increase (total-cost) 100)) (and))": (5, 0),
    "(probabilistic 1/2 (probabilistic 1/2 (when (wet) (increase (reward) 8))))": (2, 2),
    "(when (wet) (increase (total-cost) 1)) (when (wet) (increase (total-cost) 1/3))": (Fraction(10, 3), 0),
    "(when (wet) (decrease (total-cost) 1))": (1, 0),
    "(probabilistic 1 (when (wet) (increase (total-cost) 1)) 0 (increase (total-cost) 50))": (3, 0),
    "(forall (?l ?m ?n - lane) (probabilistic 1/2 (when (shut ?l) (increase (total-cost) 1))))": (11, 0),
}


@pytest.mark.parametrize("more", CASES)
def test_what_depends_on_the_state_counts_where_its_condition_is_true(more: str) -> None:
    source = SourceFile("courier.pddl", COURIER.format(more))
    cost, reward = CASES[more]
    assert not [each for each in bbtc.check(source) if each.severity is Severity.ERROR]
    tree = bbtc.plan(source).tree
    figures = bbtc.simulate(tree)
    assert (figures.success, figures.cost, figures.reward) == (1, cost, reward)
    assert figures.cost_given_success == cost
    asked = LONG or [*CASES].index(more) % 4 == 0
    verdict = bbtc.verify(tree, engine="auto" if asked else "own")
    assert verdict.problems == ()
    assert verdict.own is not None
    assert (verdict.own.cost, verdict.own.reward) == (cost, reward)
    if verdict.storm is not None:
        found = {name: answer.lower for name, answer in verdict.storm.figures}
        assert found["cost"] == cost
        assert found.get("reward", reward if reward <= 0 else None) == reward
    assert bbtc.bounds(source, costs=True).cost == cost


def test_reports_show_the_reward(tmp_path: Path) -> None:
    tree = tmp_path / "tree.json"
    source = SourceFile("courier.pddl", COURIER.format("(when (wet) (increase (reward) 3/2))"))
    tree.write_text(bbtc.dumps(bbtc.plan(source)), "utf-8")
    for command in (["simulate"], ["verify", "--engine", "own"]):
        assert "reward    3/2 (1.5) expected\n" in CliRunner().invoke(cli, [*command, str(tree)]).output
