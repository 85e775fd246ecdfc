"""Programs for model checkers as data."""

from __future__ import annotations

from bbtc.verifier.program import (
    NO,
    YES,
    AllOf,
    AnyOf,
    Compare,
    Drafting,
    Negation,
    Program,
    all_of,
    any_of,
    none_of,
    written_size,
)


def test_the_written_size_is_that_of_the_text_with_all_formulas_unfolded() -> None:
    """Here `a & b` (3: two atoms and what joins them), and `(a & b) | !(a & b)` (1 + 3 + 1 + 3), twice."""
    a, b, draft = Compare(0, "=", 0), Compare(1, "<", 2), Drafting()
    both = draft.define("t", "both", AllOf((a, b)))
    either = draft.define("t", "either", AnyOf((both, Negation(both))))
    labels = (("all", AllOf((either, either))), ("one", a))
    program = Program("dtmc", "t", (), tuple(draft.formulas), (), labels)
    assert written_size(program) == (1 + 8 + 8) + 1


def test_what_says_nothing_is_not_written() -> None:
    a, b = Compare(0, "=", 0), Compare(1, "<", 2)
    assert (any_of(a, b, none_of(a)), all_of(a, b, none_of(a))) == (YES, NO)
    assert (any_of(a, YES), all_of(a, NO)) == (YES, NO)
    assert (any_of(a, NO), all_of(a, YES), any_of(), all_of()) == (a, a, NO, YES)
    assert (any_of(a, any_of(b, a)), all_of(a, all_of(b, a))) == (AnyOf((a, b)), AllOf((a, b)))
    assert any_of(a, AllOf((b, none_of(a)))) == AnyOf((a, b))
