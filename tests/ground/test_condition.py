"""Ground conditions: negation, evaluation and the closures compiled from them say the same."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.ground.condition import (
    FALSE,
    TRUE,
    And,
    Condition,
    Is,
    Known,
    Not,
    Or,
    compile_condition,
    conjunction,
    conjuncts,
    disjunction,
    evaluate,
    negation,
    variables,
)
from bbtc.kleene import Truth

T, U, F = Truth.TRUE, Truth.UNKNOWN, Truth.FALSE
_LEAVES = st.one_of(
    st.builds(Is, st.integers(0, 2), st.sampled_from(list(Truth))),
    st.builds(Known, st.integers(0, 2)),
    st.sampled_from([TRUE, FALSE]),
)
CONDITIONS: st.SearchStrategy[Condition] = st.recursive(
    _LEAVES,
    lambda inner: st.one_of(
        st.builds(And, st.lists(inner, max_size=3).map(tuple)),
        st.builds(Or, st.lists(inner, max_size=3).map(tuple)),
        st.builds(Not, inner),
    ),
    max_leaves=8,
)
STATES = st.lists(st.sampled_from(list(Truth)), min_size=3, max_size=3)


@pytest.mark.parametrize(("condition", "opposite"), [(TRUE, FALSE), (FALSE, TRUE)])
def test_the_opposite_of_a_constant(condition: Condition, opposite: Condition) -> None:
    assert negation(condition) == opposite


@given(CONDITIONS, STATES)
def test_a_negation_has_the_opposite_value_in_every_state(condition: Condition, state: list[Truth]) -> None:
    assert evaluate(negation(condition), state) == Truth(2 - evaluate(condition, state))


@given(CONDITIONS, STATES)
def test_a_compiled_condition_has_the_value_of_the_condition(
    condition: Condition, state: list[Truth]
) -> None:
    assert compile_condition(condition)(state) == evaluate(condition, state)


@given(st.lists(CONDITIONS, max_size=4), STATES)
def test_what_is_left_out_of_a_combination_does_not_change_it(
    parts: list[Condition], state: list[Truth]
) -> None:
    assert evaluate(conjunction(parts), state) == min((evaluate(p, state) for p in parts), default=T)
    assert evaluate(disjunction(parts), state) == max((evaluate(p, state) for p in parts), default=F)


def test_repeats_and_constants_are_left_out() -> None:
    a, b = Is(0, T), Is(1, F)
    assert conjunction([a, TRUE, And((b, a))]) == And((a, b))
    assert conjunction([a, TRUE]) == a
    assert conjunction([]) == conjunction([TRUE]) == TRUE
    assert conjunction([a, FALSE]) == FALSE
    assert disjunction([a, FALSE, Or((b, a))]) == Or((a, b))
    assert disjunction([b, TRUE]) == TRUE
    assert disjunction([]) == FALSE


def test_the_parts_of_a_conjunction() -> None:
    a, b = Is(0, T), Or((Is(1, F), Known(2)))
    assert conjuncts(And((a, b))) == (a, b)
    assert conjuncts(b) == (b,)
    assert conjuncts(TRUE) == ()
    assert conjuncts(FALSE) == (FALSE,)


def test_the_variables_a_condition_reads() -> None:
    assert list(variables(And((Is(2, T), Not(Or((Known(0), TRUE))), Is(2, U))))) == [2, 0, 2]
