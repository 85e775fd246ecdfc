"""The tree as JSON, in and out. Fields are documented in ``docs/artefacts.md``.

A tree carries its task, without the actions it does not use and without the templates, so that
it can be simulated and exported on its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import get_args

from typing_extensions import assert_never

from bbtc.artefacts.bodies_json import at_node, children_at, kind_at
from bbtc.artefacts.conditions import condition_from_json, condition_to_json
from bbtc.artefacts.cursor import At, Faults, run_reader
from bbtc.artefacts.numbers import figure_text, given_text
from bbtc.artefacts.task_json import (
    Json,
    check_header,
    read_task,
    task_to_json,
)
from bbtc.diagnostics import Unreadable
from bbtc.durations import LONGEST
from bbtc.ground.condition import TRUE
from bbtc.ground.task import Task
from bbtc.source import SourceFile
from bbtc.tree.nodes import (
    COUNTING,
    ActionNode,
    ConditionNode,
    ControlKind,
    ControlNode,
    Node,
    PlanStatus,
    SuccessBy,
    Tree,
    actions_of,
)
from bbtc.tree.validate import tree_problems

FORMAT = "bbtc-tree"
VERSION = 1

_CONTROLS: Mapping[str, ControlKind] = {kind: kind for kind in get_args(ControlKind)}
_STATUSES: Mapping[str, PlanStatus] = {status: status for status in get_args(PlanStatus)}
_LABELS = ("name", "template", "reason")
_BOUNDS = ("lower", "upper")

# --- out -------------------------------------------------------------------------------------


def carried(tree: Tree) -> Tree:
    """The tree with as much of its task as it carries along."""
    used = {node.action for node in actions_of(tree.root)}

    def part(task: Task) -> Task:
        actions = tuple(action for action in task.actions if action.name in used)
        origin = None if task.origin is None else part(task.origin)
        return replace(task, actions=actions, templates=(), origin=origin)

    return replace(tree, task=part(tree.task))


def tree_to_json(tree: Tree) -> Json:
    """The tree as a JSON object."""
    task = carried(tree).task
    value: Json = {
        "format": FORMAT,
        "version": VERSION,
        "domain": task.domain,
        "problem": task.problem,
        "success_probability": figure_text(tree.success_probability),
        "target": given_text(tree.target),
        "status": tree.status,
    }
    if tree.bounds is not None:
        value["bounds"] = dict(zip(_BOUNDS, map(figure_text, tree.bounds), strict=True))
    if tree.success_by is not None:
        by = tree.success_by
        ends = {"at_least": figure_text(by.at_least), "at_most": figure_text(by.at_most)}
        value["success_by"] = {"seconds": given_text(by.seconds), **ends}
    return value | {"root": _node_to_json(tree.root, task), "task": task_to_json(task)}


def _node_to_json(node: Node, task: Task) -> Json:
    value: Json = {"id": node.id}
    match node:
        case ControlNode():
            value["type"] = node.kind
            if node.attempts is not None:
                value["attempts"] = node.attempts
        case ConditionNode():
            value |= {"type": "condition", "condition": condition_to_json(node.condition, task.variables)}
        case ActionNode():
            value |= {"type": "action", "action": node.action, "latched": node.latched}
            if node.guarded:
                value["guarded"] = True
        case _:
            assert_never(node)
    for label in _LABELS:
        text = getattr(node, label)
        if text is not None:
            value[label] = text
    if isinstance(node, ControlNode):
        value["children"] = [_node_to_json(child, task) for child in node.children]
    return value


# --- in --------------------------------------------------------------------------------------


def tree_from_json(value: object, task: Task | None = None, source: SourceFile | None = None) -> Tree:
    """Inverse of :func:`tree_to_json`. The task is the one given, or else the one the tree carries.
    Raises :class:`~bbtc.diagnostics.BbtcError` with everything that is wrong; ``source`` is the
    text the value came from, for the places."""
    return run_reader(lambda faults: _read_tree(At(value), task, faults), source)


def _read_tree(at: At, task: Task | None, faults: Faults) -> Tree:
    check_header(at, FORMAT, VERSION)
    members = at.members(
        ["format", "version", "domain", "problem", "success_probability", "status", "root"],
        ["target", "bounds", "success_by", "task"],
    )
    if task is None:
        if "task" not in members:
            raise at.fault("BBT0609", "the tree carries no task", "give its domain and problem with it")
        task = read_task(members["task"], faults)
        faults.stop_if_any()
    reader = _Reader(task, faults)
    root = reader.node(members["root"], 1)
    tree = Tree(
        task,
        root,
        faults.attempt(members["success_probability"].probability, Fraction(0)),
        faults.attempt(
            lambda: members["target"].given_probability() if "target" in members else task.goal_probability,
            Fraction(1),
        ),
        faults.attempt(lambda: _STATUSES[members["status"].word(*_STATUSES)], "stuck"),
        faults.attempt(lambda: _bounds(members["bounds"]) if "bounds" in members else None, None),
        success_by=faults.attempt(lambda: _success_by(members.get("success_by")), None),
    )
    for field, expected in (("domain", task.domain), ("problem", task.problem)):
        if faults.attempt(members[field].string, expected) != expected:
            faults.add(members[field].found("BBT0604", f"the tree's task is of the {field} '{expected}'"))
    faults.stop_if_any()
    for problem in tree_problems(tree):
        faults.add(at_node(problem, members["root"].path))
    return tree


def _success_by(at: At | None) -> SuccessBy | None:
    if at is None:
        return None
    members = at.members(["seconds", "at_least", "at_most"])
    seconds = members["seconds"].given()
    if not 0 < seconds <= LONGEST:
        raise members["seconds"].fault("BBT0604", "a deadline is a number of seconds above 0")
    least, most = members["at_least"].probability(), members["at_most"].probability()
    if least > most:
        raise at.fault("BBT0604", "the lower bound is above the upper one")
    return SuccessBy(seconds, least, most)


def _bounds(at: At) -> tuple[Fraction, Fraction]:
    members = at.members(_BOUNDS)
    lower, upper = (members[end].probability() for end in _BOUNDS)
    if lower > upper:
        raise at.fault("BBT0604", "the lower bound is above the upper one")
    return lower, upper


@dataclass(frozen=True, slots=True)
class _Reader:
    task: Task
    faults: Faults

    def node(self, at: At, level: int) -> Node:
        """The node; where it has a fault, that goes on record and any node stands in for it."""
        try:
            kind = kind_at(at, *_CONTROLS, "condition", "action")
            if kind in _CONTROLS:
                return self._control(at, level, _CONTROLS[kind])
            return self._action(at) if kind == "action" else self._condition(at)
        except Unreadable as fault:
            self.faults.add(fault.diagnostic)
            return ConditionNode("", TRUE)

    def _control(self, at: At, level: int, kind: ControlKind) -> ControlNode:
        required = ["id", "type", "children", *(["attempts"] if kind in COUNTING else [])]
        members = at.members(required, _LABELS)
        attempts = members["attempts"].count() if kind in COUNTING else None
        name = members["id"].string()
        children: list[Node] = []
        for child in children_at(members["children"], level):  # a loop: few frames for each level
            children.append(self.node(child, level + 1))  # noqa: PERF401
        label, template, reason = _labels(members)
        return ControlNode(name, kind, tuple(children), label, template, reason, attempts)

    def _condition(self, at: At) -> ConditionNode:
        members = at.members(["id", "type", "condition"], _LABELS)
        condition = condition_from_json(
            members["condition"], self.task.variable_index, self.task.number_by_name
        )
        return ConditionNode(members["id"].string(), condition, *_labels(members))

    def _action(self, at: At) -> ActionNode:
        members = at.members(["id", "type", "action"], ["latched", "guarded", *_LABELS])
        latched = "latched" not in members or members["latched"].flag()
        guarded = "guarded" in members and members["guarded"].flag()
        return ActionNode(
            members["id"].string(), members["action"].string(), latched, guarded, *_labels(members)
        )


def _labels(members: Mapping[str, At]) -> list[str | None]:
    return [members[label].string() if label in members else None for label in _LABELS]
