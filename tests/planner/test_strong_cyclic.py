"""The strategy `strong-cyclic`: policies over partial states, against the enumeration of all states."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from itertools import permutations, product
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.chain import explore
from bbtc.belief.simulate import Figures, figures, simulate
from bbtc.belief.soundness import violations
from bbtc.belief.state import compile_action, initial_belief
from bbtc.belief.tick import STARTED, NodeStatus, compile_tick
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import TRUE, And, Is, Known, Or, conjunction, conjuncts, evaluate, leaves
from bbtc.ground.task import InitialState, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.maxprob import max_prob
from bbtc.planner.mdp.packing import Packing
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.planner.strong_cyclic.partial_state import PartialState, as_conditions, contains, satisfied, united
from bbtc.planner.strong_cyclic.quotient import _Ticks, quotient_chain
from bbtc.planner.strong_cyclic.relaxation import Relaxation
from bbtc.planner.strong_cyclic.rules import Rules, certainly, tree_of
from bbtc.planner.strong_cyclic.sharing import factored
from bbtc.planner.strong_cyclic.solve import Solved, Solver
from bbtc.planner.strong_cyclic.visit import Visit
from bbtc.rewrite.simplify import numbered
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of
from bbtc.tree.nodes import walk as walk_nodes
from bbtc.tree.validate import check_tree
from tests.benchmarks.chains import FAMILIES
from tests.conftest import REPOSITORY
from tests.ground.examples import task_of
from tests.long_form import amount
from tests.planner.strong_cyclic_reference import strong_cyclic_states
from tests.planner.test_refine import action as acting
from tests.planner.test_refine import task
from tests.profiles import examples
from tests.strategies import nodes, tasks

T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def plan(of: Task, limits: Limits | None = None) -> Plan:
    return plan_task(of, Fraction(1), "strong-cyclic", limits or Limits(), lambda _: None)


@examples(amount(56, 5000))
@given(of=tasks(most_actions=6))
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
        best = max_prob(explore_space(of, Limits()), Limits()).initial.exact
        assert done.tree.success_probability == best, "the best policy is written all the same"


@examples(amount(56, 5000))
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
                results = compile_action(of, action, Limits())(values)
                assert not {result.values for result in results} <= safe


@examples(amount(56, 5000))
@given(of=tasks(most_actions=6), random=st.randoms(use_true_random=False))
def test_steps_are_those_of_the_simulator_and_regression_is_enough(of: Task, random: object) -> None:
    """From any state that satisfies what a step was regressed to, the step may be taken and leads there."""
    solver = Solver(of, Limits())
    model = solver.model
    reachable, _ = strong_cyclic_states(of)
    ordered = sorted(reachable)[:40]
    packed = [model.packing.pack(values) for values in ordered]
    for action in model.actions:
        transition = compile_action(of, of.actions[action.number], Limits())
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
                    wanted = PartialState(mask, reached & mask)
                    needed = model.needed(action.number, step, state, wanted)
                    assert state & needed.mask == needed.value
                    for other in packed:
                        if other & needed.mask == needed.value:
                            assert action.number in model.applicable(other)
                            assert step.apply(other) & wanted.mask == wanted.value


@examples(amount(56, 5000))
@given(of=tasks(most_actions=6))
def test_the_quotient_of_a_chain_has_the_figures_of_the_chain(of: Task) -> None:
    solver = Solver(of, Limits())
    root = plan(of).tree.root
    chain = explore(of, root, Limits())
    quotient = quotient_chain(of, root, Limits(), solver.model, solver.exclusion)
    assert len(quotient.states) <= len(chain.states)
    assert violations(of, quotient) == []
    whole, small = figures(of, root, chain), figures(of, root, quotient)
    assert replace(whole, states=0, failures=()) == replace(small, states=0, failures=())


@examples(amount(56, 5000))
@given(data=st.data())
def test_the_quotient_of_any_tree_without_memory_has_the_figures_of_its_chain(data: st.DataObject) -> None:
    """Trees that read what is unknown, too, with guarded actions and loops."""
    of = data.draw(tasks(most_actions=4))
    root = forgetful(data.draw(nodes(of, depth=4)))
    solver = Solver(of, Limits())
    chain = explore(of, root, Limits())
    quotient = quotient_chain(of, root, Limits(), solver.model, solver.exclusion)
    whole, small = figures(of, root, chain), figures(of, root, quotient)
    assert replace(whole, states=0, failures=()) == replace(small, states=0, failures=())


def test_a_contradiction_of_what_is_unknown_is_unknown_in_the_quotient_too() -> None:
    """A tree that waits for it is blocked, and does not fail."""
    of = task("seen lit", {0: U, 1: T}, Is(0, T), acting("look", TRUE, ("1", {0: T})))
    of = replace(of, variables=(of.variables[0], replace(of.variables[1], three_valued=False)))
    root = ConditionNode("n1", Or((Is(1, F), And((Is(0, T), Is(0, F))))))
    solver = Solver(of, Limits())
    for chain in (
        explore(of, root, Limits()),
        quotient_chain(of, root, Limits(), solver.model, solver.exclusion),
    ):
        found = figures(of, root, chain)
        assert (found.blocked, found.failure) == (1, 0)


@examples(amount(70, 5000))
@given(data=st.data())
def test_states_with_the_explanation_of_another_have_its_figures(data: st.DataObject) -> None:
    """Every assignment of values is tried that keeps to the groups of which one member is true."""
    of = data.draw(tasks(most_actions=4))
    root = forgetful(data.draw(nodes(of, depth=4)))
    unknown = [Truth.UNKNOWN if each.three_valued else Truth.FALSE for each in of.variables]
    more = InitialState(Fraction(1, 2), tuple(unknown))
    halves = [replace(each, probability=each.probability / 2) for each in of.initial]
    of = replace(of, initial=(*halves, more))
    solver = Solver(of, Limits())
    visit = Visit(_Ticks(of, root, Limits(), solver.model, solver.exclusion))
    for state in solver.initial:
        visit.all_from(state)
    packing = solver.model.packing

    def outcome(values: tuple[Truth, ...]) -> Figures:
        at = replace(of, initial=(InitialState(Fraction(1), values),))
        return replace(figures(at, root, explore(at, root, Limits())), states=0, failures=())

    for values in product(*(sorted(variable.values) for variable in of.variables)):
        groups = solver.exclusion.groups
        if any(sum(values[member] is Truth.TRUE for member in group) > 1 for group in groups):
            continue
        state = packing.pack(bytes(values))
        if state not in visit.nodes and visit.explained.number(state) is not None:
            like = unpacked(packing, visit.representative(state))
            assert outcome(values) == outcome(like)


@examples(amount(42, 5000))
@given(of=tasks(most_actions=6), random=st.randoms(use_true_random=False))
def test_a_distance_does_not_depend_on_what_was_asked_before(of: Task, random: Random) -> None:
    """The relaxation goes from state to state by what differs, and learns what is forbidden on the way."""
    solver = Solver(of, Limits())
    reachable, safe = strong_cyclic_states(of)
    states = sorted(reachable)[:30]
    random.shuffle(states)
    forbidden: list[tuple[int, PartialState]] = []
    for values in states:
        state = solver.model.packing.pack(values)
        fresh = Relaxation(solver.model, solver.exclusion, Limits())
        for action, partial in forbidden:
            fresh.forbid(action, partial)
        found = solver.relaxation.estimate(state)
        assert found == fresh.estimate(state)
        if found is None:
            assert forbidden or values not in safe
        elif found.plan and random.random() < 0.2:
            action = found.plan[0][0]
            literal = solver.model.reasons.literal(random.randrange(len(of.variables)), state)
            forbidden.append((action, literal))
            solver.relaxation.forbid(action, literal)


@examples(amount(42, 5000))
@given(of=tasks(most_actions=6))
def test_short_rules_decide_as_the_policy_in_every_state_they_were_told(of: Task) -> None:
    """Of the tree, as the engine ticks it: the same action, whatever the guards were shortened to."""
    solver = Solver(of, Limits())
    solved = solver.run()
    if not isinstance(solved, Solved):
        return
    rules = Rules(solver.model, solver.exclusion, solved, Limits())
    reachable, _ = strong_cyclic_states(of)
    rules.meet(map(solver.model.packing.pack, sorted(reachable)))
    trees = [tree_of(of, solver.model, each) for each in (rules.plain(), rules.short())]
    ticks = [compile_tick(of, root) for root in trees]
    starts = [[node.action for node in actions_of(root)] for root in trees]
    for values in sorted(reachable):
        plain, short = (tick(values, 0) for tick in ticks)
        if plain >= STARTED:
            assert short >= STARTED
            assert starts[0][plain - STARTED] == starts[1][short - STARTED]


@examples(amount(56, 5000))
@given(of=tasks(most_actions=4), random=st.randoms(use_true_random=False))
def test_what_rules_share_is_read_once_and_nothing_else_changes(of: Task, random: Random) -> None:
    """In every assignment of values the same action, or none, and never a larger tree."""
    if not of.actions:
        return
    literals = [Is(v, Truth(random.choice((0, 2)))) for v in range(len(of.variables))]
    certain = [certainly(of, literal) for literal in literals]
    rules = []
    for _ in range(random.randint(1, 8)):
        guards = random.sample(certain, random.randint(0, len(certain)))
        node = ActionNode("", random.choice(of.actions).name, latched=False, guarded=True)
        rules.append((conjuncts(conjunction(guards)), node))
    alone = [factored(of, [rule])[0] for rule in rules]
    roots = [
        numbered(ControlNode("", "fallback", tuple(children))) for children in (alone, factored(of, rules))
    ]
    ticks = [compile_tick(of, root) for root in roots]
    starts = [[node.action for node in actions_of(root)] for root in roots]
    assert starts[0] == starts[1]
    for values in product(*(sorted(variable.values) for variable in of.variables)):
        assert ticks[0](values, 0) == ticks[1](values, 0)
    assert measure(roots[1]) <= measure(roots[0])


def measure(root: Node) -> int:
    """Nodes and literals in conditions."""
    conditions = [node.condition for node in walk_nodes(root) if isinstance(node, ConditionNode)]
    return sum(1 for _ in walk_nodes(root)) + sum(1 for each in conditions for _ in leaves(each))


def test_neighbours_stand_under_what_they_share() -> None:
    of = task_of(f"{DOMAIN}(define (problem p) (:domain d) (:init (here)) (:goal {GOAL}))")
    at = {variable.predicate: Is(number, Truth.TRUE) for number, variable in enumerate(of.variables)}
    act, do, wait = (ActionNode("", of.actions[number].name) for number in range(3))
    rules = [((at["here"], at["open"]), act), ((at["here"], at["wet"]), do), ((at["here"],), wait)]
    (found,) = factored(of, rules)
    assert found == ControlNode(
        "",
        "sequence",
        (
            ConditionNode("", at["here"]),
            ControlNode(
                "",
                "fallback",
                (
                    ControlNode("", "sequence", (ConditionNode("", at["open"]), act)),
                    ControlNode("", "sequence", (ConditionNode("", at["wet"]), do)),
                    wait,
                ),
            ),
        ),
    )


def unpacked(packing: Packing, state: int) -> tuple[Truth, ...]:
    """The values of a state."""
    (found,) = packing.values(packing.split([state]))
    return tuple(Truth(value) for value in found)


def forgetful(node: Node) -> Node:
    """The tree without latches and retry nodes, its actions guarded."""
    match node:
        case ActionNode():
            return replace(node, latched=False, guarded=True)
        case ControlNode(kind="retry" | "retry-until-success"):
            return forgetful(node.children[0])
        case ControlNode():
            return replace(node, children=tuple(map(forgetful, node.children)))
        case _:
            return node


@pytest.mark.parametrize("seed", range(amount(28, 1000)))
def test_a_policy_that_is_proven_leads_on_from_every_state_it_leads_to(seed: int) -> None:
    """By enumeration of the states that it leads to, those not visited for the proof among them."""
    random = Random(seed)
    length = random.randint(6, 9)
    drawn = {(random.randrange(length), random.randrange(length)) for _ in range(random.randint(2, 6))}
    of = walk(length, (), tuple(sorted((a, b) for a, b in drawn if a != b)))
    solver = Solver(of, Limits())
    assert isinstance(solver.run(), Solved)
    states = list(solver.initial)
    edges: dict[int, set[int]] = {}
    for state in states:
        if state in edges or satisfied(solver.model.goal, state):
            continue
        pair = solver.policy.decide(state)
        assert pair is not None
        edges[state] = {each.apply(state) for each in solver.model.actions[solver.action(pair)].steps}
        states.extend(edges[state])
    surely = set(states) - set(edges)
    while more := {state for state, after in edges.items() if state not in surely and after & surely}:
        surely |= more
    assert surely == set(states)


@examples(amount(42, 5000))
@given(of=tasks(most_actions=6))
def test_whatever_the_state_no_action_starts_without_its_precondition_and_success_means_the_goal(
    of: Task,
) -> None:
    """In every assignment of values, reachable or not: others may bring it about."""
    done = plan_task(of, Fraction(1), "strong-cyclic", Limits(), lambda _: None)
    root = done.tree.root
    tick = compile_tick(of, root)
    actions = list(actions_of(root))
    for values in product(*(sorted(variable.values) for variable in of.variables)):
        status = tick(values, 0)
        if status >= STARTED:
            needed = of.action_by_name[actions[status - STARTED].action].precondition
            assert evaluate(needed, values) is Truth.TRUE
        elif status == NodeStatus.SUCCESS:
            assert evaluate(of.goal, values) is Truth.TRUE


# --- regression --------------------------------------------------------------------------------


def regressed(domain: str, start: str, step: str, wanted: str) -> str:
    """What of a state, written as the facts that are true, is enough for an action to lead by one of its
    outcomes to some facts (``-`` before those that are false, ``?`` before those that are unknown)."""
    of = task_of(f"{domain}(define (problem p) (:domain d) (:init {start}) (:goal {GOAL}))")
    solver = Solver(of, Limits())
    model = solver.model
    (state,) = solver.initial
    want = PartialState(0, 0)
    for word in wanted.split():
        variable = of.variable_index[f"{word.lstrip('-?')}()"]
        value = Truth.UNKNOWN if word[0] == "?" else Truth.FALSE if word[0] == "-" else Truth.TRUE
        bits = model.packing.assigned(variable, value)
        want = united(want, model.reasons.literal(variable, bits))
    (number,) = [n for n, action in enumerate(of.actions) if action.schema == step]
    found = {
        text(of, model.needed(number, each, state, want), model.packing)
        for each in model.actions[number].steps
        if contains(want, each.apply(state))
    }
    return " | ".join(sorted(found))


def text(of: Task, partial: PartialState, packing: Packing) -> str:
    words = []
    for condition in as_conditions(packing, partial):
        match condition:
            case Is(variable, value):
                sign = {Truth.TRUE: "", Truth.FALSE: "-", Truth.UNKNOWN: "?"}[value]
                words.append(f"{sign}{of.variables[variable].predicate}")
            case Known(variable):
                words.append(f"known:{of.variables[variable].predicate}")
            case _:
                raise AssertionError(condition)
    return " ".join(words)


GOAL = "(or (and (here) (there) (open)) (and (locked) (wet) (seen)))"

DOMAIN = """
(define (domain d)
  (:predicates (here) (there) (open) (locked) (wet) (unknown (seen)))
  (:action shuffle :effect (oneof
    (and (here) (there) (open) (locked) (wet) (seen))
    (and (not (here)) (not (there)) (not (open)) (not (locked)) (not (wet)) (not (seen)))))
  (:action walk :precondition (and (here) (open))
    :effect (and (not (here)) (there) (oneof (and) (wet))))
  (:action enter :precondition (and (here) (or (open) (not (locked))))
    :effect (and (there) (not (here))))
  (:action push :precondition (here)
    :effect (and (when (not (locked)) (open)) (when (wet) (not (open)))))
  (:action look :precondition (unknown (seen))
    :effect (and (oneof (seen) (not (seen)))))
  (:action sway :precondition (here)
    :effect (unknown (seen)))
  (:action keep :precondition (here) :effect (when (locked) (unknown (seen)))))
"""


@pytest.mark.parametrize(
    ("start", "step", "wanted", "expected"),
    [
        # what an outcome sets is not needed before, what it leaves alone is
        ("(here) (open)", "walk", "there wet", "here open"),
        ("(here) (open) (wet)", "walk", "there wet", "here open | here open wet"),
        ("(here) (open) (locked)", "walk", "there locked -wet", "here locked open -wet"),
        # of a disjunction, the part that holds
        ("(here) (open) (locked)", "enter", "there", "here open"),
        ("(here)", "enter", "there", "here -locked"),
        ("(here) (open)", "enter", "there open", "here open"),
        # a conditional effect: why it happens, why another does not undo it
        ("(here)", "push", "open", "here -locked"),
        ("(here) (wet)", "push", "open", "here -locked"),
        ("(here) (locked) (open)", "push", "open", "here open -wet"),
        ("(here) (locked) (open) (wet)", "push", "-open", "here locked wet"),
        ("(here) (locked)", "push", "-open", "here locked -open"),
        ("(here) (locked)", "push", "here", "here"),
        # observation and forgetting
        ("(here) (unknown (seen))", "look", "seen here", "here ?seen"),
        ("(here) (unknown (seen))", "look", "-seen", "?seen"),
        ("(here) (seen)", "sway", "?seen", "here"),
        ("(here) (seen)", "keep", "seen", "here -locked seen"),
        ("(here) (seen) (locked)", "keep", "?seen", "here locked"),
        ("(here) (unknown (seen)) (locked)", "keep", "?seen", "here locked"),
    ],
)
def test_regression(start: str, step: str, wanted: str, expected: str) -> None:
    assert regressed(DOMAIN, start, step, wanted) == expected


# --- larger tasks, and limits --------------------------------------------------------------------

WALK = """
(define (domain walk)
  (:requirements :typing :probabilistic-effects :negative-preconditions)
  (:types place)
  (:predicates (at ?p - place) (next ?a ?b - place) (flat) (spare ?p - place))
  (:action go :parameters (?a ?b - place) :precondition (and (at ?a) (next ?a ?b) (not (flat)))
    :effect (and (not (at ?a)) (at ?b) (probabilistic 1/2 (flat))))
  (:action mend :parameters (?p - place) :precondition (and (at ?p) (flat) (spare ?p))
    :effect (and (not (flat)) (not (spare ?p)))))
"""


def walk(length: int, bare: tuple[int, ...] = (), ways: tuple[tuple[int, int], ...] = ()) -> Task:
    """Places in a row with a spare tire at each but the ``bare`` ones, and more ``ways`` from one to
    another."""
    names = " ".join(f"p{at}" for at in range(length))
    steps = [*((at, at + 1) for at in range(length - 1)), *ways]
    facts = [f"(next p{a} p{b})" for a, b in steps]
    facts += [f"(spare p{at})" for at in range(length) if at not in bare]
    return task_of(
        f"{WALK}(define (problem p) (:domain walk) (:objects {names} - place)"
        f" (:init (at p0) {' '.join(facts)}) (:goal (at p{length - 1})))"
    )


def test_a_tree_of_very_many_states_is_proven_and_its_cost_exact() -> None:
    """Every place is left with or without its spare: 2^58 states differ in what no longer matters."""
    done = plan(walk(60), Limits(states=20_000))
    assert done.tree.status == "target-reached"
    assert done.tree.bounds == (Fraction(1), Fraction(1))
    assert done.figures.success == 1
    assert done.figures.cost == 59 + Fraction(58, 2)
    assert done.figures.states < 1000
    small = walk(8)
    assert plan(small).figures.cost == 7 + Fraction(6, 2)


def test_a_way_that_may_end_in_a_dead_end_is_not_taken() -> None:
    """The short cut goes by a place without a spare tire."""
    of = walk(12, bare=(5,), ways=((3, 5), (4, 6), (5, 11), (0, 5)))
    done = plan(of)
    assert done.tree.status == "target-reached"
    assert not [node.action for node in actions_of(done.tree.root) if node.action.endswith("p5)")]
    assert plan(walk(12, bare=(5,))).tree.status == "out-of-reach"


SHORT_CUT = """
(define (domain cut)
  (:predicates (asleep) (here) (half) (far) (near) (there) (rope) (shoes) (slipped))
  (:action wake :precondition (asleep) :effect (and (not (asleep)) (here) (oneof {})))
  (:action walk :precondition (and (here) (not (slipped))) :effect (and (not (here)) (half)))
  (:action walk-on :precondition (and (half) (not (slipped))) :effect (and (not (half)) (far)))
  (:action and-on :precondition (and (far) (not (slipped))) :effect (and (not (far)) (near)))
  (:action arrive :precondition (and (near) (not (slipped))) :effect (and (not (near)) (there)))
  (:action climb :precondition (and (here) (rope) (not (slipped)))
    :effect (and (not (rope)) (oneof (and (not (here)) (there)) (slipped))))
  (:action stand-up :precondition (and (slipped) (shoes)) :effect (and (not (slipped)) (not (here)) (there))))
(define (problem p) (:domain cut) (:init (asleep)) (:goal (there)))
"""


@pytest.mark.parametrize("order", list(permutations(("(and (rope) (shoes))", "(and)", "(rope)"))))
def test_a_short_cut_is_no_way_where_one_of_its_outcomes_needs_what_is_missing(order: tuple[str]) -> None:
    """Whichever state is seen first: with a rope and no shoes the state is like the one with neither in all
    that walking needs, and the short cut, the first choice where there is a rope, may end without hope."""
    of = task_of(SHORT_CUT.format(" ".join(order)))
    done = plan(of)
    assert done.tree.status == "target-reached"
    assert simulate(of, done.tree.root, Limits()).success == 1


def test_groups_of_exclusive_facts_are_found() -> None:
    of = walk(5)
    solver = Solver(of, Limits())
    names = [[of.variables[variable].name for variable in group] for group in solver.exclusion.groups]
    assert names == [[f"at(p{at})" for at in range(5)]]


def calls(of: Task) -> int:
    """The calls of functions that planning takes."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event == "call"

    plan(of)  # so that everything is loaded
    before = sys.getprofile()
    sys.setprofile(note)
    try:
        plan(of)
    finally:
        sys.setprofile(before)
    return count


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_long_chains_take_work_in_proportion(family: str) -> None:
    """Four times the rules; trying each rule in each state would take sixteen times the work."""
    assert calls(FAMILIES[family](121)) <= 7 * calls(FAMILIES[family](31))


def test_limits_end_it_and_the_tree_so_far_is_kept() -> None:
    done = plan(walk(30), Limits(states=10))
    assert done.tree.status == "limit-reached"
    assert done.stop is not None
    assert "states" in done.stop.message
    done = plan(walk(200), Limits(seconds=0.05))
    assert done.tree.status in {"limit-reached", "target-reached"}


def test_a_number_of_actions_is_refused() -> None:
    with pytest.raises(BbtcError) as caught:
        plan_task(
            walk(3), Fraction(1), "strong-cyclic", Limits(), lambda _: None, options=Options(max_actions=3)
        )
    assert caught.value.diagnostics[0].code == "BBT0503"


def test_trees_do_not_depend_on_the_seed_of_hashes() -> None:
    program = (
        "from tests.planner.test_strong_cyclic import plan, walk\n"
        "print(plan(walk(9, bare=(5,), ways=((3, 5), (4, 6), (2, 8), (0, 3)))).tree.root)\n"
    )
    printed = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
            capture_output=True,
            check=True,
            cwd=REPOSITORY,
        ).stdout
        for seed in (1, 2)
    }
    assert len(printed) == 1


@pytest.mark.parametrize("seed", range(amount(42, 2000)))
def test_random_walks_are_taken_where_enumeration_finds_a_sure_way(seed: int) -> None:
    """Loops, dead ends that depend on what was used up, ways around them."""
    random = Random(seed)
    length = random.randint(5, 8)
    bare = tuple(sorted(random.sample(range(length - 1), random.randint(1, length - 2))))
    drawn = {(random.randrange(length), random.randrange(length)) for _ in range(random.randint(2, 8))}
    try:
        of = walk(length, bare, tuple(sorted((a, b) for a, b in drawn if a != b)))
    except BbtcError:
        return  # the goal cannot be reached at all, and grounding says so
    _, safe = strong_cyclic_states(of)
    expected = "target-reached" if set(initial_belief(of)) <= safe else "out-of-reach"
    assert plan(of).tree.status == expected
