"""Storm, our own solver, the simulator and the planner's bounds agree."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given

from bbtc.backends.models.jani import jani
from bbtc.backends.models.jani import task_text as jani_task
from bbtc.backends.models.prism import prism
from bbtc.backends.models.prism import task_text as prism_task
from bbtc.belief.simulate import simulate
from bbtc.diagnostics import BbtcError, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.bounds import task_value
from bbtc.tree.nodes import Tree
from bbtc.verifier import storm, storm_worker
from bbtc.verifier.chain import chain_of
from bbtc.verifier.explore import explore
from bbtc.verifier.naming import numbered
from bbtc.verifier.prism import prism_text
from bbtc.verifier.process import process_of
from bbtc.verifier.verdict import TOLERANCE, verify
from tests.long_form import amount
from tests.planner.examples import Optimum, cases
from tests.profiles import examples
from tests.replay.random_trees import random_tree, with_attempts
from tests.strategies import HOSTILE_NAMES, soda_tree, tasks, trees
from tests.verifier.optimum import best_probability
from tests.verifier.test_figures import FORMS

pytest.importorskip("stormpy", reason="Storm is not installed: pip install 'bbtc[storm]'")

TREE = ['P=? [F "success"]', 'P=? [F "failure"]', 'R{"actions"}=? [F "finished"]']
TASK = ['Pmax=? [F "goal"]']


def ask(text: str, properties: list[str]) -> list[Fraction | None]:
    """Storm's exact answers, in this process: starting one for each would take too long."""
    found = storm_worker.answer({"program": text, "properties": properties})
    assert found["exact"]
    return [None if low is None else Fraction(low) for low, _ in found["values"]]


def ask_about_jani(text: str, *names: str) -> list[Fraction | None]:
    import stormpy

    model, properties = stormpy.parse_jani_model_from_string(text)
    by_name = {one.get_name(): one for one in properties}
    built = stormpy.build_model[stormpy.Rational](model, properties)
    found = [stormpy.model_checking(built, by_name[name]) for name in names]
    values = [str(result.get_value(built.initial_states[0])) for result in found]
    return [None if value == "inf" else Fraction(value) for value in values]


def expected(tree: Tree) -> list[Fraction | None]:
    figures = simulate(tree.task, tree.root, Limits())
    return [figures.success, figures.failure, figures.actions]


# --- trees -----------------------------------------------------------------------------------


@pytest.mark.parametrize("first", range(0, amount(50, 1000), 25))
def test_random_trees_full_of_actions(first: int) -> None:
    for seed in range(first, first + 25):
        tree = random_tree(seed, latched=0.85 if seed % 2 else 0.5)
        form, most = FORMS[seed % len(FORMS)]
        program = chain_of(tree.task, tree.root, form, most)
        assert ask(prism_text(program, numbered(program)), TREE) == expected(tree), (seed, form, most)


def test_random_trees_that_try_again() -> None:
    for seed in range(amount(6, 500)):
        tree = with_attempts(random_tree(seed, latched=0.7), seed)
        for form in ("auto", "walk"):
            assert ask(prism.export(tree, {"form": form}, None), TREE) == expected(tree), (seed, form)


@examples(amount(8, 1000))
@given(tree=trees(HOSTILE_NAMES))
def test_exports_with_hostile_names_are_read_and_mean_the_same(tree: Tree) -> None:
    figures = simulate(tree.task, tree.root, Limits())
    for form in ("auto", "walk"):
        text = prism.export(tree, {"form": form}, None)
        assert ask(text, TREE) == [figures.success, figures.failure, figures.actions]
        text = jani.export(tree, {"form": form}, None)
        found = ask_about_jani(text, "success", "failure", "expected-actions")
        assert found == [figures.success, figures.failure, figures.actions]


def test_both_solvers_verify_a_tree_and_refuse_another() -> None:
    tree = soda_tree()
    verdict = verify(tree, Limits(), "all")
    assert verdict.problems == ()
    assert verdict.storm is not None
    assert verdict.storm.success == storm.Answer(Fraction(1, 2), Fraction(1, 2))
    other = replace(tree, success_probability=Fraction(1, 2) + 2 * TOLERANCE)
    assert [p.code for p in verify(other, Limits(), "storm").problems] == ["BBT0801"]
    other = replace(tree, success_probability=Fraction(1, 2) + TOLERANCE / 2)
    assert verify(other, Limits(), "storm").problems == ()


def test_large_models_are_solved_in_floats_with_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storm_worker, "MOST_EXACT", 0)
    for seed in range(20):
        tree = random_tree(seed, latched=0.5)
        program = chain_of(tree.task, tree.root)
        found = storm_worker.answer({"program": prism_text(program, numbered(program)), "properties": TREE})
        assert not found["exact"]
        for value, (low, high) in zip(expected(tree), found["values"], strict=True):
            assert (value is None) == (low is None)
            assert value is None or Fraction(low) <= value <= Fraction(high)
            assert value is None or Fraction(high) - Fraction(low) <= TOLERANCE / 10 * max(Fraction(1), value)


def test_the_time_limit_ends_storm() -> None:
    program = chain_of(soda_tree().task, soda_tree().root)
    with pytest.raises(LimitReached):
        storm.ask(program, TREE, Limits(seconds=0.05))


def test_a_storm_that_fails_gives_a_message() -> None:
    program = chain_of(soda_tree().task, soda_tree().root)
    with pytest.raises(BbtcError, match="BBT0804"):
        storm.ask(program, ["nonsense"], Limits())


# --- tasks -----------------------------------------------------------------------------------


def own_best(task: Task, most: int = 64) -> Fraction:
    return best_probability(explore(process_of(task, most), Limits()), Limits())


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_the_listed_values_of_the_cases(case: Optimum) -> None:
    task = case.task()
    best = own_best(task)
    assert float(best) == pytest.approx(case.best, abs=1e-9)
    assert ask(prism_task(task), TASK) == [best]


@examples(amount(20, 2000))
@given(task=tasks())
def test_the_best_that_any_policy_can_do(task: Task) -> None:
    """Bounds of the planner, our own policy iteration and Storm, which know nothing of one another."""
    value = task_value(task, Limits())
    best = own_best(task)
    assert value.lower <= best <= value.upper
    assert value.upper - value.lower <= TOLERANCE
    assert own_best(task, 0) == best
    assert ask(prism_task(task), TASK) == [best]
    assert ask_about_jani(jani_task(task), "goal") == [best]


def test_jani_has_the_documented_structure() -> None:
    model: dict[str, Any] = json.loads(jani.export(soda_tree(), {"form": "auto"}, None))
    assert (model["jani-version"], model["type"]) == (1, "dtmc")
    assert {one["name"] for one in model["properties"]} == {
        "success", "failure", "blocked", "expected-actions", "expected-cost",
    }  # fmt: skip
    (automaton,) = model["automata"]
    assert {edge.get("action") for edge in automaton["edges"]} == {None, "do_light_on", "do_detect_soda"}
