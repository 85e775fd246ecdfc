"""The strategy `strong-cyclic`: policies over partial states, against the enumeration of all states."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import figures, simulate
from bbtc.belief.soundness import violations
from bbtc.belief.state import compile_action, initial_belief
from bbtc.ground.condition import evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.result import Plan
from bbtc.planner.strong_cyclic.quotient import quotient_chain
from bbtc.planner.strong_cyclic.solve import Solver
from bbtc.tree.validate import check_tree
from tests.long_form import amount
from tests.plan.strong_cyclic_reference import strong_cyclic_states
from tests.strategies import tasks


def plan(of: Task, limits: Limits | None = None) -> Plan:
    return plan_task(of, Fraction(1), "strong-cyclic", limits or Limits(), lambda _: None)


@settings(max_examples=amount(300, 5000), deadline=None, suppress_health_check=list(HealthCheck))
@given(of=tasks(most_actions=5))
def test_random_tasks_have_a_policy_where_enumeration_finds_one(of: Task) -> None:
    _, safe = strong_cyclic_states(of)
    done = plan(of)
    check_tree(done.tree)
    assert violations(of, explore(of, done.tree.root, Limits())) == []
    if set(initial_belief(of)) <= safe:
        assert done.tree.status == "target-reached"
        assert simulate(of, done.tree.root, Limits()).success == 1
    else:
        assert done.tree.status == "out-of-reach"


@settings(max_examples=amount(300, 5000), deadline=None, suppress_health_check=list(HealthCheck))
@given(of=tasks(most_actions=6))
def test_what_is_learnt_of_dead_ends_and_invariants_is_true_of_every_reachable_state(of: Task) -> None:
    reachable, safe = strong_cyclic_states(of)
    solver = Solver(of, Limits())
    solver.run()
    for values in reachable:
        state = solver.model.packing.pack(values)
        for group in solver.exclusion.groups:
            assert sum(values[variable] == Truth.TRUE for variable in group) <= 1
        if solver.dead_ends.known.first(state) is not None:
            assert values not in safe
        if evaluate(of.goal, values) is Truth.TRUE:
            continue
        for number, action in enumerate(of.actions):
            if evaluate(action.precondition, values) is Truth.TRUE and solver.forbidden.forbids(
                state, number
            ):
                results = compile_action(action, Limits())(values)
                assert not {result.values for result in results} <= safe


@settings(max_examples=amount(200, 5000), deadline=None, suppress_health_check=list(HealthCheck))
@given(of=tasks(most_actions=6), random=st.randoms(use_true_random=False))
def test_steps_are_those_of_the_simulator_and_regression_is_enough(of: Task, random: object) -> None:
    """From any state that satisfies what a step was regressed to, the step may be taken and leads there."""
    solver = Solver(of, Limits())
    model = solver.model
    reachable, _ = strong_cyclic_states(of)
    ordered = sorted(reachable)[:40]
    packed = [model.packing.pack(values) for values in ordered]
    for action in model.actions:
        transition = compile_action(of.actions[action.number], Limits())
        for values, state in zip(ordered, packed, strict=True):
            if evaluate(of.actions[action.number].precondition, values) is not Truth.TRUE:
                assert action.number not in model.applicable(state)
                continue
            assert action.number in model.applicable(state)
            after = {step.apply(state) for step in action.steps}
            assert after == {model.packing.pack(result.values) for result in transition(values)}
            for step in action.steps:
                everything = sum(model.packing.bits(v) for v in range(len(of.variables)))
                reached = step.apply(state)
                for mask in [everything, *(model.packing.bits(v) for v in range(len(of.variables)))]:
                    wanted = type(model.actions[0].common)(mask, reached & mask)
                    needed = model.needed(action.number, step, state, wanted)
                    assert state & needed.mask == needed.value
                    for other in packed:
                        if other & needed.mask == needed.value:
                            assert action.number in model.applicable(other)
                            assert step.apply(other) & wanted.mask == wanted.value


@settings(max_examples=amount(200, 5000), deadline=None, suppress_health_check=list(HealthCheck))
@given(of=tasks(most_actions=5))
def test_the_quotient_of_a_chain_has_the_figures_of_the_chain(of: Task) -> None:
    solver = Solver(of, Limits())
    root = plan(of).tree.root
    chain = explore(of, root, Limits())
    quotient = quotient_chain(of, root, Limits(), solver.model, solver.exclusion)
    assert len(quotient.states) <= len(chain.states)
    assert violations(of, quotient) == []
    whole, small = figures(of, root, chain), figures(of, root, quotient)
    assert replace(whole, states=0, failures=()) == replace(small, states=0, failures=())
