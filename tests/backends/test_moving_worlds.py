"""Simulated worlds of exports in which things happen by themselves, beside the exact figures."""

from __future__ import annotations

import random
import types
from fractions import Fraction
from pathlib import Path

import pytest

from bbtc.backends.pytrees.exporter import py_trees
from bbtc.diagnostics import Report
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, simulate_tree
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from tests.backends.test_btcpp_project import assert_succeeds_as_often, built, ran
from tests.long_form import amount

HALL = """
(define (domain hall)
  (:predicates (inside) (open) (broken) (lit))
  (:exogenous shuts :precondition (open) :before (opens dusk)
    :effect (probabilistic 0.5 (not (open))))
  (:exogenous opens :precondition (not (open)) :effect (probabilistic 0.25 (open)))
  (:exogenous dusk :precondition (lit) :effect (probabilistic 0.1 (not (lit))))
  (:exogenous breaks :effect (probabilistic 0.02 (broken)))
  (:action wait :effect ())
  (:action light :precondition (not (lit)) :effect (lit))
  (:action enter :precondition (and (lit) (not (inside))) :while (open)
    :on-abort (probabilistic 0.2 (broken))
    :effect (probabilistic 0.9 (inside))))
(define (problem get-in) (:domain hall)
  (:init)
  (:goal (and (inside) (not (broken))))
  (:goal-probability 0.5))
"""
RUNS = amount(1_000, 2_000)
FAR = 4.5
"""Standard deviations: once in a hundred thousand runs of a right test."""


@pytest.fixture(scope="module")
def tree() -> Tree:
    task = compile_sources([SourceFile("hall.pddl", HALL)], Report(), Limits())
    return plan_task(task, None, "policy", Limits(), lambda _: None).tree


def near(successes: int, probability: Fraction) -> bool:
    mean, variance = float(probability) * RUNS, float(probability * (1 - probability)) * RUNS
    return (successes - mean) ** 2 < FAR**2 * variance


def test_the_tree_is_no_trivial_one(tree: Tree) -> None:
    figures = simulate_tree(tree, Limits())[0]
    assert tree.bounds is not None
    assert tree.bounds[0] == tree.bounds[1] == figures.success == tree.success_probability
    assert Fraction(1, 2) < figures.success < Fraction(9, 10)


@pytest.mark.parametrize("runtime", ["embedded", "imported"])
def test_py_trees_worlds_succeed_as_often_as_the_figures_say(tree: Tree, runtime: str) -> None:
    pytest.importorskip("py_trees")
    module = types.ModuleType("exported")
    source = py_trees.export(tree, {"runtime": runtime}, None)
    exec(compile(source, "exported", "exec"), module.__dict__)
    rng = random.Random(11)
    told: list[str] = []

    def run() -> str:
        world = module.SimulatedWorld(
            module.INITIAL,
            module.ACTIONS,
            rng,
            told.append,
            events=module.EVENTS,
            interrupted=module.INTERRUPTED,
        )
        ended: str = module.run(module.create_root(world)).value
        return ended

    runs = RUNS if runtime == "embedded" else 1
    ends = [run() for _ in range(runs)]
    assert runs == 1 or near(ends.count("SUCCESS"), tree.success_probability)
    assert {"by itself: open() true", "enter(): aborted"} <= {*told} or runs == 1


def test_cpp_worlds_succeed_as_often_as_the_figures_say(tree: Tree, tmp_path: Path) -> None:
    build = built(tmp_path, tree)
    assert_succeeds_as_often(build / "simulate", tree.success_probability)
    assert_succeeds_as_often(build / "simulate", tree.success_probability, "--ticks", "3")
    told = "".join(ran(build / "simulate", "--seed", str(seed)) for seed in range(20))
    assert "by itself: Open() true" in told
    assert "aborted:" in told
