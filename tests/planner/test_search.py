"""The strategy `search`: refinements it backs out of, orders it finds, and what it promises."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import TRUE, Is, Or, conjunction
from bbtc.ground.task import Effect, Factor, GroundAction, Outcome, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.options import Options, Retries
from bbtc.planner.result import Plan
from bbtc.rewrite.simplify import size
from bbtc.tree.nodes import actions_of, retries_of
from bbtc.tree.validate import check_tree
from tests.planner.examples import Optimum, cases
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN

RETRIES: list[Retries] = ["least", "unbounded"]
UNBOUNDED = Options(retries="unbounded")


def plan(of: Task, target: str, options: Options = UNBOUNDED, limits: Limits | None = None) -> Plan:
    return plan_task(of, Fraction(target), "search", limits or Limits(), lambda _: None, options=options)


def test_preconditions_are_achieved_before_the_action() -> None:
    boil = action("boil", Is(1, T), ("1", {0: T}))
    plug = action("plug", Is(2, T), ("1", {1: T}))
    unlock = action("unlock", Is(2, F), ("1", {2: T}))
    done = plan(task("hot plugged unlocked", {}, Is(0, T), boil, plug, unlock), "1")
    assert [step.inserted for step in done.refinements] == ["boil()", "plug()", "unlock()"]
    assert (done.tree.success_probability, done.figures.actions) == (1, 3)


def test_an_insertion_that_leads_into_a_dead_end_is_backed_out_of() -> None:
    """To jump looks best at first, but who falls stays down; the ladder takes two steps."""
    across, up, fallen = 0, 1, 2
    done = plan(
        task(
            "across up fallen",
            {},
            Is(across, T),
            action("jump", Is(fallen, F), ("0.8", {across: T}), ("0.2", {fallen: T})),
            action("climb", conjunction([Is(up, F), Is(fallen, F)]), ("0.5", {up: T}), ("0.5", {})),
            action("cross", conjunction([Is(up, T), Is(fallen, F)]), ("0.5", {across: T}), ("0.5", {})),
        ),
        "0.95",
    )
    assert done.tree.status == "target-reached"
    assert "jump()" not in {node.action for node in actions_of(done.tree.root)}


def test_an_insertion_that_leads_into_a_dead_end_will_do_where_the_target_allows() -> None:
    jump = action("jump", Is(1, F), ("0.8", {0: T}), ("0.2", {1: T}))
    done = plan(task("across fallen", {}, Is(0, T), jump), "0.8")
    assert (done.tree.status, size(done.tree.root)) == ("target-reached", 3)
    assert done.tree.success_probability == Fraction("0.8")


def test_goals_that_undo_one_another_are_put_into_order() -> None:
    """To fetch the tea the door must be open; in the end it must be shut (it is at the start)."""
    shut, tea = 0, 1
    done = plan(
        task(
            "shut tea",
            {shut: T},
            conjunction([Is(shut, T), Is(tea, T)]),
            action("open", TRUE, ("1", {shut: F})),
            action("close", Is(shut, F), ("1", {shut: T})),
            action("fetch", conjunction([Is(tea, F), Is(shut, F)]), ("1", {tea: T})),
        ),
        "1",
    )
    assert (done.tree.status, done.figures.actions) == ("target-reached", 3)


def test_what_an_action_leaves_unknown_is_observed_and_tried_again() -> None:
    held = 0
    grasp = action("grasp", Is(held, F), ("1", {held: U}))
    check = action("check", Is(held, U), ("0.2", {held: T}), ("0.8", {held: F}))
    of = task("held", {}, Is(held, T), grasp, check)
    done = plan(of, "0.488")
    assert (done.tree.success_probability, len(list(actions_of(done.tree.root)))) == (1, 2)
    bounded = plan(of, "0.488", Options(retries="least"))
    assert [attempts for _, attempts in retries_of(bounded.tree.root)] == [6]  # three rounds of two
    assert bounded.tree.success_probability == Fraction("0.488")


def test_a_disjunction_that_no_action_achieves_whole_is_split() -> None:
    goal = Or((conjunction([Is(0, T), Is(1, T)]), conjunction([Is(2, T), Is(3, T)])))
    make = [action(f"make-{name}", TRUE, ("1", {index: T})) for index, name in enumerate("abc")]
    done = plan(task("a b c d", {}, goal, *make), "1")
    assert (done.tree.status, done.tree.success_probability) == ("target-reached", 1)


def test_a_guard_of_an_effect_becomes_a_precondition() -> None:
    press = GroundAction(
        "press", (), TRUE, (Factor((Outcome(Fraction(1), (Effect(Is(1, T), ((0, T),)),)),)),)
    )
    done = plan(task("on power", {}, Is(0, T), press, action("plug", Is(1, F), ("1", {1: T}))), "1")
    assert (done.tree.status, done.tree.success_probability) == ("target-reached", 1)


def test_what_cannot_be_reached_is_not_searched_for() -> None:
    done = plan(task("a b", {}, Is(0, T), action("make", Is(1, T), ("1", {0: T}))), "0.5")
    assert (done.tree.status, done.refinements) == ("out-of-reach", ())


def test_a_number_of_actions_is_refused() -> None:
    with pytest.raises(BbtcError) as refused:
        plan(task("a", {0: T}, Is(0, T)), "1", Options(max_actions=2))
    assert [each.code for each in refused.value.diagnostics] == ["BBT0503"]


@pytest.mark.parametrize("case", cases(), ids=lambda c: c.name)
def test_cases_are_solved_soundly(case: Optimum) -> None:
    done = plan(case.task(), str(Fraction(case.best).limit_denominator(10**6)))
    assert done.tree.success_probability <= Fraction(case.best) + Fraction(1, 10**9)


@examples(120)
@given(of=tasks(), target=st.sampled_from(["0.5", "0.9", "1"]), retries=st.sampled_from(RETRIES))
def test_every_plan_of_a_random_task_ends_soundly(of: Task, target: str, retries: Retries) -> None:
    done = plan(of, target, Options(retries=retries), Limits(nodes=120, states=3000))
    tree = done.tree
    check_tree(tree)
    assert violations(of, explore(of, tree.root, Limits())) == []
    assert simulate(of, tree.root, Limits()).success == tree.success_probability
    assert (tree.status == "target-reached") == (tree.success_probability >= Fraction(target))
    assert all(not node.latched for node in actions_of(tree.root))


def test_goals_are_put_into_order_by_what_the_guards_of_effects_need() -> None:
    """The tea is at hand once it is fetched with the door open; in the end the door must be shut."""
    shut, tea = 0, 1
    carried = Effect(Is(shut, F), ((tea, T),))
    fetch = GroundAction("fetch", (), Is(tea, F), (Factor((Outcome(Fraction(1), (carried,)),)),))
    done = plan(
        task(
            "shut tea",
            {shut: T},
            conjunction([Is(shut, T), Is(tea, T)]),
            action("open", TRUE, ("1", {shut: F})),
            action("close", Is(shut, F), ("1", {shut: T})),
            fetch,
        ),
        "1",
    )
    assert (done.tree.status, done.figures.actions) == ("target-reached", 3)
