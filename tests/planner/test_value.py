"""The value of a task: the best any policy can do, without end, within a budget, at least cost."""

from __future__ import annotations

import itertools
import time
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given

from bbtc.belief.draws import Values
from bbtc.diagnostics import BbtcError, LimitReached
from bbtc.ground.condition import TRUE, And, Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Effort, Limits
from bbtc.markov import solve
from bbtc.planner.mdp.bounded_search import search_bounds
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.finite_horizon import horizon_values
from bbtc.planner.mdp.maxprob import Bounds, MaxProb, max_prob
from bbtc.planner.mdp.policy_iteration import Equations
from bbtc.planner.mdp.ssp import least_cost
from bbtc.planner.mdp.state_space import StateSpace
from tests.long_form import LONG, amount
from tests.planner.examples import Optimum, cases, corpus_optima
from tests.planner.test_refine import action, task
from tests.planner.test_space import by_simulator
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def solved(of: Task) -> MaxProb:
    return max_prob(explore_space(of, Limits()), Limits())


# --- known optima ----------------------------------------------------------------------------


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_cases_have_their_listed_values(case: Optimum) -> None:
    space = explore_space(case.task(), Limits())
    best = max_prob(space, Limits()).initial.exact
    assert best is not None
    assert float(best) == pytest.approx(case.best, abs=1e-9)
    within = horizon_values(space, 12, Limits())
    assert within.exact
    for budget, expected in case.within:
        # The list is rounded to six places.
        assert float(within.initial[budget].lower) == pytest.approx(expected, abs=6e-7)


def some() -> list[Optimum]:
    """All, or every other of those that take less than a second or two."""
    found = corpus_optima()[:: amount(2, 1)]
    return [each for each in found if LONG or not each.name.endswith("p06-x11-y11-h4-v3-u40-s6.pddl")]


@pytest.mark.parametrize("problem", some(), ids=lambda c: c.name)
def test_public_problems_have_their_listed_values(problem: Optimum) -> None:
    try:
        of = problem.task()
    except BbtcError as error:
        pytest.skip(f"does not load: {error.diagnostics[0].message}")
    start = time.process_time()
    space = explore_space(of, Limits())
    bounds = max_prob(space, Limits()).initial
    assert time.process_time() - start < 10
    assert float(bounds.lower) == pytest.approx(problem.best, abs=1e-6)
    assert float(bounds.upper) == pytest.approx(problem.best, abs=1e-6)
    start = time.process_time()
    searched = search_bounds(of, Limits()).bounds
    assert time.process_time() - start < 10
    assert float(searched.lower) == pytest.approx(problem.best, abs=1e-6)
    assert float(searched.upper) == pytest.approx(problem.best, abs=1e-6)
    within = horizon_values(space, 16, Limits())
    for budget, expected in problem.within:
        assert float(within.initial[budget].lower) == pytest.approx(expected, abs=1.01e-6)
        assert float(within.initial[budget].upper) == pytest.approx(expected, abs=1.01e-6)


# --- against the definition ------------------------------------------------------------------

Choices = dict[Values, dict[str, dict[Values, Fraction]]]


def choices_of(of: Task) -> Choices:
    """By state and action, the probabilities of the states after it: from the simulator's actions."""
    found: Choices = {}
    for values, results in by_simulator(of).items():
        found[values] = {}
        for (name, after, _, _), p in results.items():
            row = found[values].setdefault(name, {})
            row[after] = row.get(after, Fraction(0)) + p
    return found


def expectation(row: dict[Values, Fraction], value: dict[Values, Fraction]) -> Fraction:
    return sum((p * value[t] for t, p in row.items()), Fraction(0))


def after_steps(of: Task, choices: Choices, steps: int) -> dict[Values, Fraction]:
    """The best probability of having reached the goal within some steps, by recursion."""
    from bbtc.ground.condition import evaluate

    value = {s: Fraction(evaluate(of.goal, s) is T) for s in choices}
    for _ in range(steps):
        value = {
            s: max([value[s], *(expectation(row, value) for row in choices[s].values())]) for s in choices
        }
    return value


@examples(amount(70, 200))
@given(of=tasks())
def test_the_value_is_attained_by_its_policy_and_by_no_choice_exceeded(of: Task) -> None:
    """A value that a policy attains and that solves the optimality inequalities is P*."""
    found = solved(of)
    space, graph = found.space, found.graph
    assert found.initial.exact is not None
    values = [found.bounds(s).lower for s in range(graph.states)]
    policy_rows: list[dict[int, Fraction]] = []
    wins: list[Fraction] = []
    for state in range(graph.states):
        rows: dict[int, dict[int, Fraction]] = {}
        for choice in space.choices_of(np.array([state])).tolist():
            row = rows.setdefault(choice, {})
            for successor, draw in space.outcomes(choice):
                p = space.draws[draw].probability
                row[successor] = row.get(successor, Fraction(0)) + p
            expected = sum(p * values[t] for t, p in row.items())
            assert expected <= values[state]
            assert bool(found.best[choice]) == (values[state] > 0 and expected == values[state])
        if space.goal[state]:
            assert values[state] == 1
        chosen = {} if found.policy[state] < 0 else rows[int(found.policy[state])]
        wins.append(sum((p for t, p in chosen.items() if space.goal[t]), Fraction(0)))
        policy_rows.append({t: p for t, p in chosen.items() if not space.goal[t]})
    # Every state with positive value has a way to the goal, so the chain leaves all of its loops.
    positive = [s for s in range(graph.states) if values[s] and not space.goal[s]]
    number = {s: i for i, s in enumerate(positive)}
    rows_of = [{number[t]: p for t, p in policy_rows[s].items() if t in number} for s in positive]
    assert solve(rows_of, [wins[s] for s in positive]) == [values[s] for s in positive]


@examples(amount(35, 100))
@given(of=tasks())
def test_budgets_have_the_values_of_the_definition_and_approach_the_value(of: Task) -> None:
    choices = choices_of(of)
    space = explore_space(of, Limits())
    within = horizon_values(space, 8, Limits())
    values = space.packing.values(space.states)
    for steps in (0, 1, 3, 8):
        expected = after_steps(of, choices, steps)
        assert list(within.values[steps]) == [expected[v] for v in values]
    best = max_prob(space, Limits()).initial.exact
    assert best is not None
    assert all(a.lower <= b.lower for a, b in itertools.pairwise(within.initial))
    assert within.initial[8].lower <= best


@examples(amount(30, 60))
@given(of=tasks())
def test_bounds_from_floats_hold_the_exact_values(of: Task) -> None:
    exact = solved(of)
    space = exact.space
    floats = max_prob(space, Limits(), rationals=False)
    horizon = horizon_values(space, 5, Limits(), rationals=False)
    assert horizon.exact == (not len(space.edge_successor))
    for state in range(len(space.states)):
        known, close = exact.bounds(state), floats.bounds(state)
        assert close.lower <= known.lower <= close.upper
        assert close.upper - close.lower < 1e-8
    known_horizon = horizon_values(space, 5, Limits())
    for a, b in zip(known_horizon.initial, horizon.initial, strict=True):
        assert b.lower <= a.lower <= b.upper


def best_probability(space: StateSpace, limits: Limits) -> Bounds:
    """P* of the task; bounds where the space is incomplete."""
    low = max_prob(space, limits).initial
    if space.complete:
        return low
    return Bounds(low.lower, max_prob(space, limits, space.goal | space.fringe).initial.upper)


@examples(amount(35, 100))
@given(of=tasks())
def test_a_part_of_the_space_gives_bounds(of: Task) -> None:
    whole = explore_space(of, Limits())
    assume(len(whole.states) > 2)
    known = max_prob(whole, Limits()).initial.exact
    assert known is not None
    for depth in (0, 1, 2):
        bounds = best_probability(explore_space(of, Limits(), depth), Limits())
        assert bounds.lower <= known <= bounds.upper


@examples(amount(60, 150))
@given(of=tasks())
def test_the_least_cost_is_attained_and_by_no_choice_undercut(of: Task) -> None:
    found = solved(of)
    cheapest = least_cost(found, Limits())
    negative = any(found.space.draws[draw].cost < 0 for draw in set(found.space.edge_draw.tolist()))
    assert (cheapest is None) == negative
    if cheapest is None:
        return
    assert cheapest.exact
    space = found.space
    open_states = [s for s in range(len(space.states)) if not found.prob_0[s] and not space.goal[s]]
    number = {s: i for i, s in enumerate(open_states)}

    def row(choice: int) -> tuple[Fraction, dict[int, Fraction]]:
        cost, chances = Fraction(0), dict[int, Fraction]()
        for successor, drawn in space.outcomes(choice):
            draw = space.draws[drawn]
            cost += draw.probability * draw.cost
            if successor in number:
                chances[number[successor]] = chances.get(number[successor], Fraction(0)) + draw.probability
        return cost, chances

    own = [row(int(cheapest.policy[s])) for s in open_states]
    attained = solve([chances for _, chances in own], [cost for cost, _ in own])
    assert attained is not None
    for state, value in zip(open_states, attained, strict=True):
        assert cheapest.best[cheapest.policy[state]]
        for choice in space.choices_of(np.array([state])).tolist():
            if found.best[choice]:
                cost, chances = row(choice)
                total = cost + sum(p * attained[t] for t, p in chances.items())
                assert total >= value
                assert bool(cheapest.best[choice]) == (total == value)
    expected = sum((p * attained[number[s]] for p, s in space.initial if s in number), Fraction(0))
    assert cheapest.initial == expected


# --- by hand ---------------------------------------------------------------------------------


def test_a_loop_that_can_be_left_only_with_a_loss_is_not_worth_more_than_its_exit() -> None:
    """Two rooms one can go round in for ever (an end component), and one risky way out."""
    there, back = action("there", Is(0, F), ("1", {0: T})), action("back", Is(0, T), ("1", {0: F}))
    risk = action("risk", Is(2, F), ("1/3", {1: T, 2: T}), ("2/3", {2: T}))
    of = task("room won over", {}, Is(1, T), there, back, risk)
    assert solved(of).initial.exact == Fraction(1, 3)


def test_policy_iteration_leaves_a_poor_policy_for_the_best() -> None:
    """The shortest way wins half the time, a longer one nine times of ten; no guess in floats helps."""
    dash = action("dash", Is(2, F), ("1/2", {1: T}), ("1/2", {2: T}))
    prepare = action("prepare", Is(2, F), ("1", {0: T}))
    walk = action("walk", And((Is(0, T), Is(2, F))), ("9/10", {1: T}), ("1/10", {2: T}))
    found = solved(task("ready won over", {}, Is(1, T), dash, prepare, walk))
    assert found.initial.exact == Fraction(9, 10)
    part = ~found.prob_1 & ~found.prob_0
    shortest = found.graph.reach(found.prob_1).via.copy()
    start = found.space.initial[0][1]
    assert shortest[start] != found.policy[start]
    values = Equations(found.graph, part, found.prob_1).solve(shortest, Limits())
    assert values == [Fraction(9, 10)] * int(part.sum())
    assert shortest[start] == found.policy[start]


def test_what_hardly_ever_ends_costs_what_it_costs_and_takes_little_work() -> None:
    """In floats it never ends, and a search in floats would go on to its last sweep."""
    chance = Fraction(1, 10**20)
    of = task("open", {}, Is(0, T), action("try", TRUE, (str(chance), {0: T}), (str(1 - chance), {})))
    limits = Limits(effort=Effort(200))
    cheapest = least_cost(max_prob(explore_space(of, limits), limits), limits)
    assert cheapest is not None
    assert (cheapest.initial, cheapest.exact) == (10**20, True)


def test_a_task_whose_goal_nothing_reaches_has_the_value_0_and_costs_nothing() -> None:
    found = solved(task("a b", {}, Is(0, T), action("b", Is(1, F), ("1", {1: T}))))
    assert found.initial.exact == 0
    cheapest = least_cost(found, Limits())
    assert cheapest is not None
    assert cheapest.initial == 0


def test_initial_states_count_by_their_weight() -> None:
    import dataclasses

    from bbtc.ground.task import InitialState

    base = task("a", {}, Is(0, T))
    two = (InitialState(Fraction(1, 4), (T,)), InitialState(Fraction(3, 4), (F,)))
    assert solved(dataclasses.replace(base, initial=two)).initial.exact == Fraction(1, 4)


def test_no_time_left_is_a_limit() -> None:
    of = task("a", {}, Is(0, T), action("try", Is(0, F), ("1/2", {0: T}), ("1/2", {})))
    space = explore_space(of, Limits())
    late = Limits(seconds=1e-9)
    with pytest.raises(LimitReached):
        max_prob(space, late)


def test_a_large_loop_of_states_is_solved_exactly() -> None:
    """The gambler's ruin: from i of n, up or down by one with equal chance; value i/n."""
    n = 40
    rows = [{t: Fraction(1, 2) for t in (i - 1, i + 1) if 0 <= t < n - 1} for i in range(n - 1)]
    wins = [Fraction(1, 2) if i == n - 2 else Fraction(0) for i in range(n - 1)]
    assert solve(rows, wins) == [Fraction(i + 1, n) for i in range(n - 1)]
