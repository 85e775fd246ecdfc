"""The words that have a meaning of their own in the language, and where."""

from __future__ import annotations

FORM_WORDS = frozenset(
    (
        *("and", "or", "not", "imply", "when", "forall", "exists", "oneof", "probabilistic", "either"),
        *("increase", "decrease", "assign", "scale-up", "scale-down", "preference"),
    )
)
"""Words that head a form, and no flat atom: ``_ATOM_HEAD`` in the grammar."""
BODY_WORDS = frozenset(("sequence", "fallback", "skipper", "condition", "foreach", "action"))
"""Words that head a form in the body of a template."""
TEST_WORDS = frozenset(("known", "unknown"))
"""Words that head the test of a fact, and may name a predicate."""
