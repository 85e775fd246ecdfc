"""Which facts a running action holds: what it may set itself, as far as the tree reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from typing_extensions import assert_never

from bbtc.backends.interface import guard_of
from bbtc.backends.shape import normal
from bbtc.ground.condition import TRUE, variables
from bbtc.ground.task import Task, may_set
from bbtc.tree.nodes import (
    ActionNode,
    ConditionNode,
    ControlNode,
    Node,
    Tree,
    retries_until_success_of,
    walk,
)


def held_by(tree: Tree) -> Mapping[str, tuple[int, ...]]:
    """By action: the variables that the tree reads as they were, from the tick that starts the action until
    it ends. Actions that hold nothing are missing.

    What is read, by conditions and guards, only to the right of a node decides nothing while its action runs:
    a tick gets there only where it has passed the node by, and starts and ends nothing then. That is so but
    for what retry-until-success nodes count. So a variable that stands to the right of all that set it is
    held only where there is such a node.
    """
    task = tree.task
    nodes = list(walk(tree.root))
    own = {node.action: _own(tree, node.action) for node in nodes if isinstance(node, ActionNode)}
    read: set[int] = set()
    if any(True for _ in retries_until_success_of(tree.root)):
        read.update(*(_read(task, node) for node in nodes))
    held: set[int] = set()
    for node in nodes:
        if isinstance(node, ActionNode):
            held |= own[node.action] & read
        read.update(_read(task, node))
    found = {action: tuple(sorted(held & may)) for action, may in own.items()}
    return {action: facts for action, facts in found.items() if facts}


def _own(tree: Tree, name: str) -> frozenset[int]:
    """What an action holds of all variables: what it may set or make known, or everything."""
    action = tree.task.action_by_name[name]
    if action.uninterruptible:
        return frozenset(range(len(tree.task.variables)))
    parts = () if tree.monitor is None else tree.monitor.parts
    told = (part.known for part in parts if any(move.action == name for move in part.moves))
    return may_set(tree.task, action).union(*told)


def _read(task: Task, node: Node) -> Iterator[int]:
    """The variables that a node reads by itself."""
    match node:
        case ConditionNode():
            yield from variables(normal(task, node.condition))
        case ActionNode():
            yield from variables(guard_of(task, node) or TRUE)
        case ControlNode():
            pass
        case _:
            assert_never(node)


def held_in(tree: Tree) -> frozenset[int]:
    """The variables that any action of a tree holds."""
    return frozenset(variable for held in held_by(tree).values() for variable in held)
