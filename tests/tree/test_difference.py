"""The alignment of two trees: it tells both of them, and no alignment is cheaper."""

from __future__ import annotations

import functools
from collections.abc import Hashable

from hypothesis import given
from hypothesis import strategies as st

from bbtc.ground.condition import Is
from bbtc.kleene import Truth
from bbtc.tree.difference import Difference, counts, differences, walk_differences
from bbtc.tree.nodes import ConditionNode, ControlKind, ControlNode, Node, walk
from tests.profiles import examples

KINDS: list[ControlKind] = ["sequence", "fallback"]


def key(node: Node) -> Hashable:
    return (
        node.kind
        if isinstance(node, ControlNode)
        else node.condition
        if isinstance(node, ConditionNode)
        else 0
    )


LEAVES: st.SearchStrategy[Node] = st.builds(
    ConditionNode, st.just("x"), st.builds(Is, st.integers(0, 2), st.just(Truth.TRUE))
)
TREES: st.SearchStrategy[Node] = st.recursive(
    LEAVES,
    lambda inner: st.builds(
        ControlNode, st.just("x"), st.sampled_from(KINDS), st.lists(inner, min_size=1, max_size=3).map(tuple)
    ),
    max_leaves=7,
)


def shape(node: Node) -> Hashable:
    """A tree without its ids."""
    return key(node), tuple(shape(child) for child in node.children) if isinstance(node, ControlNode) else ()


def side(difference: Difference, new: bool) -> list[Hashable]:
    """What an alignment says one of the trees is; nothing where it says that the node is not in it."""
    node = difference.new if new else difference.old
    if node is None:
        return [part for child in difference.children for part in side(child, new)]
    if difference.mark != "changed":
        return [shape(node)]
    return [(key(node), tuple(part for child in difference.children for part in side(child, new)))]


def cheapest(old: Node, new: Node) -> float:
    """The least cost of a top-down alignment, tried out: 2 a node added or removed, 1 a relabelled one."""
    if not (isinstance(old, ControlNode) and isinstance(new, ControlNode)):
        return 0 if shape(old) == shape(new) else float("inf")

    @functools.cache
    def rest(i: int, j: int) -> float:
        moves = [0.0] if i == len(old.children) and j == len(new.children) else []
        if i < len(old.children):
            moves.append(2 * sum(1 for _ in walk(old.children[i])) + rest(i + 1, j))
        if j < len(new.children):
            moves.append(2 * sum(1 for _ in walk(new.children[j])) + rest(i, j + 1))
        if i < len(old.children) and j < len(new.children):
            moves.append(cheapest(old.children[i], new.children[j]) + rest(i + 1, j + 1))
        return min(moves)

    return (key(old) != key(new)) + rest(0, 0)


@given(TREES)
def test_a_tree_does_not_differ_from_itself(tree: Node) -> None:
    found = differences(tree, tree, key, key)
    assert found.mark == "same"
    assert counts(found) == (0, 0, 0)


@examples(300)
@given(TREES, TREES)
def test_the_alignment_tells_both_trees_at_the_least_cost(old: Node, new: Node) -> None:
    found = differences(old, new, key, key)
    assert side(found, new=False) == [shape(old)]
    assert side(found, new=True) == [shape(new)]
    added, removed, relabelled = counts(found)
    everything = 2 * sum(1 for tree in (old, new) for _ in walk(tree))
    assert 2 * (added + removed) + relabelled == min(cheapest(old, new), everything)


def test_large_and_deep_trees_end() -> None:
    def wide(count: int, offset: int) -> Node:
        leaves = tuple(ConditionNode("x", Is(offset + i, Truth.TRUE)) for i in range(count))
        return ControlNode("x", "sequence", leaves)

    found = differences(wide(3000, 0), wide(3000, 3000), key, key)
    assert counts(found) == (3000, 3000, 0)
    deep: list[Node] = [wide(1, 0), wide(1, 1)]
    for _ in range(400):
        deep = [ControlNode("x", "fallback", (tree,)) for tree in deep]
    assert counts(differences(deep[0], deep[1], key, key))[2] == 0
    assert sum(each.mark == "same" for each in walk_differences(differences(deep[0], deep[0], key, key))) == 1
