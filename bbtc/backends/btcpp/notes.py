"""The comment at the end of an exported file that lets ``bbtc import`` read the very same tree.

A file can do without it: nodes, actions and conditions are read from the file itself. The comment
tells what nodes of BehaviorTree.CPP have no place for: the ids of our nodes, the planner's claim, and
the labels and conditions that the file shows in another form. What no longer fits the file, because
it was edited, does not count.

It is JSON: ``ids`` in the order of the file, SubTrees in place, with the kind of each node in ``kinds``,
which shows where the file was edited; ``nodes`` with what a node cannot show, by id; ``symbols`` with
the predicate or action behind each id; ``objects`` with the names behind values of ports, where they
differ.
"""

from __future__ import annotations

import hashlib
import json
import re
import textwrap
from collections.abc import Mapping

from typing_extensions import assert_never

from bbtc.backends.btcpp.idioms import SKIPPER_LABEL, is_retry_label
from bbtc.backends.btcpp.names import BtcppNames, shown, without_number
from bbtc.backends.shape import words_of, written
from bbtc.ground.condition import TRUE, And, Condition, Or
from bbtc.ground.describe import condition_as_lists
from bbtc.ground.task import Task
from bbtc.rounding import figure_text
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree, walk

MARK = " bbtc import reads here what the file cannot show:"
"""The first line of the comment."""

TEMPLATE = "template"
"""The first word of the description of a BehaviorTree that stands for a template."""

CLAIM = "succeeds with probability "
DIGITS = 300
"""How many digits the parts of a claim may have that is written, and read, exactly."""
"""What stands before the claimed figure in the description of the main tree."""

VERSION = 1
_WIDTH = 100


def notes(tree: Tree, root: Node, names: BtcppNames) -> str:
    """The text of the comment for a tree. ``root`` is its root as it is written."""
    content: dict[str, object] = {
        "version": VERSION,
        "domain": tree.task.domain,
        "problem": tree.task.problem,
        "success_probability": figure_text(tree.success_probability),
        "target": figure_text(tree.target),
        "status": tree.status,
    }
    if tree.bounds is not None:
        content["bounds"] = [figure_text(bound) for bound in tree.bounds]
    if names.namespace:
        content["namespace"] = names.namespace
    content["kinds"] = "".join(kind_of(tree.task, node) for node in walk(root))
    content["ids"] = [node.id for node in walk(root)]
    exact = {node.id: found for node in walk(root) if (found := _exact(tree.task, node))}
    if exact:
        content["nodes"] = exact
    content["symbols"] = {
        name: [symbol.kind, symbol.name, symbol.arity] for symbol, name in names.ids.items()
    }
    objects = {value: name for name, value in names.values.items() if value != name}
    if objects:
        content["objects"] = objects
    return "\n".join([MARK, *_lines(content), "  "])


_LETTERS: dict[ControlKind, str] = {
    "sequence": "S",
    "fallback": "F",
    "skipper": "K",
    "retry": "R",
    "retry-until-success": "U",
}


def kind_of(task: Task, node: Node) -> str:
    """A letter for the kind of a node, and for a leaf three digits that tell it from most others."""
    match node:
        case ControlNode(kind=kind):
            return _LETTERS[kind]
        case ConditionNode():
            return f"c{_digits(words_of(task, written(task, node.condition)).full)}"
        case ActionNode():
            return f"a{_digits(node.action)}"
        case _:
            assert_never(node)


KIND = re.compile("[SFKRU]|[ca][0-9a-f]{3}")
"""What :func:`kind_of` makes."""


def _digits(text: str) -> str:
    return hashlib.sha256(text.encode(errors="replace")).hexdigest()[:3]


def condition_below(task: Task, node: Node) -> Condition | None:
    """The condition that a sequence or fallback reads as where nothing else is below it; its own name must
    not be that of the condition then."""
    match node:
        case ConditionNode():
            return written(task, node.condition)
        case ControlNode(kind="sequence" | "fallback", children=children):
            parts = [condition_below(task, child) for child in children]
            found = tuple(part for part in parts if part is not None)
            if len(found) < len(parts):
                return None
            return And(found) if node.kind == "sequence" else Or(found)
        case ControlNode() | ActionNode():
            return None
        case _:
            assert_never(node)


def template_label(template: str) -> str:
    """The name of a SubTree that stands for a template; never empty, which the engine would take for the
    name of the main tree."""
    return shown(template) or TEMPLATE


def _exact(task: Task, node: Node) -> dict[str, object]:
    """What reading the file would give a node in another form."""
    found: dict[str, object] = {}
    default = None
    match node:
        case ControlNode():
            default = SKIPPER_LABEL if node.kind == "skipper" else None
            if node.name and condition_below(task, node) is not None:
                default = node.name  # which may not be written
        case ConditionNode():
            condition = written(task, node.condition)
            default = words_of(task, condition).short
            if condition != node.condition:
                found["condition"] = condition_as_lists(node.condition, task.variables)
        case ActionNode():
            default = shown(node.action)
            if node.guarded and written(task, task.action_by_name[node.action].precondition) == TRUE:
                found["guarded"] = True
        case _:
            assert_never(node)
    if node.name is not None and not _reads_back(node.name, default):
        found["name"] = node.name
    if node.template is not None and without_number(template_label(node.template)) != node.template:
        found["template"] = node.template
    if node.reason is not None and (shown(node.reason) != node.reason or not node.reason):
        found["reason"] = node.reason
    return found


def _reads_back(name: str, default: str | None) -> bool:
    return (
        bool(name)
        and without_number(shown(name)) == name
        and name != default
        and not (default is None and is_retry_label(name))
    )


def _lines(content: Mapping[str, object]) -> list[str]:
    """The JSON, a member a line, long lists wrapped; without two hyphens in a row, which would end the
    comment."""
    lines = []
    for number, (key, value) in enumerate(content.items()):
        text = json.dumps(value).replace("--", "-\\u002d")
        start = f"{'{' if number == 0 else ' '}{json.dumps(key)}: "
        end = "}" if number == len(content) - 1 else ","
        if isinstance(value, list) and len(text) > _WIDTH and " " not in "".join(map(str, value)):
            wrapped = textwrap.wrap(
                text, _WIDTH, break_long_words=False, break_on_hyphens=False, subsequent_indent="   "
            )
            lines += [f"{start}{wrapped[0]}", *wrapped[1:]]
            lines[-1] += end
        else:
            lines.append(f"{start}{text}{end}")
    return [f"    {line}" for line in lines]
