"""The best policy that is known when planning ends is written as a tree, whatever ended it."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate, success_of
from bbtc.belief.soundness import violations
from bbtc.ground.condition import Is, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.mdp import solve
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.planner.synthesis import policy
from bbtc.planner.synthesis.decision_tree import decision_tree
from bbtc.planner.synthesis.permissive import likely_policy, likely_way, one_policy
from bbtc.rewrite.retry import longest_run
from tests.long_form import amount
from tests.planner.examples import public
from tests.planner.journeys import journey, journeys
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T, F = Truth.TRUE, Truth.FALSE
CLOSE = 1e-7
"""What rounding may take from a bound."""

MANY = examples(amount(21, 3000))
SOME = st.one_of(journeys(), journeys(), tasks(nested=2, most_actions=6))
STRATEGIES = ("policy", "strong-cyclic")


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """No space is small enough to be explored as a whole, and no policy for its tree to come last."""
    monkeypatch.setattr(solve, "FEW_STATES", 2)
    monkeypatch.setattr(policy, "LARGE_POLICY", 2)


def is_written(of: Task, plan: Plan) -> None:
    """The tree does what the plan says, and as much as is known to be possible."""
    tree = plan.tree
    figures = simulate(of, tree.root, Limits())
    assert figures.success == tree.success_probability == plan.figures.success
    assert violations(of, explore(of, tree.root, Limits())) == []
    if tree.bounds is not None:
        wanted = min(tree.bounds[0], tree.target)
        assert tree.success_probability >= wanted - CLOSE
        assert tree.success_probability > 0 or tree.bounds[0] == 0


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.usefixtures("searched")
@MANY
@given(of=SOME, states=st.integers(1, 12), target=st.sampled_from(["1", "1/3"]))
def test_whatever_limit_on_states_ends_planning(strategy: str, of: Task, states: int, target: str) -> None:
    limits = Limits(states=max(states, len(of.initial)))
    is_written(of, plan_task(of, Fraction(target), strategy, limits, lambda _: None))


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.usefixtures("searched")
@MANY
@given(of=SOME, looks=st.integers(1, 150))
def test_whenever_the_time_is_over(strategy: str, of: Task, looks: int) -> None:
    """By a clock that goes on by a hundredth of a second whenever it is looked at."""
    clock = itertools.count()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bbtc.limits.time", SimpleNamespace(monotonic=lambda: next(clock) / 100))
        limits = Limits(seconds=looks / 100, memory=None).since(0)
        plan = plan_task(of, Fraction(1), strategy, limits, lambda _: None)
    is_written(of, plan)


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.usefixtures("searched")
@MANY
@given(of=SOME)
def test_without_a_limit_it_is_the_best_there_is(strategy: str, of: Task) -> None:
    plan = plan_task(of, Fraction(1), strategy, Limits(), lambda _: None)
    is_written(of, plan)
    known = max_prob(explore_space(of, Limits()), Limits()).initial.exact
    assert known is not None
    assert float(plan.tree.success_probability) == pytest.approx(float(known), abs=CLOSE)
    assert plan.tree.status == ("target-reached" if plan.tree.success_probability == 1 else "out-of-reach")


# --- within a number of actions ----------------------------------------------------------------


def within(of: Task, budget: int, limits: Limits) -> None:
    plan = plan_task(of, Fraction(1), "policy", limits, lambda _: None, options=Options(max_actions=budget))
    is_written(of, plan)
    longest = longest_run(explore(of, plan.tree.root, Limits()))
    assert longest is not None
    assert longest <= budget


@MANY
@given(of=SOME, states=st.integers(1, 12), budget=st.integers(1, 9))
def test_whatever_limit_on_states_ends_planning_within_a_number_of_actions(
    of: Task, states: int, budget: int
) -> None:
    within(of, budget, Limits(states=max(states, len(of.initial))))


@MANY
@given(of=SOME, looks=st.integers(1, 60), budget=st.integers(1, 9))
def test_whenever_the_time_for_a_number_of_actions_is_over(of: Task, looks: int, budget: int) -> None:
    clock = itertools.count()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bbtc.limits.time", SimpleNamespace(monotonic=lambda: next(clock) / 100))
        within(of, budget, Limits(seconds=looks / 100, memory=None).since(0))


@MANY
@given(of=SOME, budget=st.integers(1, 9))
@example(of=journey(66272), budget=4)  # a sign that is still not read when the first phase ends
def test_what_is_written_in_haste_attains_the_best_within_a_number_of_actions(of: Task, budget: int) -> None:
    def over(*_: object) -> None:
        raise Limits.reached("it is over", "--time-limit")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(policy, "synthesize", over)
        patch.setattr(policy, "in_phases", over)
        within(of, budget, Limits())


@MANY
@given(of=SOME, budget=st.integers(1, 9))
def test_a_way_is_written_when_there_is_no_time_for_phases(of: Task, budget: int) -> None:
    def over(*_: object) -> None:
        raise Limits.reached("it is over", "--time-limit")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(policy, "phases", over)
        plan = plan_task(
            of, Fraction(1), "policy", Limits(), lambda _: None, options=Options(max_actions=budget)
        )
    assert plan.tree.bounds is not None
    assert plan.tree.success_probability > 0 or plan.tree.bounds[0] == 0
    longest = longest_run(explore(of, plan.tree.root, Limits()))
    assert longest is not None
    assert longest <= budget


def test_a_long_way_is_written_when_there_is_no_time_for_more() -> None:
    """A corridor of 80 doors, each of which jams with 1/100: no few states make a way to its end."""
    doors = [
        action(
            f"d{i:02}",
            conjunction([Is(i, T), Is(i + 1, F), Is(81, F)]),
            ("0.99", {i + 1: T}),
            ("0.01", {81: T}),
        )
        for i in range(80)
    ]
    of = task(" ".join(f"r{i:02}" for i in range(81)) + " stuck", {0: T}, Is(80, T), *doors)
    best = Fraction(99, 100) ** 80

    def over(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(policy, "best_multi_policy", over)
        plan = plan_task(of, Fraction(1), "policy", Limits(), lambda _: None)
    assert plan.tree.status == "interrupted"
    assert plan.tree.success_probability == best
    assert plan.tree.bounds == (best, best)


def test_a_search_for_the_least_cost_that_takes_too_long_costs_no_success(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def endless(*_: object) -> None:
        raise Limits.reached("it is over", "--time-limit")

    monkeypatch.setattr(policy, "best_multi_policy", endless)
    cheap = action("cheap", Is(0, F), ("1/2", {0: T}), ("1/2", {1: T}))
    sure = action("sure", Is(0, F), ("1", {0: T}))
    of = task("done lost", {}, Is(0, T), replace(cheap, precondition=conjunction([Is(0, F), Is(1, F)])), sure)
    assert plan_task(of, Fraction(1), "policy", Limits(), lambda _: None).tree.status == "target-reached"


# --- decision trees ----------------------------------------------------------------------------


@MANY
@given(of=SOME)
def test_a_decision_tree_does_what_the_policy_does(of: Task) -> None:
    found = max_prob(explore_space(of, Limits()), Limits())
    root = decision_tree(of, one_policy(found), Limits())
    chain = explore(of, root, Limits())
    assert violations(of, chain) == []
    assert success_of(chain) == found.initial.exact


@MANY
@given(of=SOME, most=st.integers(1, 4))
def test_a_tree_of_a_part_of_a_policy_ends_where_that_does(of: Task, most: int) -> None:
    found = max_prob(explore_space(of, Limits()), Limits())
    for part in (likely_policy(found, most), likely_way(found)):
        if part is not None:
            chain = explore(of, decision_tree(of, part, Limits()), Limits())
            assert violations(of, chain) == []
            assert len({state.values for state in chain.states}) <= len(part.goal)
    way = likely_way(found)
    assert (way is not None) == (found.initial.upper > 0)
    if way is not None:
        assert success_of(explore(of, decision_tree(of, way, Limits()), Limits())) > 0


# --- public problems ---------------------------------------------------------------------------


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize(
    ("folder", "problem", "best"),
    [
        ("ppddl/probfd-exploding-blocksworld-ippc08-fixed", "p03-n3-N6-s3", Fraction(3, 5)),
        ("ppddl/probfd-zenotravel-ippc08-unit-cost", "p01-c4-p2-a2-s3846", Fraction(1)),
        ("ppddl/probfd-search-and-rescue-ippc08-strips", "p01-z4", None),
    ],
)
def test_public_problems_whose_policies_once_were_lost(
    strategy: str, folder: str, problem: str, best: Fraction | None
) -> None:
    """With the values that another planner (probfd) finds."""
    of = public(folder, problem).task()
    tree = plan_task(of, Fraction(1), strategy, Limits(seconds=120), lambda _: None).tree
    assert float(tree.success_probability) == pytest.approx(0.753844 if best is None else best, abs=1e-6)
    assert tree.bounds == (tree.success_probability, tree.success_probability)
    assert tree.status == ("target-reached" if best == 1 else "out-of-reach")
