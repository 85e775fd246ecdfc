"""Programs for model checkers as data."""

from __future__ import annotations

from bbtc.verify.program import AllOf, AnyOf, Compare, Drafting, Negation, Program, written_size


def test_the_written_size_is_that_of_the_text_with_all_formulas_unfolded() -> None:
    """Here `a & b` (3: two atoms and what joins them), and `(a & b) | !(a & b)` (1 + 3 + 1 + 3), twice."""
    a, b, draft = Compare(0, "=", 0), Compare(1, "<", 2), Drafting()
    both = draft.define("t", "both", AllOf((a, b)))
    either = draft.define("t", "either", AnyOf((both, Negation(both))))
    labels = (("all", AllOf((either, either))), ("one", a))
    program = Program("dtmc", "t", (), tuple(draft.formulas), (), labels)
    assert written_size(program) == (1 + 8 + 8) + 1
