"""Perturbed runs: sampled figures beside the exact chain of the same world, and what each of them counts."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from math import sqrt
from pathlib import Path
from random import Random

import pytest

import bbtc
from bbtc.disturbance.intervals import wilson
from bbtc.disturbance.perturbed import PerturbedRuns, perturbed_runs
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree
from tests.cli.program import bbtc as program
from tests.disturbance.reference import Changes, Exact, State
from tests.long_form import amount
from tests.replay.random_trees import random_tree, with_attempts

DOMAINS = Path(__file__).parents[2] / "domains"
TWENTIETH = Fraction(1, 20)
TICKS = 60
SMALL = ["doors/to-the-archive", "trolley/with-spares", "charging/one-room"]


def domain_tree(problem: str, guarded: bool = False) -> Tree:
    domain = DOMAINS / problem.partition("/")[0] / "domain.pddl"
    return bbtc.plan(domain, DOMAINS / f"{problem}.pddl", guarded=guarded, retries="least").tree


def changes_of(task: Task) -> Changes:
    facts = ChangingFacts.of(task, Limits())

    def changes(state: State) -> list[tuple[Fraction, State]]:
        return [(chance, tuple(after)) for chance, after in facts.changes(bytes(state))]

    return changes


def compare(task: Task, root: Node, rate: Fraction, runs: int, seed: int) -> PerturbedRuns:
    """Each sampled share is as near to the exact one as so many runs must come (5 sigma)."""
    found = perturbed_runs(task, root, rate, Limits(), runs=runs, seed=seed, most_ticks=TICKS)
    exact = Exact(task, root, float(rate), changes_of(task)).chances(TICKS)
    counts = {
        "success": found.successes,
        "missed": found.missed,
        "failure": found.failures,
        "blocked": found.blocked,
        "cut": found.cut,
    }
    assert sum(counts.values()) == runs
    for kind, count in counts.items():
        expected = min(1.0, exact[kind])  # floats may sum up to a bit more
        assert abs(count / runs - expected) <= 5 * sqrt(expected * (1 - expected) / runs) + 1e-9, kind
    # Of these, a run has between 0 and TICKS.
    for kind, mean in (("starts", found.actions), ("unready", Fraction(found.unready, runs))):
        expected = exact[kind]
        assert abs(float(mean) - expected) <= 5 * sqrt(expected * TICKS / runs) + 1e-9, kind
    assert (found.unready == 0) >= (exact["unready"] == 0)
    # An action costs as much here as there: the mean costs of an action are as near as the numbers of them.
    if found.starts > 1000:
        assert abs(float(found.cost / found.actions) / (exact["cost"] / exact["starts"]) - 1) < 0.05
    return found


@pytest.mark.parametrize("guarded", [False, True])
@pytest.mark.parametrize("problem", SMALL)
def test_sampled_figures_are_those_of_the_exact_chain(problem: str, guarded: bool) -> None:
    tree = domain_tree(problem, guarded=guarded)
    found = compare(tree.task, tree.root, TWENTIETH, amount(5_000, 100_000), 7)
    assert found.changes > 0
    if guarded:
        assert found.unready == 0
        assert found.missed == 0


def test_sampled_figures_of_random_trees_are_those_of_the_exact_chain() -> None:
    seen = dict.fromkeys(("successes", "missed", "failures", "blocked", "cut", "unready"), 0)
    for seed in range(amount(40, 600)):
        rng = Random(seed)
        tree = random_tree(seed, guarded=0.1)
        tree = tree if seed % 4 else with_attempts(tree, seed)
        rate = rng.choice([Fraction(0), Fraction(1, 7), Fraction(1)])
        found = compare(tree.task, tree.root, rate, 400, seed)
        for kind in seen:
            seen[kind] += getattr(found, kind)
    assert all(seen.values()), "every way to end, and starts without precondition"


TWO_LAMPS = """
(define (domain lamps) (:predicates (power) (left) (right))
  (:action press_left :precondition (power) :effect (left))
  (:action press_right :precondition (power) :effect (right))
  (:action cut :precondition (and (left) (right)) :effect (and (not (power)) (not (left)) (not (right)))))
(define (problem both) (:domain lamps) (:init (power)) (:goal (and (left) (right))))
"""


def lamps(guarded: bool) -> Tree:
    """Press left, press right; ``guarded``: each where there is power, and look at both lamps last."""
    task = bbtc.compile(bbtc.SourceFile("lamps.pddl", TWO_LAMPS))
    presses = [ActionNode(name, f"press_{name}()", True, guarded) for name in ("left", "right")]
    seen = [ConditionNode("seen", task.goal)] if guarded else []
    return Tree(task, ControlNode("n1", "sequence", (*presses, *seen)), Fraction(1), Fraction(1), "stuck")


def test_unguarded_trees_start_without_precondition_and_miss_goals_guarded_ones_do_not() -> None:
    plain, guarded = (bbtc.perturb(lamps(kind), "10%", runs=2000) for kind in (False, True))
    assert plain.unready > 0 == guarded.unready
    assert plain.missed > 0 == guarded.missed
    assert plain.successes > 0 < guarded.failures


def test_without_changes_the_figures_are_those_of_the_exact_simulation() -> None:
    tree = domain_tree("doors/to-the-lab")
    exact = bbtc.simulate(tree)
    found = bbtc.perturb(tree, 0, runs=20_000, seed=5)
    assert found.changes == found.unready == found.missed == 0
    assert found.interval.lower < exact.success < found.interval.upper
    for sampled, figure in ((found.cost, exact.cost), (found.cost_given_success, exact.cost_given_success)):
        assert sampled is not None
        assert figure is not None
        assert abs(sampled - figure) < Fraction(1, 10)
    assert exact.cost != exact.cost_given_success


def test_a_longer_sample_begins_with_the_shorter_one_and_seeds_differ() -> None:
    tree = domain_tree("doors/to-the-archive")
    long, short, same = (bbtc.perturb(tree, "1/20", runs=runs, seed=1) for runs in (300, 200, 200))
    other = bbtc.perturb(tree, "1/20", runs=200, seed=2)
    assert short == same
    assert (short.starts, short.changes) != (other.starts, other.changes)
    assert 0 <= long.successes - short.successes <= 100
    assert long.changes - short.changes >= 0


def test_the_same_bytes_whatever_the_hash_seed(tmp_path: Path) -> None:
    (tmp_path / "tree.json").write_text(bbtc.dumps(domain_tree("kitting/gift-set")), "utf-8")
    command = [
        sys.executable,
        "-m",
        "bbtc.cli.main",
        "simulate",
        "tree.json",
        "--perturb",
        "1/9",
        "--runs",
        "300",
        "--json",
    ]
    found = {
        subprocess.run(
            command, cwd=tmp_path, env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, check=True
        ).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1
    data = json.loads(found.pop())["perturbed"]
    assert data["rate"] == "1/9"
    assert (
        data["runs"]
        == 300
        == sum(data[k] for k in ("successes", "goals_missed", "failures", "blocked", "cut"))
    )


def test_runs_are_cut_at_the_bound_on_ticks() -> None:
    tree = domain_tree("doors/to-the-lab")
    assert bbtc.perturb(tree, 0, runs=50, max_ticks=1).cut == 50


def test_a_tree_from_a_file_is_run_with_the_actions_of_the_task_where_that_is_given() -> None:
    domain, problem = DOMAINS / "household" / "domain.pddl", DOMAINS / "household" / "grasp-soda.pddl"
    tree = bbtc.plan(domain, problem, strategy="refine").tree
    task = bbtc.compile(domain, problem)
    read = bbtc.load_tree(bbtc.SourceFile("tree.json", bbtc.dumps(tree)))
    assert len(read.task.actions) < len(task.actions)
    assert bbtc.perturb(read, "5%", task=task, runs=500) == bbtc.perturb(tree, "5%", runs=500)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--perturb", "1.5"], "'--perturb': 1.5 is not between 0 and 1"),
        (["--perturb", "5"], "write 5% for a percentage"),
        (["--perturb", "often"], "'often' is not a probability"),
        (["--perturb", "0.1", "--runs", "0"], "'--runs': 0 is not in the range"),
        (["--perturb", "0.1", "--max-ticks", "0"], "'--max-ticks': 0 is not in the range"),
        (["--perturb", "0.1", "--seed", "x"], "'--seed': 'x' is not a valid integer"),
    ],
)
def test_wrong_options_are_wrong_usage(arguments: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "tree.json").write_text(bbtc.dumps(domain_tree("doors/to-the-archive")), "utf-8")
    result = program("simulate", tmp_path / "tree.json", *arguments)
    assert result.returncode == 2
    assert message in result.stderr


@pytest.mark.parametrize(
    "call",
    [
        lambda tree: bbtc.perturb(tree, 2),
        lambda tree: bbtc.perturb(tree, "x"),
        lambda tree: bbtc.perturb(tree, 0, runs=0),
        lambda tree: bbtc.perturb(tree, 0, max_ticks=0),
    ],
)
def test_functions_refuse_what_the_command_does(call: Callable[[Tree], object]) -> None:
    with pytest.raises(ValueError):
        call(domain_tree("doors/to-the-archive"))


def test_intervals_hold_what_they_promise() -> None:
    # Compared with the formula in floats, and as often right as promised where runs are drawn.
    for successes, runs in ((0, 10), (10, 10), (3, 10), (99_100, 100_000)):
        z, p = 1.959964, successes / runs
        half = z * sqrt(p * (1 - p) / runs + z * z / (4 * runs * runs)) / (1 + z * z / runs)
        middle = (p + z * z / (2 * runs)) / (1 + z * z / runs)
        found = wilson(successes, runs)
        assert abs(float(found.lower) - max(0, middle - half)) < 2e-6
        assert abs(float(found.upper) - min(1, middle + half)) < 2e-6
    rng = Random(0)
    held = 0
    for _ in range(2000):
        found = wilson(sum(rng.random() < 0.9 for _ in range(100)), 100)
        held += found.lower <= Fraction(9, 10) <= found.upper
    assert held > 0.92 * 2000
