"""Why a target is out of reach, and what an interrupted run leaves behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from bbtc.cli.bounds_report import dead_end_lines
from bbtc.diagnostics import Report
from bbtc.ground.condition import Is, conjunction
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.synthesis import policy
from bbtc.planner.why_not import Block, DeadEnd, dead_ends
from bbtc.source import SourceFile
from tests.domains.problems import REPOSITORY, bbtc
from tests.planner.test_bounds import ONESHOT, coins, one_shot
from tests.planner.test_refine import action, task
from tests.strategies import soda_tree

T, F = Truth.TRUE, Truth.FALSE


def test_the_action_that_leads_into_a_dead_end_is_named() -> None:
    tree = plan_task(one_shot(), Fraction("0.9"), "policy", Limits(), lambda _: None).tree
    (end,) = dead_ends(tree, Limits())
    assert (end.probability, end.action, end.lost) == (Fraction(1, 2), "try()", ("goal()",))


def test_what_nothing_achieves_is_named_from_the_start() -> None:
    of = task("a b", {}, conjunction([Is(0, T), Is(1, T)]), action("b", Is(1, F), ("1", {1: T})))
    tree = plan_task(of, Fraction(1), "policy", Limits(), lambda _: None).tree
    (end,) = dead_ends(tree, Limits())
    assert (end.probability, end.action, end.lost) == (1, None, ("a()",))


def test_what_is_lost_is_followed_down_to_what_no_action_brings_back(tmp_path: Path) -> None:
    """A bulb that may burst: without light nothing is seen, and nothing mends the bulb."""
    file = tmp_path / "bulb.pddl"
    file.write_text(
        """(define (domain bulb)
          (:predicates (whole) (lit) (seen) (held))
          (:action switch :precondition (whole)
            :effect (probabilistic 3/4 (lit) 1/4 (not (whole))))
          (:action look :precondition (lit)
            :effect (probabilistic 1 (seen)))
          (:action grasp :precondition (seen)
            :effect (held)))
        (define (problem dark) (:domain bulb) (:init (whole) (unknown (seen)))
          (:goal (held)) (:goal-probability 0.9))"""
    )
    done = bbtc("plan", str(file), "--strategy", "policy", "-q")
    assert done.status == 1
    lines = [line.replace(f"{tmp_path}/", "") for line in done.err.splitlines()]
    assert lines[2:] == [
        "  1/4 (0.25): after switch() [bulb.pddl:3:11], nothing can bring about held()",
        "    switch() [bulb.pddl:3:11] needs whole(), and no action makes that true",
        "    most probably so:",
        "      switch(): whole() = false",
    ]


def test_many_dead_ends_are_summed_up() -> None:
    ends = [DeadEnd(Fraction(1, 20), f"a({i})", None, ("goal()",)) for i in range(12)]
    lines = dead_end_lines(soda_tree(), ends)
    assert len(lines) == 11
    assert lines[-1] == "  1/10 (0.1): 2 more ways to end without the goal"


def test_ends_for_lack_of_actions_are_told_in_sum() -> None:
    ends = [
        DeadEnd(Fraction(1, 4), "a()", None, ("goal()",)),
        DeadEnd(Fraction(1, 8), "flip()", None, ()),
        DeadEnd(Fraction(1, 16), "look()", None, ()),
    ]
    assert dead_end_lines(soda_tree(), ends, 3) == [
        "  3/16 (0.1875): too few of the 3 actions are left",
        "  1/4 (0.25): after a(), nothing can bring about goal()",
    ]


def test_a_target_out_of_reach_within_some_actions_is_told_with_their_number(tmp_path: Path) -> None:
    """Three tosses of a coin come up heads once with probability 7/8."""
    file = tmp_path / "coin.pddl"
    file.write_text(
        """(define (domain coin) (:predicates (heads))
          (:action toss :precondition (not (heads)) :effect (probabilistic 1/2 (heads))))
        (define (problem three) (:domain coin) (:init) (:goal (heads)) (:goal-probability 0.9))"""
    )
    done = bbtc("plan", str(file), "--max-actions", "3", "-q")
    assert done.status == 1
    policy = "any policy with at most 3 actions"
    assert done.err.splitlines() == [
        f"target 9/10 (0.9) is out of reach of {policy}; the best tree has success probability 7/8 (0.875)",
        "the best that any policy can do with at most 3 actions is 7/8 (0.875)",
        "  1/8 (0.125): too few of the 3 actions are left",
    ]


def test_facts_that_nothing_tells_or_undoes_are_named_as_such() -> None:
    blocks = (
        Block("seen(cup)", T, Truth.UNKNOWN, "grab(cup)", None),
        Block("broken()", F, T, None, None),
        Block("seen(cup)", Truth.UNKNOWN, F, "look()", None),
    )
    assert dead_end_lines(soda_tree(), [DeadEnd(Fraction(1), None, None, (), blocks)]) == [
        "  1: from the start, nothing can bring about the goal as a whole",
        "    grab(cup) needs seen(cup), which is unknown: no action observes or achieves it",
        "    the goal needs not broken(), and no action makes that true",
        "    look() needs seen(cup) to be unknown, and no action makes it that",
    ]


def test_a_target_that_is_reached_has_no_dead_ends_to_explain() -> None:
    tree = plan_task(one_shot(), Fraction("0.5"), "policy", Limits(), lambda _: None).tree
    assert dead_ends(tree, Limits()) == ()


def test_the_report_cites_the_line_of_the_action(tmp_path: Path) -> None:
    file = tmp_path / "oneshot.pddl"
    file.write_text(ONESHOT)
    done = bbtc("plan", str(file))
    assert done.status == 1
    assert "after try() [" in done.err
    assert "oneshot.pddl:4:" in done.err
    assert "nothing can bring about done()" in done.err


def test_an_interrupt_leaves_the_best_tree_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **_options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(policy, "finish", interrupted)
    again = action("again", Is(0, F), ("1/2", {0: T}), ("1/2", {}))
    of = task("a", {}, Is(0, T), again)
    tree = plan_task(of, Fraction("0.9"), "policy", Limits(), lambda _: None).tree
    assert tree.success_probability == 1, "the tree that tries without end was there already"
    monkeypatch.setattr(policy, "synthesize", interrupted)
    tree = plan_task(of, Fraction("0.9"), "policy", Limits(), lambda _: None).tree
    assert tree.success_probability == 1, "the policy was known, and is written without looking for rules"
    monkeypatch.setattr(policy, "best_known", interrupted)
    tree = plan_task(of, Fraction("0.9"), "policy", Limits(), lambda _: None).tree
    assert (tree.status, tree.success_probability) == ("interrupted", 0)


@pytest.mark.parametrize("after", [1, 2, 3])
def test_an_interrupted_search_leaves_what_it_knows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, after: int
) -> None:
    """While states are expanded, after so many solutions of what was expanded before."""
    count = 0
    tell = Limits.tell

    def interrupted(limits: Limits, doing: str, *figures: Any) -> None:
        nonlocal count
        solved = doing == "search for the best probability"
        if not solved and count == after:
            count += 1
            raise KeyboardInterrupt
        count += solved
        tell(limits, doing, *figures)

    monkeypatch.setattr(Limits, "tell", interrupted)
    of = compile_sources([SourceFile("coins.pddl", coins(9))], Report(), Limits())
    tree = plan_task(of, Fraction(1, 2), "policy", Limits(states=2000), lambda _: None).tree
    assert tree.status == "interrupted"
    assert tree.bounds is not None
    assert tree.success_probability == tree.bounds[0]
    assert tree.bounds[0] <= Fraction(3, 4) ** 9 < tree.bounds[1]
    assert (tree.success_probability > 0) == (after > 1)
    count = 0
    # 1/13 is hardly more than what is possible: the bounds have to be close to tell.
    tree = plan_task(of, Fraction(1, 13), "refine", Limits(states=2000), lambda _: None).tree
    assert tree.status == "interrupted", "bounds are searched for where refinement got stuck"
    count = 0
    file = tmp_path / "coins.pddl"
    file.write_text(coins(9))
    done = bbtc("plan", str(file), "--bounds", "--max-states", "2000", "--target", "1/2")
    assert done.status == 130
    assert done.out.decode().splitlines()[-1] == "interrupted"


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as on POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_planning_with_a_tree(tmp_path: Path, number: signal.Signals) -> None:
    """Many coins, and how each fell is remembered: every policy leads to more states than can be explored."""
    facts = " ".join(f"(heads{i}) (tails{i})" for i in range(60))
    actions = " ".join(
        f"(:action toss{i} :precondition (not (or (heads{i}) (tails{i})))"
        f" :effect (probabilistic 1/2 (heads{i}) 1/2 (tails{i})))"
        for i in range(60)
    )
    goal = " ".join(f"(or (heads{i}) (tails{i}))" for i in range(60))
    file = tmp_path / "tosses.pddl"
    file.write_text(
        f"(define (domain d) (:predicates {facts}) {actions})"
        f"(define (problem p) (:domain d) (:init) (:goal (and {goal})))"
    )
    command = [sys.executable, "-m", "bbtc.cli.main", "plan", str(file), "--strategy", "policy"]
    run = subprocess.Popen(
        [*command, "--max-states", "1000000000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=REPOSITORY,
    )
    assert run.stderr is not None
    run.stderr.readline()  # planning has begun
    time.sleep(0.3)
    run.send_signal(number)
    out, err = run.communicate(timeout=60)
    assert run.returncode == 130, err
    assert json.loads(out)["status"] == "interrupted"
