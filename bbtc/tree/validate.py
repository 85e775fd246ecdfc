"""The rules a tree or a template body must obey, checked when it is made or loaded.

The Skipper rule (only the last child may contain actions) is what makes our simulator,
BehaviorTree.CPP and py_trees agree: with it a tick starts at most one action.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import replace
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.ground.condition import variables
from bbtc.ground.task import (
    Body,
    BodyAction,
    BodyCondition,
    BodyControl,
    BodyTemplate,
    GroundTemplate,
    Task,
    walk_body,
)
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree

MAX_DEPTH = 256
"""Levels a tree may have: what BehaviorTree.CPP reads."""

_SEVERAL_ATTEMPTS = (
    "several attempts stand in one last child: sequence(fallback(attempt, attempt), condition)"
)

ChildPath: TypeAlias = tuple[int, ...]
"""Child numbers from the root of a tree or body down to a node."""


def check_tree(tree: Tree) -> None:
    """Raise :class:`BbtcError` with every rule the tree breaks: ids are unique, control nodes have
    children (of either kind of retry exactly one, and attempts), actions and variables exist in the task,
    only the last child of a Skipper contains actions, no more than :data:`MAX_DEPTH` levels."""
    problems = [replace(each, path=()) for each in tree_problems(tree)]
    if problems:
        raise BbtcError(problems)


def tree_problems(tree: Tree) -> Iterator[Diagnostic]:
    """The rules that the tree breaks, each with the child numbers down to the node."""
    task = tree.task
    ids: set[str] = set()

    def visit(node: Node, path: ChildPath) -> Iterator[Diagnostic]:
        if node.id in ids:
            yield Diagnostic("BBT0607", f"two nodes have the id '{node.id}'", path=path)
        ids.add(node.id)
        match node:
            case ConditionNode():
                if not all(0 <= variable < len(task.variables) for variable in variables(node.condition)):
                    yield Diagnostic(
                        "BBT0606", f"condition '{node.id}' reads a variable the task lacks", path=path
                    )
            case ActionNode():
                if node.action not in task.action_by_name:
                    yield Diagnostic("BBT0606", f"no action is called '{node.action}'", path=path)
            case ControlNode(kind="retry" | "retry-until-success"):
                if node.attempts is None or node.attempts < 1:
                    yield Diagnostic("BBT0613", f"{node.kind} '{node.id}' allows no attempts", path=path)
                if len(node.children) > 1:
                    yield Diagnostic("BBT0613", f"{node.kind} '{node.id}' has more than one child", path=path)
            case ControlNode():
                if node.attempts is not None:
                    yield Diagnostic("BBT0613", f"{node.kind} '{node.id}' counts attempts", path=path)
            case _:
                assert_never(node)

    yield from _visit_node(tree.root, (), visit)


def _visit_node(
    node: Node, path: ChildPath, visit: Callable[[Node, ChildPath], Iterator[Diagnostic]]
) -> Generator[Diagnostic, None, bool]:
    yield from visit(node, path)
    if not isinstance(node, ControlNode):
        return isinstance(node, ActionNode)
    parts = enumerate(node.children)
    children = (_visit_node(child, (*path, number), visit) for number, child in parts)
    return (yield from _visit_children(node, path, f"{node.kind} '{node.id}'", children))


def body_problems(task: Task, template: GroundTemplate, active: Mapping[str, bool]) -> Iterator[Diagnostic]:
    """The rules that a template's body breaks, each with the child numbers down to its part.
    ``active`` tells of each template whether its expansion contains an action (:func:`active_templates`)."""

    def visit(body: Body, path: ChildPath) -> Generator[Diagnostic, None, bool]:
        match body:
            case BodyAction():
                if body.action not in task.action_by_name:
                    yield Diagnostic("BBT0606", f"no action is called '{body.action}'", path=path)
                return True
            case BodyTemplate():
                if body.template not in task.template_by_name:
                    yield Diagnostic("BBT0606", f"no template is called '{body.template}'", path=path)
                return active.get(body.template, False)
            case BodyCondition():
                return False
            case BodyControl():
                children = (visit(child, (*path, number)) for number, child in enumerate(body.children))
                where = f"a {body.kind} of template '{template.name}'"
                return (yield from _visit_children(body, path, where, children))
            case _:
                assert_never(body)

    yield from visit(template.body, ())


def _visit_children(
    parent: ControlNode | BodyControl,
    path: ChildPath,
    name: str,
    children: Iterator[Generator[Diagnostic, None, bool]],
) -> Generator[Diagnostic, None, bool]:
    """Yield the problems of a control node and of its children; return whether it contains an
    action. The depth limit bounds the recursion."""
    if not parent.children:
        yield Diagnostic("BBT0611", f"{name} has no children", path=path)
        return False
    if len(path) + 1 >= MAX_DEPTH:
        yield Diagnostic("BBT0605", f"a tree has at most {MAX_DEPTH} levels", path=path)
        return False
    active = False
    for number, child in enumerate(children):
        child_active = yield from child
        active = active or child_active
        if child_active and parent.kind == "skipper" and number < len(parent.children) - 1:
            yield Diagnostic(
                "BBT0610",
                f"{name} has an action in child {number + 1} of {len(parent.children)}; "
                "only the last child of a Skipper may contain actions",
                hint=_SEVERAL_ATTEMPTS,
                path=(*path, number),
            )
    return active


# --- which templates act ---------------------------------------------------------------------


def active_templates(templates: Mapping[str, GroundTemplate]) -> dict[str, bool]:
    """Of each template: whether its expansion contains an action. Calls of templates that are not
    in the mapping count as none. Raises :class:`BbtcError` if a template calls itself."""
    active: dict[str, bool] = {}
    for first in templates:
        # Depth first, without recursion: a chain of templates may be long.
        chain = {first: _calls(templates[first].body)}
        while chain:
            name = next(reversed(chain))
            pending = chain[name]
            while pending and (pending[-1] in active or pending[-1] not in templates):
                pending.pop()
            if not pending:
                active[name] = _acts(templates[name].body, active)
                del chain[name]
            elif pending[-1] in chain:
                raise BbtcError.single(
                    "BBT0612", f"template '{pending[-1]}' calls itself", templates[name].span
                )
            else:
                chain[pending[-1]] = _calls(templates[pending[-1]].body)
    return active


def _calls(body: Body) -> list[str]:
    return [part.template for part in walk_body(body) if isinstance(part, BodyTemplate)]


def _acts(body: Body, active: Mapping[str, bool]) -> bool:
    return any(
        isinstance(part, BodyAction) or (isinstance(part, BodyTemplate) and active.get(part.template, False))
        for part in walk_body(body)
    )
