"""The strategy `policy`: trees that attain the best probability, at the least cost."""

from __future__ import annotations

import dataclasses
import random
import time
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is, Or, conjunction
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.finite_horizon import horizon_values
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.mdp.ssp import least_cost
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.planner.synthesis.permissive import likely_policy
from bbtc.planner.synthesis.rules import Literal, Rule
from bbtc.planner.synthesis.rules import Test as ValueTest
from bbtc.planner.synthesis.tree import _Builder
from bbtc.rewrite.retry import longest_run
from bbtc.tree.nodes import ActionNode, ControlNode, Node, retries_of, walk
from bbtc.tree.validate import check_tree
from tests.long_form import amount
from tests.planner.examples import Optimum, cases, corpus_optima
from tests.planner.journeys import journey, journeys
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


UNBOUNDED, LEAST = Options(retries="unbounded"), Options(retries="least")


def plan(
    of: Task, target: str | None = None, limits: Limits | None = None, options: Options = UNBOUNDED
) -> Plan:
    wanted = None if target is None else Fraction(target)
    return plan_task(of, wanted, "policy", limits or Limits(), lambda _: None, options=options)


def size(of: Plan) -> int:
    return sum(1 for _ in walk(of.tree.root))


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_cases_are_solved_at_their_best(case: Optimum) -> None:
    done = plan(case.task())
    assert done.tree.status == "target-reached"
    assert float(done.tree.success_probability) == pytest.approx(case.best, abs=1e-9)
    assert size(done) <= 11


@pytest.mark.parametrize("problem", corpus_optima()[amount(1, 0) :: amount(2, 1)], ids=lambda c: c.name)
def test_public_problems_are_solved_at_their_best(problem: Optimum) -> None:
    try:
        of = problem.task()
    except BbtcError as error:
        pytest.skip(f"does not load: {error.diagnostics[0].message}")
    start = time.process_time()
    done = plan(of)
    assert time.process_time() - start < 10
    assert float(done.tree.success_probability) == pytest.approx(problem.best, abs=1e-6)
    assert (done.tree.status == "target-reached") == (done.tree.success_probability >= of.goal_probability)
    assert size(done) < 150


@examples(amount(70, 300))
@given(of=tasks())
def test_random_tasks_are_solved_at_their_best_and_least_cost(of: Task) -> None:
    done = plan(of, "1")
    tree = done.tree
    check_tree(tree)
    chain = explore(of, tree.root, Limits())
    assert violations(of, chain) == []
    found = max_prob(explore_space(of, Limits()), Limits())
    assert tree.success_probability == simulate(of, tree.root, Limits()).success == found.initial.exact
    assert tree.status == ("target-reached" if tree.success_probability == 1 else "out-of-reach")
    assert tree.bounds == (tree.success_probability, tree.success_probability)
    assert done.figures.endless == 0
    cheapest = least_cost(found, Limits())
    if cheapest is not None:
        assert done.figures.cost == cheapest.initial


# --- within a number of actions ----------------------------------------------------------------


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_cases_are_solved_at_their_best_within_every_budget(case: Optimum) -> None:
    of = case.task()
    for budget, expected in case.within:
        done = plan(of, "1", options=Options(max_actions=budget))
        assert float(done.tree.success_probability) == pytest.approx(expected, abs=6e-7)
        assert done.tree.bounds == (done.tree.success_probability, done.tree.success_probability)
        longest = longest_run(explore(of, done.tree.root, Limits()))
        assert longest is not None
        assert longest <= budget
        assert size(done) <= 11


@examples(amount(50, 200))
@given(of=st.one_of(journeys(), tasks()), budget=st.integers(0, 6))
@example(of=journey(92), budget=3)  # what nothing helps any more comes to the last phase, too
def test_random_tasks_are_solved_at_their_best_within_a_budget(of: Task, budget: int) -> None:
    done = plan(of, "1", options=Options(max_actions=budget))
    chain = explore(of, done.tree.root, Limits())
    check_tree(done.tree)
    assert violations(of, chain) == []
    expected = horizon_values(explore_space(of, Limits(), budget), budget, Limits()).initial[budget].exact
    assert done.tree.success_probability == expected
    longest = longest_run(chain)
    assert longest is not None
    assert longest <= budget


def test_the_best_choice_may_change_as_the_budget_runs_out() -> None:
    """A slow sure way takes three steps and ends where it began if it is broken off; a risky one
    takes one. With four steps left one can still try the risky way once and then take the slow."""
    risky = action("risky", conjunction([Is(1, F), Is(2, F)]), ("1/2", {0: T}), ("1/2", {}))
    first = action("slow-1", conjunction([Is(1, F), Is(2, F)]), ("1", {1: T}))
    second = action("slow-2", Is(1, T), ("1", {1: F, 2: T}))
    third = action("slow-3", Is(2, T), ("9/10", {0: T}), ("1/10", {2: F}))
    of = task("won first second", {}, Is(0, T), risky, first, second, third)
    for budget in range(1, 8):
        done = plan(of, "1", options=Options(max_actions=budget))
        expected = horizon_values(explore_space(of, Limits()), budget, Limits()).initial[budget].exact
        assert done.tree.success_probability == expected


# --- how often to try again --------------------------------------------------------------------


def test_an_action_is_tried_as_often_as_the_target_takes() -> None:
    again = action("again", Is(0, F), ("1/2", {0: T}), ("1/2", {}))
    of = task("a", {}, Is(0, T), again)
    done = plan(of, "0.9", options=LEAST)
    assert [attempts for _, attempts in retries_of(done.tree.root)] == [4]
    assert done.tree.success_probability == 1 - Fraction(1, 2) ** 4
    assert list(retries_of(plan(of, "0.9", options=UNBOUNDED).tree.root)) == []


def test_where_no_number_of_tries_is_enough_there_is_no_bound() -> None:
    again = action("again", Is(0, F), ("1/2", {0: T}), ("1/2", {}))
    done = plan(task("a", {}, Is(0, T), again), "1", options=LEAST)
    assert (done.tree.status, done.tree.success_probability) == ("target-reached", 1)
    assert list(retries_of(done.tree.root)) == []


@examples(amount(35, 150))
@given(of=tasks(), target=st.sampled_from(["1/3", "0.9", "0.999"]))
def test_one_attempt_less_would_miss_the_target(of: Task, target: str) -> None:
    done = plan(of, target, options=LEAST)
    best = max_prob(explore_space(of, Limits()), Limits()).initial.exact
    assert best is not None
    assert done.tree.success_probability <= best
    assert (done.tree.status == "target-reached") == (best >= Fraction(target))
    for node, attempts in retries_of(done.tree.root):
        if attempts > 1:
            fewer = _with_attempts(done.tree.root, node.id, attempts - 1)
            assert simulate(of, fewer, Limits()).success < Fraction(target)


def _with_attempts(node: Node, place: str, attempts: int) -> Node:
    if not isinstance(node, ControlNode):
        return node
    children = tuple(_with_attempts(child, place, attempts) for child in node.children)
    bound = attempts if node.id == place else node.attempts
    return dataclasses.replace(node, children=children, attempts=bound)


# --- by hand -----------------------------------------------------------------------------------


def test_actions_that_cost_nothing_do_not_run_in_circles() -> None:
    there, back = action("a-there", Is(0, F), ("1", {0: T})), action("b-back", Is(0, T), ("1", {0: F}))
    win = action("c-win", Is(0, T), ("1", {1: T}))
    free = [dataclasses.replace(a, cost=Fraction(0)) for a in (there, back, win)]
    done = plan(task("room won", {}, Is(1, T), *free))
    assert (done.tree.status, done.figures.actions) == ("target-reached", 2)


def test_an_unknown_goal_is_looked_at_before_it_is_worked_on() -> None:
    look = action("look", Is(0, U), ("1/2", {0: T}), ("1/2", {0: F}))
    push = action("push", Is(0, F), ("9/10", {0: T}), ("1/10", {}))
    done = plan(task("door-open", {0: U}, Is(0, T), look, push))
    assert done.tree.success_probability == 1
    assert size(done) == 5


def test_an_unknown_part_of_a_goal_does_not_hide_a_false_one() -> None:
    """While `a` is unknown, `b` can be worked on; only then `a` can be looked at."""
    fix = action("fix", Is(1, F), ("1", {1: T}))
    look = action("look", conjunction([Is(0, U), Is(1, T)]), ("1/2", {0: T}), ("1/2", {0: F}))
    push = action("push", Is(0, F), ("1", {0: T}))
    done = plan(task("a b", {0: U}, conjunction([Is(0, T), Is(1, T)]), fix, look, push))
    assert done.tree.success_probability == 1


def test_a_hopeless_state_ends_the_run() -> None:
    """A disjunctive goal, and a trap: the tree fails there instead of running on."""
    risk = action("risk", Is(2, F), ("1/2", {0: T}), ("1/2", {2: T}))
    idle = action("idle", Is(2, T), ("1/2", {3: T}), ("1/2", {3: F}))
    done = plan(task("a b trap x", {}, Or((Is(0, T), Is(1, T))), risk, idle))
    assert (done.figures.success, done.figures.failure, done.figures.endless) == (
        Fraction(1, 2),
        Fraction(1, 2),
        0,
    )
    assert {node.action for node in walk(done.tree.root) if isinstance(node, ActionNode)} == {"risk()"}


def test_a_limit_leaves_the_best_that_was_found() -> None:
    switches = [action(f"on-{name}", Is(i, F), ("1", {i: T})) for i, name in enumerate("abcdefgh")]
    of = task("a b c d e f g h", {}, conjunction([Is(i, T) for i in range(8)]), *switches)
    done = plan(of, "1", Limits(states=30))
    assert (done.tree.status, done.tree.bounds) == ("limit-reached", (0, 1))
    assert done.stop is not None
    done = plan(of, "1", Limits(nodes=3))
    assert done.stop is not None
    assert "nodes" in done.stop.message


def test_many_rules_that_share_little_take_a_bounded_time_to_write_down() -> None:
    """To try every run of rules that share a test, and again within and beside it, never ended."""
    names, drawn = "a b c d e f g h i j k l m n o p", random.Random(1)
    acts = [action(f"act{number}", Is(0, F), ("1", {0: T})) for number in range(80)]
    of = task(names, {}, Is(0, T), *acts)
    values = np.array([[drawn.choice((0, 2)) for _ in names.split()] for _ in range(400)], dtype=np.uint8)
    rules, asked = [], np.arange(len(values))
    for number in range(len(acts)):
        chosen = sorted(drawn.sample(range(values.shape[1]), 8))
        tests = tuple(Literal(variable, drawn.choice(list(ValueTest)[:2])) for variable in chosen)
        rules.append(Rule(tests, number, asked))
        asked = asked[~np.logical_and.reduce([test.holds(values[asked]) for test in tests])]
    start = time.process_time()
    nodes = _Builder(of, values, Limits()).rules(rules)
    assert time.process_time() - start < 20
    assert [each.action for node in nodes for each in walk(node) if isinstance(each, ActionNode)] == [
        each.name for each in of.actions
    ]


def test_of_a_large_policy_the_states_most_often_visited_come_first() -> None:
    """A walk of ten steps, each of which slips off its way with 1/10: the first states are the likeliest."""
    steps = [
        action(
            f"step{i}",
            conjunction([Is(i, T), Is(i + 1, F), Is(11, F)]),
            ("9/10", {i + 1: T}),
            ("1/10", {11: T}),
        )
        for i in range(10)
    ]
    of = task("a b c d e f g h i j k off", {0: T}, Is(10, T), *steps)
    found = max_prob(explore_space(of, Limits()), Limits())
    assert likely_policy(found, 100) is None, "all fit"
    draft = likely_policy(found, 4)
    assert draft is not None
    assert sorted(of.actions[number].name for number in draft.choice_action) == [
        "step0()", "step1()", "step2()", "step3()"
    ]  # fmt: skip
