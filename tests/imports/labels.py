"""Labels, reasons, templates and ids that may be taken for something else in a file."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace

from bbtc.backends.shape import words_of, written
from bbtc.ground.condition import And, Or
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree

LABELS = (
    *(
        "look around",
        "skipper",
        "at most 3 attempts",
        "at most 1 attempt",
        "until blocked",
        "start when ready",
    ),
    *(
        "x #2",
        "#2",
        "a #2 #3",
        "for x",
        "template",
        "template t",
        "<b>&amp;",
        'it\'s "q"',
        "-->",
        "{x}",
        "{=}",
    ),
    *("  spaces  ", "tab\there", "line\nbreak", "", "Sequence", "n1", "\u0085", "\u2028", "\u00a0", "日本"),
    *("\x1b[0m", "a\x00", "true"),
)
TEMPLATES = ("t(a)", "s(b,a)", "", "x", "template", "t #2", "t(a) #2", "(", "t(a,b")
IDS = (*(f"n{number}" for number in range(1, 300)), "a--b", "ü", "-->", "<x>", "x y", '"', "\x07")


def labelled(tree: Tree, rng: random.Random) -> Tree:
    """The tree with other labels and ids, often those that an export would give a node by itself."""
    ids = iter(rng.sample(IDS, len(IDS)))

    def renamed(node: Node) -> Node:
        if isinstance(node, ControlNode):
            node = replace(node, children=tuple(renamed(child) for child in node.children))
        labels = [*LABELS, *list(_own(tree, node)) * 8]
        if rng.random() < 0.5:
            node = replace(node, name=rng.choice(labels))
        if rng.random() < 0.3:
            node = replace(node, reason=rng.choice(labels))
        if rng.random() < 0.2:
            node = replace(node, template=rng.choice([*TEMPLATES, *labels]))
        return replace(node, id=next(ids))

    return replace(tree, root=renamed(tree.root))


def _own(tree: Tree, node: Node) -> Iterator[str]:
    """What an export may call a node, or something of the same look."""
    match node:
        case ConditionNode():
            yield words_of(tree.task, written(tree.task, node.condition)).short
        case ActionNode():
            yield node.action
        case ControlNode():
            parts = tuple(each.condition for each in node.children if isinstance(each, ConditionNode))
            if len(parts) == len(node.children):
                whole = And(parts) if node.kind == "sequence" else Or(parts)
                yield words_of(tree.task, whole).short
                yield words_of(tree.task, written(tree.task, whole)).short
