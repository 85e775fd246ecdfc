"""Weak plans of the search by novelty, and the starts that are sure, beside enumeration."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from unittest.mock import patch

from hypothesis import given

from bbtc.belief.state import compile_action, initial_belief
from bbtc.ground.condition import TRUE, Is, conjunction, evaluate
from bbtc.ground.task import Effect, Factor, Outcome, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.elsewhere import also_at, only_at
from bbtc.planner.strong_cyclic import determinised
from bbtc.planner.strong_cyclic.novelty import ByNovelty
from bbtc.planner.strong_cyclic.partial_state import satisfied
from bbtc.planner.strong_cyclic.plan import plan_strong_cyclic, sure_starts
from bbtc.planner.strong_cyclic.solve import Solver
from tests.long_form import amount
from tests.planner.strong_cyclic_reference import strong_cyclic_states
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import tasks

T = Truth.TRUE


@examples(amount(140, 5000))
@given(of=tasks(most_actions=6))
def test_by_novelty_a_plan_is_found_where_there_is_one(of: Task) -> None:
    states, _ = strong_cyclic_states(of)
    solver = Solver(of, Limits())
    model, pack = solver.model, solver.model.packing.pack
    runs = {each.name: compile_action(of, each, Limits()) for each in of.actions}
    for start in initial_belief(of):
        reached, waiting = {start}, [start]
        for values in waiting:
            for each in of.actions:
                if evaluate(each.precondition, values) is T and evaluate(of.goal, values) is not T:
                    new = {result.values for result in runs[each.name](values)} - reached
                    reached |= new
                    waiting.extend(new)
        assert reached <= states
        if evaluate(of.goal, start) is T:
            continue
        search = ByNovelty(solver.searcher, pack(start), lambda state: satisfied(model.goal, state))
        found = search.go_on(10_000)
        assert (found is not None) == any(evaluate(of.goal, values) is T for values in reached)
        if found is None:
            continue
        at = pack(start)
        for taken in found.steps:
            assert taken.state == at
            assert taken.action in model.applicable(at)
            at = taken.step.apply(at)
        assert at == found.end
        assert satisfied(model.goal, at)


@examples(amount(70, 3000))
@given(of=tasks(most_actions=6))
def test_policies_are_found_whichever_search_finds_the_plans(of: Task) -> None:
    """By novelty from the first moment on."""
    _, safe = strong_cyclic_states(of)
    with patch("bbtc.planner.strong_cyclic.weak_plan.PATIENCE", 0):
        done = plan_strong_cyclic(of, Fraction(1), Limits(), lambda _: None)
    assert (done.tree.status == "target-reached") == (set(initial_belief(of)) <= safe)


@examples(amount(70, 3000))
@given(of=tasks(most_actions=6))
def test_starts_are_sure_where_a_policy_surely_reaches_the_goal(of: Task) -> None:
    states, safe = strong_cyclic_states(of)
    starts = [tuple(map(Truth, values)) for values in sorted(states)]
    sure = sure_starts(only_at(of, starts), Limits())
    assert sure == [each for each in starts if bytes(each) in safe]
    if sure:
        for wider in (only_at(of, sure), also_at(only_at(of, sure[:1]), sure)):
            done = plan_strong_cyclic(wider, Fraction(1), Limits(), lambda _: None)
            assert done.tree.success_probability == 1


def test_an_action_with_too_many_joint_outcomes_is_told() -> None:
    """Eight lamps, each of which a push lights with a chance of one half."""
    lamps = range(8)
    half = Fraction(1, 2)
    push = replace(
        action("push", TRUE),
        factors=tuple(
            Factor((Outcome(half, (Effect(None, ((lamp, T),)),)), Outcome(half, ()))) for lamp in lamps
        ),
    )
    goal = conjunction([Is(lamp, T) for lamp in lamps])
    of = task(" ".join(f"lamp{lamp}" for lamp in lamps), {}, goal, push)
    with patch.object(determinised, "MOST_OUTCOMES", 100):
        done = plan_strong_cyclic(of, Fraction(1), Limits(states=3), lambda _: None)
    assert done.stop is not None
    assert "joint outcomes" in done.stop.message
