"""The planner `refine`: always ends, is sound, and says truly what it reached."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.belief.soundness import violations
from bbtc.ground.condition import TRUE, And, Condition, Is, Or, conjunction
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.chaining.refine import refine
from bbtc.planner.result import Plan
from bbtc.tree.nodes import ActionNode, walk
from bbtc.tree.validate import check_tree
from tests.ground.examples import task_of
from tests.profiles import examples
from tests.strategies import tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def action(name: str, needs: Condition, *outcomes: tuple[str, dict[int, Truth]]) -> GroundAction:
    """An action whose outcomes are (probability, values set)."""
    drawn = tuple(
        Outcome(Fraction(p), (Effect(None, tuple(sets.items())),) if sets else ()) for p, sets in outcomes
    )
    return GroundAction(name, (), needs, (Factor(drawn),))


def task(names: str, start: dict[int, Truth], goal: Condition, *actions: GroundAction) -> Task:
    """A task over variables named by single words, all false unless ``start`` says otherwise."""
    variables = tuple(Variable(name, (), three_valued=True) for name in names.split())
    values = tuple(start.get(index, F) for index in range(len(variables)))
    ordered = tuple(sorted(actions, key=lambda a: a.name))
    return Task("test", "test", variables, (InitialState(Fraction(1), values),), goal, ordered)


def plan(of: Task, target: str, **limits: Any) -> Plan:
    return refine(of, Fraction(target), Limits(**limits), lambda _: None)


def test_a_goal_that_holds_needs_nothing() -> None:
    done = plan(task("a", {0: T}, Is(0, T)), "1")
    assert (done.tree.status, done.tree.success_probability, done.refinements) == ("target-reached", 1, ())


def test_preconditions_are_achieved_before_the_action() -> None:
    boil = action("boil", Is(1, T), ("1", {0: T}))
    plug = action("plug", Is(2, T), ("1", {1: T}))
    unlock = action("unlock", Is(2, F), ("1", {2: T}))
    done = plan(task("hot plugged unlocked", {}, Is(0, T), boil, plug, unlock), "1")
    assert [step.inserted for step in done.refinements] == ["boil()", "plug()", "unlock()"]
    assert done.tree.success_probability == 1
    assert done.figures.actions == 3


def test_a_threat_moves_the_branch_that_undoes_the_goal() -> None:
    """To fetch the tea the door must be open; in the end it must be shut (it is at the start)."""
    shut, tea = 0, 1
    done = plan(
        task(
            "shut tea",
            {shut: T},
            conjunction([Is(shut, T), Is(tea, T)]),
            action("open", conjunction([]), ("1", {shut: F})),
            action("close", Is(shut, F), ("1", {shut: T})),
            action("fetch", conjunction([Is(tea, F), Is(shut, F)]), ("1", {tea: T})),
        ),
        "1",
    )
    assert done.tree.status == "target-reached"
    assert [step.kind for step in done.refinements].count("move") == 1


def test_an_action_that_needs_what_is_wanted_does_not_achieve_it() -> None:
    """Though it would, each time, where that holds already."""
    boil = action("boil", TRUE, ("1/4", {0: T}), ("3/4", {}))
    reheat = action("reheat", Is(0, T), ("1", {0: T}))
    done = plan(task("hot", {}, Is(0, T), boil, reheat), "7/16")
    assert [step.inserted for step in done.refinements] == ["boil()", "boil()"]
    assert done.tree.success_probability == Fraction(7, 16)


def test_an_actuation_with_an_unknown_result_is_checked_after() -> None:
    """The paper's table on grasping: the grasp leaves the goal unknown, a check tells."""
    held = 0
    grasp = action("grasp", Is(held, F), ("1", {held: U}))
    check = action("check", Is(held, U), ("0.2", {held: T}), ("0.8", {held: F}))
    done = plan(task("held", {}, Is(held, T), grasp, check), "0.488")
    # Three rounds of grasp and check: 1 - 0.8 ** 3.
    assert done.tree.success_probability == Fraction("0.488")
    assert [step.inserted for step in done.refinements] == ["grasp()", "check()"] * 3


def test_a_side_action_breaks_a_cycle_of_preconditions() -> None:
    make_a = action("make-a", Is(1, T), ("1", {0: T}))
    make_b = action("make-b", Is(0, T), ("1", {1: T}))
    try_b = action("try-b", Is(1, F), ("0.5", {1: T}), ("0.5", {}))
    done = plan(task("a b", {}, Is(0, T), make_a, make_b, try_b), "0.99")
    assert done.tree.status == "target-reached"
    assert done.tree.success_probability == 1 - Fraction(1, 2) ** 7
    started = {node.action for node in walk(done.tree.root) if isinstance(node, ActionNode)}
    assert "make-b()" not in started, "an attempt that never starts must not stay in the tree"


def test_nothing_left_to_insert_is_stuck_with_the_best_tree() -> None:
    once = action("try", Is(1, T), ("0.5", {0: T, 1: F}), ("0.5", {1: F}))
    done = plan(task("goal available", {1: T}, Is(0, T), once), "0.9")
    assert (done.tree.status, done.tree.success_probability) == ("stuck", Fraction(1, 2))


def test_a_disjunction_that_no_action_achieves_whole_is_split() -> None:
    goal = Or((conjunction([Is(0, T), Is(1, T)]), conjunction([Is(2, T), Is(3, T)])))
    make = [action(f"make-{name}", conjunction([]), ("1", {index: T})) for index, name in enumerate("abc")]
    done = plan(task("a b c d", {}, goal, *make), "1")
    assert (done.tree.status, done.tree.success_probability) == ("target-reached", 1)


def test_a_guard_of_an_effect_becomes_a_precondition() -> None:
    press = GroundAction(
        "press", (), conjunction([]), (Factor((Outcome(Fraction(1), (Effect(Is(1, T), ((0, T),)),)),)),)
    )
    done = plan(task("on power", {}, Is(0, T), press, action("plug", Is(1, F), ("1", {1: T}))), "1")
    assert (done.tree.status, done.tree.success_probability) == ("target-reached", 1)


def test_every_template_that_only_calls_another_one_shows_as_a_node_of_its_own() -> None:
    of = task_of("""(define (domain lamp) (:predicates (lit))
      (:action press :precondition (not (lit)) :effect (lit))
      (:template inner :body (press))
      (:template middle :body (inner))
      (:template outer :precondition (not (lit)) :effect (lit) :body (middle)))
    (define (problem dark) (:domain lamp) (:init) (:goal (lit)))""")
    tree = plan(of, "1").tree
    check_tree(tree)
    assert tree.success_probability == 1
    assert [node.template for node in walk(tree.root) if node.template] == ["outer()", "middle()", "inner()"]


@pytest.mark.parametrize(
    ("limits", "option"), [({"nodes": 12}, "--max-nodes"), ({"states": 6}, "--max-states")]
)
def test_a_limit_ends_planning_with_the_best_tree_so_far(limits: dict[str, int], option: str) -> None:
    weak = action("try", conjunction([]), ("0.01", {0: T}), ("0.99", {}))
    done = plan(task("goal", {}, Is(0, T), weak), "0.9", **limits)
    assert done.tree.status == "limit-reached"
    assert done.stop is not None
    assert option in (done.stop.hint or "")
    assert 0 < done.tree.success_probability < Fraction("0.9")


@examples(150)
@given(of=tasks(), target=st.sampled_from(["0.5", "0.9", "1"]))
def test_every_plan_of_a_random_task_ends_soundly(of: Task, target: str) -> None:
    done = plan(of, target, nodes=120, states=3000)
    tree = done.tree
    limits = Limits()
    assert violations(of, explore(of, tree.root, limits)) == []
    check_tree(tree)
    assert simulate(of, tree.root, limits).success == tree.success_probability
    assert (tree.status == "target-reached") == (tree.success_probability >= Fraction(target))
    assert tree.success_probability == max([done.initial_success, *(s.success for s in done.refinements)])


def test_a_part_of_a_goal_that_brought_nothing_is_not_asked_for_again() -> None:
    """Either fact can be had, and each at the loss of the other: refinement ends, with what it knows."""
    first = action("first", conjunction([]), ("1", {0: T, 1: F}))
    second = action("second", conjunction([]), ("1", {1: T, 0: F}))
    goal = Or((And((Is(0, T), Is(1, T))), And((Is(0, T), Is(2, T)))))
    done = plan(task("a b c", {}, goal, first, second), "0.9", seconds=60)
    assert (done.tree.status, done.tree.success_probability) == ("stuck", 0)
