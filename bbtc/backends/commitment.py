"""Which facts a running action holds: what it may set itself, as far as the tree reads it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.backends.interface import guard_of
from bbtc.backends.shape import normal
from bbtc.ground.condition import TRUE, Condition, Within, leaves, numbers_read
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

Fact: TypeAlias = int | Within
"""What a leaf of a condition asks for: a variable, or whether a number is within bounds."""


def held_by(tree: Tree) -> Mapping[str, tuple[Fact, ...]]:
    """By action: the facts that the tree reads as they were, from the tick that starts the action until
    it ends. Actions that hold nothing are missing.

    What is read, by conditions and guards, only to the right of a node decides nothing while its action runs:
    a tick gets there only where it has passed the node by, and starts and ends nothing then. That is so but
    for what retry-until-success nodes count. So a fact that stands to the right of all that set it is
    held only where there is such a node.
    """
    task = tree.task
    nodes = list(walk(tree.root))
    own = {node.action: _own(tree, node.action) for node in nodes if isinstance(node, ActionNode)}
    read: set[Fact] = set()
    if any(True for _ in retries_until_success_of(tree.root)):
        read.update(*(_read(task, node) for node in nodes))
    held: set[Fact] = set()
    for node in nodes:
        if isinstance(node, ActionNode):
            held |= {fact for fact in read if _sets(own[node.action], fact)}
        read.update(_read(task, node))
    ordered = sorted(held, key=_order)
    found = {action: tuple(fact for fact in ordered if _sets(may, fact)) for action, may in own.items()}
    return {action: facts for action, facts in found.items() if facts}


def first_variable(fact: Fact) -> int:
    """The variable that a leaf is named for."""
    return fact if isinstance(fact, int) else fact.digits[0]


def facts_read(task: Task, condition: Condition) -> Iterator[Fact]:
    """What the leaves of a condition in normal form ask for, repeats included."""
    for leaf in leaves(condition):
        if task.variables[leaf.variable].digit is None:
            yield leaf.variable
    yield from numbers_read(condition)


def _order(fact: Fact) -> tuple[int, int, int]:
    return (fact, 0, 0) if isinstance(fact, int) else (fact.digits[0], fact.low, fact.high)


def _sets(own: frozenset[int], fact: Fact) -> bool:
    return fact in own if isinstance(fact, int) else not own.isdisjoint(fact.digits)


def _own(tree: Tree, name: str) -> frozenset[int]:
    """What an action holds of all variables: what it may set or make known, or everything."""
    action = tree.task.action_by_name[name]
    if action.uninterruptible:
        return frozenset(range(len(tree.task.variables)))
    parts = () if tree.monitor is None else tree.monitor.parts
    told = (part.known for part in parts if any(move.action == name for move in part.moves))
    return may_set(tree.task, action).union(*told)


def _read(task: Task, node: Node) -> Iterator[Fact]:
    """The facts that a node reads by itself."""
    match node:
        case ConditionNode():
            yield from facts_read(task, normal(task, node.condition))
        case ActionNode():
            yield from facts_read(task, guard_of(task, node) or TRUE)
        case ControlNode():
            pass
        case _:
            assert_never(node)
