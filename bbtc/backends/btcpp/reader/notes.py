"""The notes that exported BehaviorTree.CPP files end with (:mod:`bbtc.backends.btcpp.notes`), read again."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, get_args

from bbtc.artefacts.conditions import condition_from_json
from bbtc.artefacts.cursor import At
from bbtc.artefacts.numbers import parse_number
from bbtc.backends.btcpp.names import shown, without_number
from bbtc.backends.btcpp.notes import KIND, MARK, VERSION, kind_of, template_label
from bbtc.backends.btcpp.reader.leaves import FileNames
from bbtc.backends.btcpp.xmltext import XmlDocument
from bbtc.backends.names import Kind, Symbol
from bbtc.backends.shape import written
from bbtc.diagnostics import Unreadable
from bbtc.ground.condition import TRUE
from bbtc.ground.task import Task
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, PlanStatus, Tree, walk

_KINDS: Mapping[str, Kind] = {"predicate": "predicate", "function": "function", "action": "action"}
_STATUSES: Mapping[str, PlanStatus] = {status: status for status in get_args(PlanStatus)}
_NUMBERED_ID = re.compile(r"n([0-9]{1,9})")


@dataclass(frozen=True, slots=True)
class Notes:
    """What a file says of the tree it was written from."""

    domain: str | None = None
    problem: str | None = None
    success_probability: Fraction | None = None
    target: Fraction | None = None
    status: PlanStatus = "stuck"
    bounds: tuple[Fraction, Fraction] | None = None
    names: FileNames = field(default_factory=lambda: FileNames("", {}, {}))
    kinds: tuple[str, ...] = ()
    ids: tuple[str, ...] = ()
    nodes: Mapping[str, Mapping[str, object]] = field(default_factory=dict)


def read_notes(document: XmlDocument, namespace: str) -> Notes | None:
    """The notes of a file; empty ones if it has none, None if they cannot be read. ``namespace`` is used
    where they name none."""
    texts = [text for text in document.comments if text.startswith(MARK)]
    if not texts:
        return Notes(names=FileNames(namespace, {}, {}))
    try:
        return _notes(json.loads(texts[-1][len(MARK) :]), namespace)
    except (ValueError, TypeError, KeyError, RecursionError, Unreadable):
        return None


def _notes(content: Any, namespace: str) -> Notes:
    if content["version"] != VERSION:
        raise ValueError("another version")
    symbols = {
        str(name): Symbol(_KINDS[kind], str(word), int(arity))
        for name, (kind, word, arity) in content["symbols"].items()
    }
    objects = {str(value): str(name) for value, name in content.get("objects", {}).items()}
    bounds = [_probability(bound) for bound in content.get("bounds", [])]
    ids = tuple(str(name) for name in content["ids"])
    kinds = tuple(KIND.findall(str(content["kinds"])))
    if len(kinds) != len(ids) or len(set(ids)) < len(ids) or (bounds and len(bounds) != 2):
        raise ValueError("not of one piece")
    nodes = {str(name): dict(found) for name, found in content.get("nodes", {}).items()}
    return Notes(
        domain=str(content["domain"]),
        problem=str(content["problem"]),
        success_probability=_probability(content["success_probability"]),
        target=_probability(content["target"]),
        status=_STATUSES[content["status"]],
        bounds=(bounds[0], bounds[1]) if bounds else None,
        names=FileNames(str(content.get("namespace", namespace)), symbols, objects),
        kinds=kinds,
        ids=ids,
        nodes=nodes,
    )


def _probability(text: object) -> Fraction:
    value = parse_number(str(text))
    if not 0 <= value <= 1:
        raise ValueError("not a probability")
    return value


def with_notes(tree: Tree, notes: Notes) -> Tree:
    """The tree with the ids that the notes give its nodes, and with what the file could not show, where
    that still fits. Nodes that were added get new ids."""
    nodes = list(walk(tree.root))
    names = _ids([kind_of(tree.task, node) for node in nodes], notes)
    ids = {id(node): name for node, name in zip(nodes, names, strict=True)}
    return replace(tree, root=_identified(tree.task, tree.root, ids, notes))


def _ids(kinds: Sequence[str], notes: Notes) -> Sequence[str]:
    """An id for each node in the order of the file: those of the notes for the nodes before and after
    what was edited, new ones between."""
    before = 0
    most = min(len(kinds), len(notes.kinds))
    while before < most and kinds[before] == notes.kinds[before]:
        before += 1
    after = 0
    while after < most - before and kinds[-1 - after] == notes.kinds[-1 - after]:
        after += 1
    numbers = [int(found.group(1)) for name in notes.ids if (found := _NUMBERED_ID.fullmatch(name))]
    first = max(numbers, default=0) + 1
    new = [f"n{first + offset}" for offset in range(len(kinds) - before - after)]
    return [*notes.ids[:before], *new, *notes.ids[len(notes.ids) - after :]]


def _identified(task: Task, root: Node, ids: Mapping[int, str], notes: Notes) -> Node:
    # Bottom-up and iterative, as trees may be deep.
    done: dict[int, Node] = {}
    for node in reversed(list(walk(root))):
        new = replace(node, id=ids[id(node)])
        if isinstance(node, ControlNode) and isinstance(new, ControlNode):
            new = replace(new, children=tuple(done[id(child)] for child in node.children))
        done[id(node)] = _exact(task, new, notes.nodes.get(new.id, {}))
    return done[id(root)]


def _exact(task: Task, node: Node, note: Mapping[str, object]) -> Node:
    """The node with what its note says of it, as far as the file shows the same."""
    name, reason, template = note.get("name"), note.get("reason"), note.get("template")
    if isinstance(name, str) and _shows(node.name, name):
        node = replace(node, name=name)
    if isinstance(reason, str) and node.reason == (shown(reason) or None):
        node = replace(node, reason=reason)
    if isinstance(template, str) and node.template == without_number(template_label(template)):
        node = replace(node, template=template)
    if isinstance(node, ConditionNode) and "condition" in note:
        try:
            condition = condition_from_json(At(note["condition"]), task.variable_index, task.number_by_name)
        except Unreadable:
            return node
        if written(task, condition) == node.condition:
            node = replace(node, condition=condition)
    if isinstance(node, ActionNode) and note.get("guarded") is True:
        guard = written(task, task.action_by_name[node.action].precondition)
        node = replace(node, guarded=node.guarded or guard == TRUE)
    return node


def _shows(read: str | None, name: str) -> bool:
    """Whether a name is shown in a form that reads as another, or as none."""
    return read is None or read == without_number(shown(name))
