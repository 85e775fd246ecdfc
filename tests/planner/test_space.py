"""The state space in arrays is the one that the simulator's actions span."""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from random import Random
from unittest.mock import patch

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bbtc.belief.draws import Values
from bbtc.belief.state import compile_action, initial_belief
from bbtc.ground.condition import TRUE, Is, conjunction, evaluate
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp import packing as space_packing
from bbtc.planner.mdp import transitions as space_actions
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.planner.mdp.state_table import StateTable
from tests.long_form import amount
from tests.profiles import examples
from tests.strategies import tasks

Step = tuple[str, Values, Fraction, Fraction]
"""Action, values after it, cost, reward."""


def by_simulator(task: Task) -> dict[Values, dict[Step, Fraction]]:
    """Reachable states and the results of every choice that may leave its state."""
    steps = {action.name: compile_action(task, action, Limits()) for action in task.actions}
    found: dict[Values, dict[Step, Fraction]] = {}
    todo = list(initial_belief(task))
    while todo:
        values = todo.pop()
        if values in found:
            continue
        found[values] = {}
        if evaluate(task.goal, values) is Truth.TRUE:
            continue
        for action in task.actions:
            if evaluate(action.precondition, values) is not Truth.TRUE:
                continue
            results = steps[action.name](values)
            if all(result.values == values for result in results):
                continue
            for r in results:
                key = (action.name, r.values, r.cost, r.reward)
                found[values][key] = found[values].get(key, Fraction(0)) + r.probability
                todo.append(r.values)
    return found


def by_arrays(space: StateSpace) -> dict[Values, dict[Step, Fraction]]:
    found: dict[Values, dict[Step, Fraction]] = {}
    values = space.packing.values(space.states)
    for state, before in enumerate(values):
        assert before not in found, "a state stands twice"
        found[before] = {}
        for choice in space.choices_of(np.array([state])).tolist():
            name = space.task.actions[int(space.choice_action[choice])].name
            for successor, number in space.outcomes(choice):
                draw = space.draws[number]
                key = (name, values[successor], draw.cost, draw.reward)
                found[before][key] = found[before].get(key, Fraction(0)) + draw.probability
    return found


@examples(amount(84, 300))
@given(task=tasks(nested=2))
def test_random_tasks_span_the_same_space_as_in_the_simulator(task: Task) -> None:
    space = explore_space(task, Limits())
    assert space.complete
    assert by_arrays(space) == by_simulator(task)
    states = space.packing.values(space.states)
    assert {states[number]: p for p, number in space.initial} == initial_belief(task)
    for values, holds in zip(states, space.goal, strict=True):
        assert holds == (evaluate(task.goal, values) is Truth.TRUE)


@examples(amount(28, 100))
@given(task=tasks(nested=2))
def test_actions_with_very_many_outcomes_and_disjuncts_take_another_way_to_the_same(task: Task) -> None:
    with patch.multiple(space_actions, MOST_OUTCOMES=1, MOST_CUBES=1):
        space = explore_space(task, Limits())
    assert by_arrays(space) == by_simulator(task)


def lamps(count: int, off: int = 3) -> Task:
    """Any lamp can be switched on, but for the last ones all are; over 64 of them take more than one word."""
    switches = tuple(
        GroundAction(
            "switch", (f"{i:03}",), Is(i, Truth.FALSE), (Factor((Outcome(Fraction(1), (_on(i),)),)),)
        )
        for i in range(count)
    )
    variables = tuple(Variable("lit", (f"{i:03}",), three_valued=i % 2 == 0) for i in range(count))
    start = tuple(Truth.TRUE if i < count - off else Truth.FALSE for i in range(count))
    last = Is(count - 1, Truth.TRUE)
    return Task("lamps", "all", variables, (InitialState(Fraction(1), start),), last, switches)


def _on(variable: int) -> Effect:
    return Effect(None, ((variable, Truth.TRUE),))


def _off(variable: int) -> Factor:
    return Factor((Outcome(Fraction(1), (Effect(None, ((variable, Truth.FALSE),)),)),))


def test_states_of_several_words() -> None:
    space = explore_space(lamps(150), Limits())
    assert space.packing.words == 4
    # The last lamp ends it: the subsets of the two others, with and without it.
    assert (len(space.states), int(space.goal.sum())) == (8, 4)
    assert by_arrays(space) == by_simulator(space.task)


def test_many_states_at_once_and_many_actions() -> None:
    """Levels of 126 states to expand, each with 600 actions of which few apply: some need what is false, some
    what is true."""
    task = lamps(600, off=5)
    flipped = [
        dataclasses.replace(each, precondition=Is(i, Truth.TRUE), factors=(_off(i),))
        if 150 <= i < 155
        else each
        for i, each in enumerate(task.actions)
    ]
    space = explore_space(dataclasses.replace(task, actions=tuple(flipped)), Limits())
    assert len(space.states) == 2**10
    assert by_arrays(space) == by_simulator(space.task)


def test_an_action_that_draws_nothing_changes_nothing() -> None:
    wait = GroundAction("wait", (), TRUE, ())
    of = lamps(4)
    space = explore_space(dataclasses.replace(of, actions=(*of.actions, wait)), Limits())
    assert by_arrays(space) == by_simulator(of) == by_simulator(space.task)


def test_a_depth_leaves_the_rest_unexpanded() -> None:
    task = dataclasses.replace(lamps(70), goal=Is(0, Truth.FALSE))
    for depth, (expanded, found) in enumerate([(0, 1), (1, 4), (4, 7)]):
        space = explore_space(task, Limits(), depth=depth)
        assert (space.expanded, len(space.states)) == (expanded, found)
    assert not space.complete
    assert space.stop is None


def test_a_limit_leaves_the_rest_unexpanded_and_is_named() -> None:
    task = dataclasses.replace(lamps(70), goal=Is(0, Truth.FALSE))
    space = explore_space(task, Limits(states=3))
    assert not space.complete
    assert space.stop is not None
    assert "3 states" in space.stop.message


@examples(amount(28, 100))
@given(
    rows=st.lists(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=40), max_size=20),
    bits=st.sampled_from([0, 3, 62]),
)
def test_the_table_numbers_states_as_they_first_appear(rows: list[list[tuple[int, int]]], bits: int) -> None:
    table = StateTable(2)
    known: dict[tuple[int, int], int] = {}
    for batch in rows:
        packed = [(a << bits, b << bits) for a, b in batch]
        expected = [known.setdefault(row, len(known)) for row in packed]
        assert table.number(np.array(packed, dtype=np.uint64).reshape(-1, 2)).tolist() == expected
    assert [tuple(row) for row in table.states.tolist()] == list(known)


def test_the_table_grows() -> None:
    table = StateTable(1)
    first = np.arange(5000, dtype=np.uint64).reshape(-1, 1) << np.uint64(40)
    assert (table.number(first) == np.arange(5000)).all()
    assert (table.number(first[::-1]) == np.arange(5000)[::-1]).all()
    assert table.count == 5000
    for multiplier in range(3, 103, 2):  # where they stand in the table differs
        table, states = StateTable(1), np.arange(300, dtype=np.uint64).reshape(-1, 1) * np.uint64(multiplier)
        for part in np.split(states, 10):
            table.number(part)
        assert (table.number(states) == np.arange(300)).all()


def test_conditions_of_any_shape_become_cubes() -> None:
    packing = space_packing.Packing((2, None), 1)
    assert space_packing.bit_test(packing, TRUE) == space_packing.ALWAYS
    assert space_packing.bit_test(packing, Is(1, Truth.UNKNOWN)) == space_packing.NEVER


@examples(amount(14, 60))
@given(values=st.lists(st.sampled_from([0, 1, 2]), min_size=90, max_size=90), seed=st.integers(0, 2**32))
def test_conditions_over_several_words_hold_where_the_semantics_say(values: list[int], seed: int) -> None:
    """A conjunction of what most of the variables are, and one that is wrong in a place."""
    random = Random(seed)
    packing = space_packing.Packing(tuple(range(90, 180)), 3)
    rows = packing.split([packing.pack(bytes(values)), packing.pack(bytes(reversed(values)))])
    asked = sorted(random.sample(range(90), random.choice([2, 45, 90])))
    conditions = [conjunction([Is(v, Truth(values[v])) for v in asked])]
    wrong = random.choice(asked)
    conditions.append(
        conjunction([Is(v, Truth((values[v] + (v == wrong)) % 3)) for v in asked])  # one value is another
    )
    for condition in conditions:
        test = space_packing.bit_test(packing, condition)
        expected = [evaluate(condition, bytes(row)) is Truth.TRUE for row in (values, values[::-1])]
        assert space_packing.holds(packing, test, rows).tolist() == expected


@examples(amount(28, 100))
@given(task=tasks(nested=2), every=st.integers(1, 3))
def test_the_closure_is_what_a_walk_over_single_choices_finds(task: Task, every: int) -> None:
    space = explore_space(task, Limits())
    taken = np.arange(len(space.choice_action)) % every == 0
    found, waiting = set(space.start.tolist()), space.start.tolist()
    while waiting:
        for choice in space.choices_of(np.array([waiting.pop()])).tolist():
            for successor, _ in space.outcomes(choice) if taken[choice] else ():
                if successor not in found:
                    found.add(successor)
                    waiting.append(successor)
    closed = space.closure(space.start, taken).tolist()
    assert len(closed) == len(set(closed))
    assert set(closed) == found
    if every == 1:
        assert len(found) == len(space.states)
