"""What is exported is read back as the very same tree: XML of both profiles, and JSON."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given

from bbtc.artefacts import dumps, load_tree, tree_to_json
from bbtc.backends.btcpp.exporter import btcpp
from bbtc.backends.btcpp.reader.xml import tree_from_btcpp
from bbtc.backends.shape import words_of, written
from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.condition import TRUE, And, Is, Or
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.source import SourceFile
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree, walk
from bbtc.tree.validate import check_tree
from tests.backends.test_btcpp import nested
from tests.domains.problems import PROBLEMS, Problem, tree_of
from tests.imports.labels import labelled
from tests.long_form import amount
from tests.profiles import examples
from tests.replay.random_trees import random_tree
from tests.strategies import HOSTILE_NAMES, soda_tree, trees

OPTIONS = [{"nodes": "stock"}, {"nodes": "bbtc"}, {"nodes": "bbtc", "namespace": "my-robot"}]


def exported(tree: Tree, **options: str | bool) -> str:
    return btcpp.export(tree, options, None)


def read(text: str, task: Task, namespace: str = "") -> Tree:
    report = Report()
    tree = tree_from_btcpp(SourceFile("tree.xml", text), task, report, namespace=namespace).tree
    assert not list(report)
    return tree


def without_labels(tree: Tree) -> list[Node]:
    """The nodes in order, without names and reasons."""
    root = without_ids(tree)
    return [replace(node, name=None, template=None, reason=None, **_childless(node)) for node in walk(root)]


def _childless(node: Node) -> dict[str, Any]:
    return {"children": (None,) * len(node.children)} if isinstance(node, ControlNode) else {}


def is_sound(tree: Tree) -> bool:
    try:
        check_tree(tree)
    except BbtcError:
        return False
    return True


def without_ids(tree: Tree) -> Node:
    """What a file without notes shows of a tree: no ids, and conditions as they are written."""

    def plain(node: Node) -> Node:
        node = replace(node, id="")
        if isinstance(node, ControlNode):
            return replace(node, children=tuple(plain(child) for child in node.children))
        if isinstance(node, ConditionNode):
            return replace(node, condition=written(tree.task, node.condition))
        # A precondition that is always true leaves no trace.
        trace = written(tree.task, tree.task.action_by_name[node.action].precondition)
        return replace(node, guarded=node.guarded and trace != TRUE)

    return plain(tree.root)


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_the_tree_of_every_problem_comes_back(problem: Problem) -> None:
    tree = tree_of(problem)
    for options in OPTIONS:
        assert read(exported(tree, **options), tree.task) == tree
    assert load_tree(SourceFile("tree.json", dumps(tree_to_json(tree))), tree.task) == tree


def test_random_trees_come_back() -> None:
    found = seed = 0
    while found < amount(100, 300):
        seed += 1
        tree = random_tree(seed, latched=0.7)
        if not is_sound(tree):
            continue
        found += 1
        tree = replace(tree, bounds=(Fraction(1, 3), Fraction(1, 2)) if seed % 2 else None)
        for options in OPTIONS:
            assert read(exported(tree, **options), tree.task) == tree, seed


ALL_OPTIONS = [
    {"nodes": nodes, "namespace": namespace, "model": model}
    for nodes in ("stock", "bbtc")
    for namespace in ("", "my-robot")
    for model in (True, False)
]


def test_labels_that_look_like_something_else_come_back() -> None:
    found = seed = 0
    while found < amount(60, 5000):
        seed += 1
        rng = random.Random(seed)
        tree = labelled(random_tree(seed, latched=0.6, depth=rng.choice([2, 3, 4])), rng)
        if not is_sound(tree):
            continue
        found += 1
        options = ALL_OPTIONS[seed % len(ALL_OPTIONS)]
        assert read(exported(tree, **options), tree.task) == tree, (seed, options)
        # Without the comment, what is read is what would be written of it, label by label.
        plain = read(exported(tree, notes=False, **options), tree.task, str(options["namespace"]))
        assert read(exported(plain, **options), tree.task) == plain, (seed, options)
        assert without_labels(plain) == without_labels(tree), (seed, options)


@pytest.mark.parametrize("kind", ["sequence", "fallback"])
def test_a_label_that_reads_like_the_condition_of_the_nodes_below_comes_back(kind: ControlKind) -> None:
    tree = soda_tree()
    lit, seen = ConditionNode("n2", Is(0, Truth.TRUE)), ConditionNode("n3", Is(1, Truth.TRUE))
    words = words_of(tree.task, (And if kind == "sequence" else Or)((lit.condition, seen.condition))).short
    root = ControlNode("n1", kind, (lit, seen), words)
    for options in OPTIONS:
        text = exported(replace(tree, root=root), **options)
        assert read(text, tree.task).root == root


def test_without_notes_all_but_ids_and_claims_comes_back() -> None:
    found = seed = 0
    while found < amount(50, 150):
        seed += 1
        tree = random_tree(seed, latched=0.7)
        if not is_sound(tree):
            continue
        found += 1
        for options in OPTIONS:
            text = exported(tree, notes=False, **options)
            back = read(text, tree.task, options.get("namespace", ""))
            assert without_ids(back) == without_ids(tree), seed
            ids = [node.id for node in walk(back.root)]
            assert ids == [f"n{number + 1}" for number in range(len(ids))]


@examples(amount(60, 150))
@given(trees(HOSTILE_NAMES))
def test_hostile_names_and_labels_come_back(tree: Tree) -> None:
    if not is_sound(tree):
        return
    for options in OPTIONS:
        assert read(exported(tree, **options), tree.task) == tree


def flat(tree: Tree) -> list[tuple[Node, int]]:
    """The nodes without their children, each with their number; equality of deep trees is too deep."""
    nodes: list[tuple[Node, int]] = []
    for node in walk(tree.root):
        if isinstance(node, ControlNode):
            nodes.append((replace(node, children=()), len(node.children)))
        else:
            nodes.append((node, 0))
    return nodes


def test_the_deepest_tree_comes_back() -> None:
    tree = nested(249, ("sequence", "fallback", "skipper"))
    assert flat(read(exported(tree), tree.task)) == flat(tree)
    labelled: Node = tree.root
    chain: list[ControlNode] = []
    while isinstance(labelled, ControlNode):
        chain.append(labelled)
        (labelled,) = labelled.children
    for number, node in enumerate(reversed(chain)):
        labelled = replace(node, children=(labelled,), template=f"t{number}()")
    tree = replace(tree, root=labelled)
    for options in OPTIONS:
        assert flat(read(exported(tree, **options), tree.task)) == flat(tree)


def test_the_random_trees_have_every_kind_of_action() -> None:
    actions = [node for seed in range(1, 200) for node in walk(random_tree(seed, latched=0.7).root)]
    kinds = {(node.latched, node.guarded) for node in actions if isinstance(node, ActionNode)}
    assert len(kinds) == 4
