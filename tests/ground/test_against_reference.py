"""Grounding keeps the meaning of the lifted model, on random domains, by brute force."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from math import prod
from unittest.mock import patch

from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.condition import evaluate
from bbtc.ground.instantiate import ground, instantiate
from bbtc.ground.pruning import relevance
from bbtc.ground.pruning.prune import prune
from bbtc.ground.reachability import bulk, program
from bbtc.ground.task import Factor, GroundAction, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model.domain import Model
from tests.ground import reference
from tests.ground.examples import model_of
from tests.ground.lifted_texts import lifted_texts
from tests.profiles import examples

Change = frozenset[tuple[int, Truth]]
_MOST_COMBINATIONS = 500
_SETTINGS = examples(60)


_BOUNDS = {
    (program, "FEW_BINDINGS"): st.integers(0, 3),
    (program, "MOST_ALTERNATIVES"): st.integers(1, 4),
    (program, "FIRST_CHAIN"): st.integers(0, 3),
    (bulk, "CHUNK"): st.integers(1, 3),
    (bulk, "MOST_SHARED"): st.integers(0, 3),
    (relevance, "SWEEPS"): st.integers(0, 2),
}


def bounds() -> st.SearchStrategy[list[int]]:
    """Other bounds of what is done in which of several ways: small ones, as if the task were large, or
    none."""
    return st.one_of(st.just([]), st.tuples(*_BOUNDS.values()).map(list))


@contextmanager
def _bounded(sizes: list[int]) -> Iterator[None]:
    with ExitStack() as stack:
        for (module, name), size in zip(_BOUNDS, sizes, strict=False):
            stack.enter_context(patch.object(module, name, size))
        yield


def _grounded(text: str, sizes: list[int]) -> tuple[Model, Task | None]:
    model, report = model_of(text), Report()
    try:
        with _bounded(sizes):
            return model, instantiate(model, report, Limits())
    except BbtcError as error:
        if any(d.code != "BBT0412" for d in report.errors):
            raise AssertionError(text) from error
        return model, None


def _possible(model: Model) -> dict[reference.Atom, set[Truth]]:
    reachable, _ = reference.relaxed(model)
    possible: dict[reference.Atom, set[Truth]] = {}
    for atom, value in reachable:
        possible.setdefault(atom, set()).add(value)
    return possible


def _distribution(factors: Iterable[Factor], state: list[Truth]) -> dict[Change, Fraction]:
    """What the factors of an action do in a state, multiplied out."""
    result: dict[Change, Fraction] = {frozenset(): Fraction(1)}
    for factor in factors:
        assert sum(outcome.probability for outcome in factor.outcomes) == 1
        longer: dict[Change, Fraction] = {}
        for outcome in factor.outcomes:
            assert outcome.probability > 0
            inner = _distribution(outcome.factors, state)
            settings_ = {
                pair
                for effect in outcome.effects
                if effect.when is None or evaluate(effect.when, state) is Truth.TRUE
                for pair in effect.sets
            }
            for done, p in result.items():
                for nested, q in inner.items():
                    change: dict[int, Truth] = {}
                    for variable, value in (*done, *nested, *settings_):
                        change[variable] = max(value, change.get(variable, value))
                    key = frozenset(change.items())
                    longer[key] = longer.get(key, Fraction(0)) + p * q * outcome.probability
        result = longer
    return result


def _successors(change: Change, state: list[Truth]) -> tuple[Truth, ...]:
    values = list(state)
    for variable, value in change:
        values[variable] = value
    return tuple(values)


@_SETTINGS
@given(lifted_texts(), bounds())
def test_what_is_reachable_is_what_enumeration_finds(text: str, sizes: list[int]) -> None:
    model, task = _grounded(text, sizes)
    reachable, actions = reference.relaxed(model)
    assert model.goal is not None
    if task is None:
        assert not reference.may_be(model, model.goal, {}, reachable, True)
        return
    assert [action.name for action in task.actions] == sorted(actions)
    possible, worlds = _possible(model), reference.world_values(model, reachable)
    varying = {atom for atom, values in possible.items() if len(values) > 1 or values == {Truth.UNKNOWN}}
    found = {(variable.predicate, variable.args) for variable in task.variables}
    # What the model never changes is a variable only where others may change it.
    assert varying <= found
    assert {name for name, _ in found - varying} <= reference.open_predicates(model)
    for variable in task.variables:
        assert set(variable.values) >= worlds[variable.predicate, variable.args]
        assert variable.three_valued == (Truth.UNKNOWN in worlds[variable.predicate, variable.args])
    names = [variable.name for variable in task.variables]
    assert names == sorted(names)


@_SETTINGS
@given(lifted_texts(), bounds(), st.data())
def test_outcomes_mean_the_same(text: str, sizes: list[int], data: st.DataObject) -> None:
    model, task = _grounded(text, sizes)
    if task is None:
        return
    possible = _possible(model)
    _, actions = reference.relaxed(model)
    world = {atom: data.draw(st.sampled_from(sorted(values))) for atom, values in sorted(possible.items())}
    state = [world[variable.predicate, variable.args] for variable in task.variables]
    for action in task.actions:
        schema, binding = actions[action.name]
        applies = reference.value(model, schema.precondition, binding, world) is Truth.TRUE
        if applies and _combinations(action.factors) <= _MOST_COMBINATIONS:
            _compare_outcomes(model, task, action, world, state)


@_SETTINGS
@given(lifted_texts(), bounds(), st.data())
def test_conditions_have_the_value_of_the_text_whatever_others_change(
    text: str, sizes: list[int], data: st.DataObject
) -> None:
    """Facts that the model never changes, and those that it only makes true, change here as well."""
    model, task = _grounded(text, sizes)
    if task is None:
        return
    reachable, actions = reference.relaxed(model)
    worlds = reference.world_values(model, reachable)
    assert model.goal is not None
    for _ in range(3):
        world = {atom: data.draw(st.sampled_from(sorted(values))) for atom, values in sorted(worlds.items())}
        state = [world[variable.predicate, variable.args] for variable in task.variables]
        assert evaluate(task.goal, state) is reference.value(model, model.goal, {}, world)
        for action in task.actions:
            schema, binding = actions[action.name]
            expected = reference.value(model, schema.precondition, binding, world)
            assert evaluate(action.precondition, state) is expected


def _combinations(factors: Iterable[Factor]) -> int:
    return prod(sum(_combinations(outcome.factors) for outcome in factor.outcomes) for factor in factors)


def _compare_outcomes(
    model: Model, task: Task, action: GroundAction, world: reference.World, state: list[Truth]
) -> None:
    schema = model.schemas[action.schema]
    binding = {p.name: arg for p, arg in zip(schema.parameters, action.args, strict=True)}
    expected: dict[tuple[Truth, ...], Fraction] = {}
    for change, p in reference.outcomes(model, schema.effect, binding, world).items():
        after = {**world, **dict(change)}
        key = tuple(after[variable.predicate, variable.args] for variable in task.variables)
        expected[key] = expected.get(key, Fraction(0)) + p
    found: dict[tuple[Truth, ...], Fraction] = {}
    for numbered, p in _distribution(action.factors, state).items():
        values = _successors(numbered, state)
        found[values] = found.get(values, Fraction(0)) + p
    assert found == expected


@_SETTINGS
@given(lifted_texts(), bounds(), st.data())
def test_pruning_keeps_what_matters(text: str, sizes: list[int], data: st.DataObject) -> None:
    """On the variables that are left, every kept action does the same as before; what is left out
    sets none of them."""
    _, task = _grounded(text, sizes)
    if task is None:
        return
    small = prune(task)
    with _bounded(sizes):
        assert small == ground(model_of(text), Report(), Limits())
    state = [data.draw(st.sampled_from(sorted(variable.values))) for variable in task.variables]
    kept = [task.variable_index[variable.name] for variable in small.variables]
    part = [state[index] for index in kept]
    assert evaluate(small.goal, part) is evaluate(task.goal, state)
    assert {s.values for s in small.initial} == {tuple(s.values[i] for i in kept) for s in task.initial}
    for action in task.actions:
        if _combinations(action.factors) > _MOST_COMBINATIONS:
            continue
        before: dict[tuple[Truth, ...], Fraction] = {}
        for change, p in _distribution(action.factors, state).items():
            values = _successors(change, state)
            key = tuple(values[index] for index in kept)
            before[key] = before.get(key, Fraction(0)) + p
        if action.name not in small.action_by_name:
            assert before == {tuple(part): Fraction(1)}
            continue
        after: dict[tuple[Truth, ...], Fraction] = {}
        smaller = small.action_by_name[action.name]
        for change, p in _distribution(smaller.factors, part).items():
            values = _successors(change, part)
            after[values] = after.get(values, Fraction(0)) + p
        assert after == before
        assert evaluate(smaller.precondition, part) is evaluate(action.precondition, state)
