"""Programs for model checkers as data."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

from bbtc.backends.models.prism import prism
from bbtc.ground.condition import TRUE, Is
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Tree
from bbtc.verifier.chain import chain_of
from bbtc.verifier.program import (
    NO,
    YES,
    AllOf,
    AnyOf,
    Branch,
    Charged,
    Command,
    Compare,
    Drafting,
    Negation,
    Program,
    all_of,
    any_of,
    none_of,
    written_size,
)
from tests.planner.test_refine import action, task
from tests.strategies import soda_tree

HALF = Fraction(1, 2)


def test_a_small_tree_is_written_by_the_guards_of_its_leaves_a_large_one_by_its_walk() -> None:
    tree = soda_tree()
    guards, walk = (chain_of(tree.task, tree.root, form) for form in ("guards", "walk"))
    assert guards != walk
    assert chain_of(tree.task, tree.root) == guards
    assert chain_of(tree.task, tree.root, most_written=written_size(guards)) == guards
    assert chain_of(tree.task, tree.root, most_written=written_size(guards) - 1) == walk


def test_the_written_size_is_that_of_the_text_with_all_formulas_unfolded() -> None:
    """Here `a & b` (3: two atoms and what joins them), and `(a & b) | !(a & b)` (1 + 3 + 1 + 3), twice."""
    a, b, draft = Compare(0, "=", 0), Compare(1, "<", 2), Drafting()
    both = draft.define("t", "both", AllOf((a, b)))
    either = draft.define("t", "either", AnyOf((both, Negation(both))))
    labels = (("all", AllOf((either, either))), ("one", a))
    program = Program("dtmc", "t", (), tuple(draft.formulas), (), labels)
    assert written_size(program) == (1 + 8 + 8) + 1


def test_no_formula_is_written_that_nothing_reads() -> None:
    """Here a part of the tree has conditions only: no action asks whether it is ticked."""
    goal, T = Is(0, Truth.TRUE), Truth.TRUE
    of = task("done ready", {1: T}, goal, action("act", TRUE, ("1/2", {0: T}), ("1/2", {})))
    done = ControlNode("n2", "sequence", (ConditionNode("n3", goal), ConditionNode("n4", Is(1, T))))
    acting = ControlNode("n5", "sequence", (ActionNode("n6", "act()"), ConditionNode("n7", goal)))
    again = ControlNode("n8", "sequence", (ActionNode("n9", "act()"), ConditionNode("n10", goal)))
    root = ControlNode("n1", "fallback", (acting, done, again))
    for tree in (Tree(of, root, HALF, HALF, "stuck"), soda_tree()):
        text = prism.export(tree, {"form": "guards"}, None)
        names = re.findall(r"^formula (\S+) =", text, re.MULTILINE)
        assert names
        assert [name for name in names if len(re.findall(rf"\b{re.escape(name)}\b", text)) < 2] == []


def test_what_says_nothing_is_not_written() -> None:
    a, b = Compare(0, "=", 0), Compare(1, "<", 2)
    assert (any_of(a, b, none_of(a)), all_of(a, b, none_of(a))) == (YES, NO)
    assert (any_of(a, YES), all_of(a, NO)) == (YES, NO)
    assert (any_of(a, NO), all_of(a, YES), any_of(), all_of()) == (a, a, NO, YES)
    assert (any_of(a, any_of(b, a)), all_of(a, all_of(b, a))) == (AnyOf((a, b)), AllOf((a, b)))
    assert any_of(a, AllOf((b, none_of(a)))) == AnyOf((a, b))


@pytest.mark.parametrize("number", [2, 20])
def test_the_least_that_is_added_counts_what_takes_away(number: int) -> None:
    """However many conditions there are to it, of which some add."""
    amounts = [Fraction(-3), *(Fraction(1) for _ in range(number)), Fraction(-2)]
    charges = [Charged(Compare(i, "=", 1), (amount,)) for i, amount in enumerate(amounts)]
    branch = Branch(Fraction(1), (), (Fraction(7),), tuple(charges))
    assert Command("act", YES, (branch,)).least(0) == 7 - 3 - 2
    both = Charged(none_of(Compare(0, "=", 1)), (Fraction(-1),))
    either = Branch(Fraction(1), (), (Fraction(0),), (charges[0], both))
    assert Command("act", YES, (either,)).least(0) == -3, "never both"
