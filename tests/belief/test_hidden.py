"""Hidden facts: beliefs, what is known, figures of trees, and what a tree cannot tell from them."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import pytest

import bbtc
from bbtc.artefacts.task_json import task_from_json, task_to_json
from bbtc.belief.hidden import belief_in
from bbtc.belief.simulate import simulate
from bbtc.belief.state import compile_action, initial_belief
from bbtc.belief.tree_task import tree_task
from bbtc.ground.condition import And, Is
from bbtc.ground.task import Observation, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.fully_observable import fully_observable
from bbtc.source import SourceFile
from tests.belief.hidden_tasks import part, search, tiger

LIMITS = Limits()
ACCURACY = Fraction(17, 20)


def test_a_reading_changes_what_is_believed_by_bayes_rule() -> None:
    task = tiger(ACCURACY)
    (start,) = initial_belief(task)
    assert belief_in(task, start, 0) == ((0, 1), (1, 1))
    listen = compile_action(task, task.action_by_name["listen()"], LIMITS)
    results = listen(start)
    assert [result.probability for result in results] == [Fraction(1, 2)] * 2
    assert {belief_in(task, result.values, 0) for result in results} == {((0, 3), (1, 17)), ((0, 17), (1, 3))}
    for result in results:  # a contrary reading takes it back
        assert start in {again.values for again in listen(result.values)}


def test_what_is_known_holds_in_all_worlds_that_are_left() -> None:
    task = search(3)
    (start,) = initial_belief(task)
    look = {place: compile_action(task, task.action_by_name[f"look({place})"], LIMITS) for place in range(3)}
    there, not_there = sorted(look[0](start), key=lambda result: result.probability)
    assert there.probability == Fraction(1, 3)
    assert list(there.values[:3]) == [Truth.TRUE, Truth.FALSE, Truth.FALSE]
    assert list(not_there.values[:3]) == [Truth.FALSE, Truth.UNKNOWN, Truth.UNKNOWN]
    last = max(look[1](not_there.values), key=lambda result: result.values[2])
    assert list(last.values[:3]) == [Truth.FALSE, Truth.FALSE, Truth.TRUE]  # nobody looked there


@pytest.mark.parametrize(
    ("looks", "best"), [(1, "0.85"), (2, "0.85"), (3, "0.93925"), (4, "0.93925"), (5, "0.973388125")]
)
def test_the_best_chance_after_some_readings(looks: int, best: str) -> None:
    """The right majority of readings: Σ over i > k/2 of C(k,i) qⁱ(1−q)ᵏ⁻ⁱ for odd k."""
    value = bbtc.bounds(tiger(ACCURACY), max_actions=looks + 1)
    assert value.lower == value.upper == Fraction(best)


@pytest.mark.parametrize(
    ("places", "looks", "best"), [(2, 3, Fraction(5, 8)), (3, 6, Fraction(3, 4)), (5, 7, Fraction(3, 5))]
)
def test_the_best_chance_to_find_a_thing(places: int, looks: int, best: Fraction) -> None:
    """1 − (1/n) Σ 2^−mᵢ, the looks spread evenly."""
    value = bbtc.bounds(search(places, Fraction(1, 2)), max_actions=looks + 1)
    assert value.lower == value.upper == best


@pytest.mark.parametrize(("believed", "difference"), [("0.85", 1), ("0.96", 2), ("0.99", 3), ("0.999", 4)])
def test_listening_until_it_is_believed(believed: str, difference: int) -> None:
    """A walk on the difference of readings: right with P = q^d/(q^d + (1−q)^d), d(2P − 1)/(2q − 1) steps."""
    q = ACCURACY
    right = q**difference / (q**difference + (1 - q) ** difference)
    plan = bbtc.plan(tiger(q, Fraction(believed)), target=Fraction(believed))
    assert plan.tree.success_probability == right
    assert plan.figures.cost == difference * (2 * right - 1) / (2 * q - 1) + 1  # a door is opened, too


@pytest.mark.parametrize("strategy", ["refine", "policy", "auto"])
@pytest.mark.parametrize("places", [1, 2, 4])
def test_looking_until_it_is_known(places: int, strategy: str) -> None:
    plan = bbtc.plan(search(places), strategy=strategy, target=1)
    assert plan.tree.success_probability == 1
    # 1, 2, …, n−1 looks, the last time for two places; then it is taken.
    looks = [*range(1, places), *([places - 1] if places > 1 else [0])]
    least = Fraction(sum(looks), places) + 1
    assert plan.figures.cost is not None
    assert plan.figures.cost >= least
    assert strategy == "refine" or plan.figures.cost == least
    assert bbtc.verify(plan).problems == ()


@pytest.mark.parametrize("task", [tiger(ACCURACY, Fraction(99, 100)), search(3)])
def test_a_tree_cannot_tell_the_task_made_for_it_from_its_own(task: Task) -> None:
    plan = bbtc.plan(task, target=Fraction(1, 2))
    low = tree_task(task, plan.tree.root, LIMITS)
    assert low.components == ()
    assert not any(action.changes for action in low.actions)
    own, other = (simulate(each, plan.tree.root, LIMITS) for each in (task, low))
    assert own == other
    verdict = bbtc.verify(plan)
    assert verdict.problems == ()
    assert verdict.own is not None
    assert verdict.own.success == plan.tree.success_probability


def test_what_is_told_before_the_first_action() -> None:
    task = search(2)
    (component,) = task.components
    told = replace(task, components=(replace(component, first=(Observation(Is(0, Truth.TRUE)),)),))
    belief = initial_belief(told)
    assert sorted(belief.values()) == [Fraction(1, 2)] * 2
    assert {tuple(values[:2]) for values in belief} == {(Truth.TRUE, Truth.FALSE), (Truth.FALSE, Truth.TRUE)}
    assert bbtc.bounds(told, costs=True).cost == 1


@pytest.mark.parametrize("task", [tiger(ACCURACY, Fraction(99, 100)), search(3, Fraction(1, 2))])
def test_a_task_with_hidden_facts_is_read_as_it_was_written(task: Task) -> None:
    assert task_from_json(json.loads(json.dumps(task_to_json(task)))) == task


def test_strategies_that_know_of_nothing_hidden_refuse() -> None:
    with pytest.raises(bbtc.BbtcError) as refused:
        bbtc.plan(search(2), strategy="strong-cyclic")
    assert [each.code for each in refused.value.diagnostics] == ["BBT0505"]


@pytest.mark.parametrize(("target", "difference"), [("0.85", 1), ("0.96", 2), ("0.99", 3), ("0.999", 4)])
def test_how_often_to_listen_is_found(target: str, difference: int) -> None:
    """What reads alike, but is believed more or less, is told apart by thresholds of the planner's own: one
    counts readings for either side."""
    q = ACCURACY
    plan = bbtc.plan(tiger(q), target=Fraction(target))
    assert plan.tree.success_probability == q**difference / (q**difference + (1 - q) ** difference)
    assert plan.tree.status == "target-reached"
    added = [v.predicate for v in plan.tree.task.variables if v.predicate.startswith("believed-")]
    assert added == ["believed-tiger"]
    assert bbtc.verify(plan).problems == ()


@pytest.mark.parametrize(("actions", "best"), [(0, "0.7"), (1, "0.7"), (2, "0.85"), (3, "0.901")])
def test_the_best_chance_to_stop_where_the_goal_is_true(actions: int, best: str) -> None:
    """Nothing makes the goal known. One reading and a turn: .7 · .85 + .3 · .85; without a turn left, .7. Of
    two readings, only both together turn it: .7 (1 − .15²) + .3 · .85²."""
    task = part(ACCURACY)
    assert bbtc.bounds(task, max_actions=actions + 1).upper == 0
    value = bbtc.bounds(task, max_actions=actions + 1, allow_guess=True)  # to stop is one
    assert value.lower == value.upper == Fraction(best)


@pytest.mark.parametrize("target", ["0.7", "0.9", "0.99"])
def test_a_tree_that_guesses_tells_how_often_it_is_mistaken(target: str) -> None:
    plan = bbtc.plan(part(ACCURACY), target=Fraction(target), allow_guess=True)
    assert plan.tree.status == "target-reached"
    figures = bbtc.simulate(plan)
    assert figures.success == plan.tree.success_probability >= Fraction(target)
    assert figures.success + figures.mistaken == 1
    assert (figures.mistaken == Fraction(3, 10)) == (target == "0.7")  # it stops at once
    names = {variable.predicate for variable in plan.tree.task.variables}
    assert names <= {"upside-down", "believed-upside-down"}
    assert {action.schema for action in plan.tree.task.actions} == {"turn", "weigh"}


def test_who_sees_the_world_does_no_worse() -> None:
    """A thing in one of two places, a hand that closes but once: 1/2 for who cannot look, 1 for who sees."""
    blind = search(2)
    grasps = tuple(
        replace(action, precondition=And((Is(2, Truth.FALSE), action.precondition)))
        for action in blind.actions
        if action.schema == "take"
    )
    blind = replace(blind, actions=grasps)
    assert bbtc.bounds(blind).upper == 0  # it is never known where it is
    seeing = fully_observable(blind)
    assert seeing is not None
    assert seeing.components == ()
    assert bbtc.bounds(seeing).lower == 1
    for task in (tiger(ACCURACY), search(3, Fraction(1, 2)), part(ACCURACY)):
        seeing = fully_observable(task)
        assert seeing is not None
        for actions in range(1, 5):
            best = bbtc.bounds(task, max_actions=actions).upper
            assert best <= bbtc.bounds(seeing, max_actions=actions).lower


def test_a_guess_is_allowed_where_hidden_facts_could_be_done_without() -> None:
    """Of a coin that nobody sees, heads are guessed half the time, or turned up for nothing."""
    text = SourceFile(
        "coin.pddl",
        "(define (domain coin) (:predicates (heads) (tails))"
        " (:action look :precondition (tails) :observe (heads)))"
        "(define (problem one) (:domain coin) (:init (oneof (heads) (tails))) (:goal (heads)))",
    )
    assert bbtc.bounds(text).upper == 0
    assert bbtc.bounds(text, allow_guess=True).upper == Fraction(1, 2)
    plan = bbtc.plan(text, target=Fraction(1, 2), allow_guess=True)
    assert plan.tree.success_probability == plan.figures.mistaken == Fraction(1, 2)


@pytest.mark.parametrize(("looks", "best"), [(2, "0.85"), (3, "0.93925"), (5, "0.973388125")])
def test_within_some_actions_the_majority_of_readings_counts(looks: int, best: str) -> None:
    plan = bbtc.plan(tiger(ACCURACY), target=Fraction(best), max_actions=looks + 1)
    assert plan.tree.success_probability == Fraction(best)
    added = {v.predicate for v in plan.tree.task.variables if v.predicate.startswith("believed-")}
    assert added == {"believed-tiger"}
    assert bbtc.verify(plan).problems == ()
