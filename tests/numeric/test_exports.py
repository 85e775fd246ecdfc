"""Exports of trees that test numbers: they run as the simulation says, and ask for numbers as numbers."""

from __future__ import annotations

import pytest

import bbtc
from bbtc.limits import Limits
from bbtc.replay.equivalence import difference, engine_missing
from bbtc.source import SourceFile
from tests.long_form import amount
from tests.numeric.random_texts import Writer

COURIER = """
(define (domain courier)
  (:predicates (at ?p) (parcel) (delivered))
  (:functions (battery) - (int 0 20 :block) (tries ?p) - (int 0 3) (use ?from ?to))
  (:constants dock hall ward)
  (:action drive :parameters (?from ?to)
    :precondition (and (at ?from) (> (use ?from ?to) 0) (> (battery) (* 2 (use ?from ?to))))
    :effect (and (not (at ?from)) (at ?to)
      (probabilistic
        0.8 (decrease (battery) (use ?from ?to))
        0.2 (decrease (battery) (* 2 (use ?from ?to))))))
  (:action charge :precondition (and (at dock) (<= (battery) 15)) :effect (increase (battery) 5))
  (:action swap :precondition (and (at dock) (< (battery) 4)) :effect (assign (battery) 12))
  (:action deliver :precondition (and (at ward) (< (tries ward) 3))
    :effect (and (increase (tries ward) 1) (when (>= (battery) 9) (probabilistic 0.7 (delivered))))))
(define (problem one) (:domain courier)
  (:init (at hall) (= (battery) 9) (= (tries dock) 0) (= (tries hall) 0) (= (tries ward) 0)
    (= (use dock hall) 2) (= (use hall dock) 2) (= (use hall ward) 3) (= (use ward hall) 3)
    (= (use dock ward) 0) (= (use ward dock) 0)
    (= (use dock dock) 0) (= (use hall hall) 0) (= (use ward ward) 0))
  (:goal (delivered)))
"""


@pytest.fixture(scope="module")
def courier() -> bbtc.Tree:
    return bbtc.plan(SourceFile("courier.pddl", COURIER)).tree


@pytest.mark.parametrize("form", ["py_trees", "btcpp"])
def test_exports_run_as_the_simulation_says(form: str, courier: bbtc.Tree) -> None:
    if engine_missing(form) is not None:
        pytest.skip(f"{engine_missing(form)} is not installed")
    assert difference(courier, form, Limits(), amount(60, 500)) is None
    for seed in range(amount(10, 1_000)):
        plan = _planned(Writer(seed).domain())
        if plan is not None:
            assert difference(plan.tree, form, Limits(), amount(10, 200)) is None, seed


def _planned(text: str) -> bbtc.Plan | None:
    """A plan of a random text; None where its goal cannot be reached."""
    try:
        return bbtc.plan(SourceFile("random.pddl", text))
    except bbtc.BbtcError:
        return None


def test_a_robot_is_asked_for_numbers_as_numbers(courier: bbtc.Tree) -> None:
    module = bbtc.export(courier, "py_trees")
    assert isinstance(module, str)
    assert "def battery(self) -> int | None:" in module
    assert "def tries(self, " in module
    assert "between(robot.battery(), " in module
    assert "digit" not in module


def test_the_simulated_world_of_py_trees_has_the_figures(courier: bbtc.Tree) -> None:
    space: dict[str, object] = {"__name__": "courier"}
    exec(compile(str(bbtc.export(courier, "py_trees")), "courier.py", "exec"), space)
    import random

    from py_trees.common import Status

    rng = random.Random(7)
    runs, wins = amount(400, 10_000), 0
    for _ in range(runs):
        world = space["SimulatedWorld"](space["INITIAL"], space["ACTIONS"], rng, lambda _: None)  # type: ignore[operator]
        wins += space["run"](space["create_root"](world)) == Status.SUCCESS  # type: ignore[operator]
    expected = float(courier.success_probability)
    # Five standard deviations.
    assert abs(wins / runs - expected) < 5 * (expected * (1 - expected) / runs) ** 0.5


def test_numbers_of_the_simulated_world_of_py_trees_stay_at_their_bounds() -> None:
    pytest.importorskip("py_trees", reason="py_trees is not installed")
    from bbtc.runtime.numbers import Shift

    battery = ("battery",)
    for before, amount_added, after in [(18, 5, 20), (18, 2, 20), (18, 1, 19), (3, -5, -1), (3, -3, 0)]:
        shift = Shift(battery, amount_added, -1, 20)
        assert shift.on({battery: before}).changes == {battery: after}
