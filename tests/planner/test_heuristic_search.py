"""The search that expands only what matters: its bounds hold the exact value, and meet."""

from __future__ import annotations

from fractions import Fraction
from itertools import count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.ground.condition import Is, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits, Stage
from bbtc.planner.mdp.bounded_search import search_bounds
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.h_add import Facts, Relaxation, operators_of
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.mdp.solve import best_known
from tests.long_form import LONG, amount
from tests.planner.examples import Optimum, cases, public
from tests.planner.journeys import journeys
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN
MANY = examples(amount(36, 5000))
"""Random tasks of one kind."""


SOME = st.one_of(journeys(), journeys(), tasks(nested=2, most_actions=6))
SMALL = 2
"""States that a step of the search expands, so that parts of small spaces remain open."""


@MANY
@given(of=SOME)
def test_the_bounds_of_random_tasks_hold_the_exact_value_and_meet(of: Task) -> None:
    known = max_prob(explore_space(of, Limits()), Limits()).initial.exact
    assert known is not None
    found = search_bounds(of, Limits(), step=SMALL)
    assert found.stop is None
    assert found.bounds.lower <= known <= found.bounds.upper
    assert found.bounds.upper - found.bounds.lower <= 1e-9
    assert found.lower.initial.lower == found.bounds.lower, "the policy attains the lower bound"


@MANY
@given(of=SOME)
def test_the_bounds_hold_wherever_the_search_is_stopped(of: Task) -> None:
    known = max_prob(explore_space(of, Limits()), Limits()).initial.exact
    assert known is not None
    for states in (1, 3, 6):
        found = search_bounds(of, Limits(states=states), step=SMALL)
        assert found.bounds.lower <= known <= found.bounds.upper
    target = Fraction(1, 2)
    told = search_bounds(of, Limits(), target, step=SMALL).bounds
    assert told.lower <= known <= told.upper
    assert (told.lower >= target) == (known >= target) or told.upper - told.lower < 1e-9
    assert told.lower >= target or told.upper - told.lower < 1e-9, "a target out of reach does not end it"
    verdict = search_bounds(of, Limits(), target, verdict=True, step=SMALL).bounds
    assert verdict.lower <= known <= verdict.upper
    assert verdict.lower >= target or verdict.upper < target or verdict.upper - verdict.lower < 1e-9


@MANY
@given(of=SOME, look=st.integers(4, 40))
def test_the_bounds_hold_whenever_the_search_is_interrupted(of: Task, look: int) -> None:
    known = max_prob(explore_space(of, Limits()), Limits()).initial.exact
    assert known is not None
    looks = count(1)  # the first three are in what comes before the search

    def watch(stage: Stage) -> None:
        if stage.doing == "the search for the best probability" and next(looks) == look:
            raise KeyboardInterrupt

    found = search_bounds(of, Limits(watcher=watch), step=SMALL)
    assert found.bounds.lower <= known <= found.bounds.upper
    assert found.lower.initial.lower >= found.bounds.lower, "the policy attains the lower bound"
    assert found.interrupted or found.bounds.upper - found.bounds.lower < 1e-9


class Rumour:
    """Advice without any knowledge of the task."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def decide(self, state: int) -> int | None:
        """Any action."""
        return (state * 31 + self.seed) % 7

    def forbids(self, state: int, action: int) -> bool:
        """Any of them."""
        return (state + 5 * action + self.seed) % 3 == 0


@MANY
@given(of=SOME, seed=st.integers(0, 1000))
def test_bad_advice_costs_time_and_nothing_else(of: Task, seed: int) -> None:
    known = max_prob(explore_space(of, Limits()), Limits()).initial.exact
    assert known is not None
    bounds = search_bounds(of, Limits(), advice=Rumour(seed), step=SMALL).bounds
    assert bounds.lower <= known <= bounds.upper
    assert bounds.upper - bounds.lower <= 1e-9


class Honest:
    """Advice that says which step of a long way comes next."""

    def decide(self, state: int) -> int | None:
        """Its number: those of the eight levers are lower."""
        return 8 + next(at for at in range(42) if not state >> at + 1 & 1) if state & 1 else None

    def forbids(self, state: int, action: int) -> bool:
        """Never."""
        return False


def test_advice_is_followed() -> None:
    """A long sure way, which any of eight levers bars, and a short risky one that starts where it does."""
    lost, levers = 41, range(42, 50)
    untouched = [Is(each, F) for each in (lost, *levers)]
    steps = [
        action(f"w{at:02}", conjunction([Is(at, T), Is(at + 1, F), *untouched]), ("1", {at + 1: T}))
        for at in range(40)
    ]
    pulls = [action(f"p{at}", conjunction([Is(1, F), Is(at, F)]), ("1", {at: T})) for at in levers]
    risk = action("x", conjunction([Is(1, F), Is(lost, F)]), ("1/2", {40: T}), ("1/2", {lost: T}))
    names = [f"s{at:02}" for at in range(41)] + ["t", *(f"v{at}" for at in levers)]
    of = task(" ".join(names), {0: T}, Is(40, T), *steps, *pulls, risk)
    advised, alone = search_bounds(of, Limits(), advice=Honest()), search_bounds(of, Limits())
    assert advised.bounds.exact == alone.bounds.exact == 1
    assert advised.space.expanded < 60
    assert alone.space.expanded > 200


@MANY
@given(of=tasks(nested=2, most_actions=6))
def test_what_the_heuristic_calls_a_dead_end_is_one(of: Task) -> None:
    space = explore_space(of, Limits())
    guess = Relaxation(of, Limits(), count_actions=True).estimate(space.packing, space.states)
    hopeless = max_prob(space, Limits()).prob_0
    assert not (guess == float("inf"))[~hopeless].any()
    assert ((guess == 0) | ~space.goal).all()


@MANY
@given(of=tasks(nested=2, most_actions=6))
def test_the_guess_for_many_states_at_a_time_is_that_for_each(of: Task) -> None:
    """By the equations of the additive heuristic, one state and one operator at a time."""
    space = explore_space(of, Limits())
    found = Relaxation(of, Limits(), count_actions=True)
    operators = [each for n, a in enumerate(of.actions) for each in operators_of(n, a.factors)]
    guesses = found.estimate(space.packing, space.states).tolist()
    for values, guess in zip(space.packing.values(space.states), guesses, strict=True):
        costs = [float("inf")] * (3 * len(values))
        for variable, value in enumerate(values):
            costs[3 * variable + value] = 0.0
        while True:
            before, facts = list(costs), Facts(np.array(costs))
            for operator in operators:
                needed = facts.cost(of.actions[operator.action].precondition)
                needed += 0.0 if operator.when is None else facts.cost(operator.when)
                for variable, value in operator.sets:
                    fact = 3 * variable + value
                    costs[fact] = min(costs[fact], needed + min(100, float(1 / operator.probability)))
            if costs == before:
                break
        assert guess == pytest.approx(Facts(np.array(costs)).cost(of.goal), rel=1e-5)
        weighed = Relaxation(of, Limits()).facts(values)
        assert np.isinf(weighed.costs[: len(costs)]).tolist() == np.isinf(costs).tolist()


def test_a_loop_that_can_be_left_only_with_a_loss_is_not_worth_more_than_its_exit() -> None:
    """Two rooms one can go round in for ever: an end component, in which optimism would stay."""
    there, back = action("there", Is(0, F), ("1", {0: T})), action("back", Is(0, T), ("1", {0: F}))
    risk = action("risk", Is(2, F), ("1/3", {1: T, 2: T}), ("2/3", {2: T}))
    of = task("room won over", {}, Is(1, T), there, back, risk)
    assert search_bounds(of, Limits(), step=SMALL).bounds.exact == Fraction(1, 3)


def test_a_loop_that_is_hardly_ever_left_does_not_hold_the_search_up() -> None:
    """Two states that lead to one another, and out of them once in five hundred times, for good or ill."""
    exits = (("0.001", {1: T}), ("0.001", {2: T}))
    there = action("there", conjunction([Is(0, F), Is(2, F)]), ("0.998", {0: T}), *exits)
    back = action("back", conjunction([Is(0, T), Is(2, F)]), ("0.998", {0: F}), *exits)
    of = task("room won over", {}, Is(1, T), there, back)
    bounds = search_bounds(of, Limits(), step=SMALL).bounds
    assert float(bounds.lower) == pytest.approx(0.5, abs=1e-6)
    assert float(bounds.upper) == pytest.approx(0.5, abs=1e-6)


def test_a_target_that_is_out_of_reach_does_not_end_the_search_unless_only_that_is_asked() -> None:
    """A toss decides at once that no policy reaches more than 1/2; then comes a long way."""
    alive = Is(1, F)
    toss = action("a-toss", conjunction([Is(0, F), alive]), ("1/2", {0: T}), ("1/2", {1: T}))
    steps = []
    for at in range(2, 30):
        before = [Is(each, T) for each in (0, *range(2, at))]
        steps.append(action(f"b{at:02}", conjunction([alive, *before]), ("9/10", {at: T}), ("1/10", {1: T})))
    of = task("won lost " + " ".join(f"s{at:02}" for at in range(2, 30)), {}, Is(29, T), toss, *steps)
    told = search_bounds(of, Limits(), Fraction(9, 10), verdict=True, step=SMALL)
    assert told.bounds.upper < Fraction(9, 10)
    found = search_bounds(of, Limits(), Fraction(9, 10), step=SMALL)
    assert float(found.bounds.lower) == pytest.approx(0.5 * 0.9**28, abs=1e-6)
    assert told.space.expanded < found.space.expanded


def test_a_goal_that_nothing_reaches_takes_no_expansion() -> None:
    found = search_bounds(task("a b", {}, Is(0, T), action("b", Is(1, F), ("1", {1: T}))), Limits())
    assert found.bounds.exact == 0
    assert found.space.expanded == 1
    assert len(found.space.states) == 1


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_cases_have_their_listed_values(case: Optimum) -> None:
    bounds = search_bounds(case.task(), Limits()).bounds
    assert float(bounds.lower) == pytest.approx(case.best, abs=1e-9)
    assert float(bounds.upper) == pytest.approx(case.best, abs=1e-9)


TRIANGLE = "ppddl/probfd-triangle-tireworld-ippc08"
BLOCKS = "ppddl/probfd-exploding-blocksworld-ippc08-fixed"


ELEVATORS = "ppddl/probfd-elevators-ippc04"
ROVERS = "ppddl/probfd-canadian-rovers-small"
ZENO = "ppddl/probfd-zenotravel-ippc08-unit-cost"


@pytest.mark.parametrize(
    ("folder", "problem", "best", "most"),
    [
        # The values are those that another planner (probfd) finds.
        (TRIANGLE, "p04", 1, 1_000),  # of 843,098 states
        (TRIANGLE, "p05", 1, 1_500),  # of some millions
        (TRIANGLE, "p10", 1, 3_000),
        (BLOCKS, "p02-n3-N5-s2", 0.36, 600),  # of 86,445
        (BLOCKS, "p03-n3-N6-s3", 0.6, 600),
        (BLOCKS, "p07-n7-N9-s7", 1, 2_500),
        (ELEVATORS, "p09", 1, 600),  # of 14,787
        (ROVERS, "p01-problem", 0.928, 600),  # of 1,631
        (ZENO, "p01-c4-p2-a2-s3846", 1, 300),  # of 309,296
        (ROVERS, "p10-problem", 0.928, 10_000),  # of 87,256
    ][: None if LONG else -1],
)
def test_little_of_a_large_space_is_expanded(folder: str, problem: str, best: float, most: int) -> None:
    found = search_bounds(public(folder, problem).task(), Limits())
    assert float(found.bounds.lower) == pytest.approx(best, abs=1e-6)
    assert float(found.bounds.upper) == pytest.approx(best, abs=1e-6)
    assert found.space.expanded < most


def test_a_space_above_the_limit_is_searched() -> None:
    of = public(TRIANGLE, "p05").task()
    best = best_known(of, Limits(states=50_000))
    assert best.stop is None
    assert best.bounds.exact == 1
    assert len(best.space.states) < 50_000


def test_a_search_that_meets_a_limit_still_bounds_the_value() -> None:
    of = public(BLOCKS, "p02-n3-N5-s2").task()
    found = search_bounds(of, Limits(states=300))
    assert found.stop is not None
    assert "300 states" in found.stop.message
    assert 0 <= found.bounds.lower <= Fraction(36, 100) <= found.bounds.upper <= 1
    assert found.bounds.lower > 0 or found.bounds.upper < 1, "it tells something"
    assert len(found.space.states) < 330
