"""Trees that recover: from every state that actions lead to they attain the best there is, and their runs
are those of the cheapest among the best policies, beside value iteration, an interpreter and the solvers."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import figures
from bbtc.diagnostics import LimitReached
from bbtc.disturbance.perturbed import perturbed_runs
from bbtc.disturbance.recovery import recovery
from bbtc.ground.condition import FALSE, Is, Or
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import verify_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.guard import guarded
from bbtc.planner.recovering import recovering_tree
from bbtc.tree.nodes import ActionNode, ControlNode, Node
from tests.disturbance.reference import Exact, best_next, reachable
from tests.domains.problems import PROBLEMS, SHORTER, Problem, task_of
from tests.long_form import amount
from tests.planner.journeys import journey, journeys
from tests.planner.test_auto import told
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN
LARGE = ("service-robot", "hospital")


def tree_of(task: Task) -> Node:
    found = recovering_tree(task, Limits())
    assert found is not None
    return found.root


@examples(amount(50, 3000))
@given(of=st.one_of(journeys(), tasks(most_actions=4)))
@example(of=journey(20308515))  # runs of even the best policies take thousands of steps
def test_from_every_state_that_actions_lead_to_the_best_is_attained(of: Task) -> None:
    found = recovering_tree(of, Limits())
    states = reachable(of)
    if found is None or states is None:
        return
    # However long runs take: no policy does better than values that no action improves on.
    attained = Exact(of, found.root, 0.0, lambda state: []).ever(states)
    for state in states:
        assert attained[state] >= best_next(of, state, attained) - 1e-9


@examples(amount(50, 3000))
@given(of=st.one_of(journeys(), tasks(most_actions=4)))
def test_runs_are_the_cheapest_of_the_best(of: Task) -> None:
    found = recovering_tree(of, Limits())
    if found is None:
        return
    value = task_value(of, Limits(), costs=True)
    done = figures(of, found.root, explore(of, found.root, Limits()))
    assert done.success == value.lower == found.bounds.exact
    assert done.cost is not None
    assert value.cost is not None
    assert done.cost == pytest.approx(value.cost, abs=1e-9)


@pytest.mark.parametrize("problem", SHORTER, ids=str)
def test_trees_of_our_domains_recover(problem: Problem) -> None:
    of = task_of(problem)
    if of.endless_beliefs:
        pytest.skip("there is no end to what may be believed")
    large = problem.domain in LARGE and problem.name != "after-the-alarm"
    if (
        large or problem.name == "letter-upstairs"
    ):  # whose states, and those within events, exceed small limits
        pytest.skip("too many states for each")
    done, _ = told(problem)
    found = recovery(of, done.tree.root, Limits())
    assert (found.attained, found.missed) == (found.hopeful, 0)
    assert verify_tree(guarded(done).tree, Limits(), "own").problems == ()
    disturbed = perturbed_runs(of, done.tree.root, Fraction(1, 10), Limits(), runs=300)
    assert (disturbed.unready, disturbed.missed) == (0, 0)


def test_rules_need_no_test_where_the_guards_of_their_actions_tell() -> None:
    """From a to b to c, with a way back from c to a that nobody needs."""
    goes = [
        action("first", Is(0, T), ("9/10", {0: F, 1: T}), ("1/10", {})),
        action("second", Is(1, T), ("1", {1: F, 2: T})),
        action("back", Is(2, T), ("1", {2: F, 0: T})),
    ]
    of = task("a b c", {0: T}, Is(2, T), *goes)
    root = tree_of(of)
    assert isinstance(root, ControlNode)
    found = [rule for rule in root.children if isinstance(rule, ActionNode) and rule.guarded]
    assert {rule.action for rule in found} == {"first()", "second()"}
    assert len(root.children) == 1 + len(found)


def test_rules_that_are_fine_alone_do_not_lead_in_circles() -> None:
    """From three places one may cross a river or walk round it, and across it go back or wade on. To cross is
    nearly as good as to walk, and to go back nearly as good as to wade on; but both together never end."""
    places = (2, 3, 4)
    gone: dict[int, Truth] = dict.fromkeys(places, F)
    here = Or(tuple(Is(place, T) for place in places))
    slips = [action(f"slip{place}", Is(0, T), ("1", {0: F, place: T})) for place in places]
    cross = action("cross", here, ("1", {**gone, 5: T}))
    back = action("back", Is(5, T), ("1", {5: F, 2: T}))
    around = replace(action("walk", here, ("1", {**gone, 1: T})), cost=Fraction(3))
    wade = replace(action("wade", Is(5, T), ("1", {5: F, 1: T})), cost=Fraction(17, 5))
    go = action("go", Is(0, T), ("1", {0: F, 1: T}))
    of = task("start done a b c over", {0: T}, Is(1, T), cross, back, around, wade, go, *slips)
    root = recovering_tree(of, Limits())
    assert root is not None
    states = reachable(of)
    assert states is not None
    exact = Exact(of, root.root, 0.0, lambda state: [])
    assert {exact.chances(100, state)["success"] for state in states} == {1}


def test_where_only_others_can_help_it_tries_again() -> None:
    """A door that others have locked cannot be opened; pulling at it goes on until they unlock it."""
    pull = action("pull", Is(0, F), ("1/2", {1: T}), ("1/2", {}))
    lock = action("lock", Is(1, T), ("1", {0: T, 1: F}))
    knock = action("knock", Is(0, T), ("1", {2: T}))
    of = task("locked open heard", {}, Is(1, T), pull, lock, knock)
    root = tree_of(of)
    tried = perturbed_runs(of, root, Fraction(1, 5), Limits(), runs=500)
    assert tried.success == 1


def test_nothing_is_done_where_nothing_helps() -> None:
    of = task("a", {}, FALSE, action("vain", Is(0, F), ("1", {0: T})))
    root = tree_of(of)
    assert figures(of, root, explore(of, root, Limits())).cost == 0


def test_more_states_than_allowed_are_a_limit() -> None:
    (problem,) = [each for each in PROBLEMS if str(each) == "charging/night-round"]
    with pytest.raises(LimitReached):
        recovering_tree(task_of(problem), Limits(states=10))
