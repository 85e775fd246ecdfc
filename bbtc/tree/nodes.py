"""The belief behavior tree (BBT) as frozen data.

Control nodes are memoryless: every tick starts at the first child. In a Skipper only the last
child may contain actions; :func:`bbtc.tree.validate.check_tree` enforces it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import Condition
from bbtc.ground.task import Task
from bbtc.tree.monitor import Monitor
from bbtc.tree.notebook import picture

ControlKind: TypeAlias = Literal["sequence", "fallback", "skipper", "retry", "retry-until-success"]

COUNTING: frozenset[ControlKind] = frozenset(("retry", "retry-until-success"))
"""The kinds that have one child, and a number of attempts."""


@dataclass(frozen=True, slots=True)
class ControlNode:
    """Sequence (→), Fallback (?) or Skipper (⇒): goes on to the next child while the child
    returns success, failure or running, respectively. Retry (↻) has one child and returns what that
    returns; once ``attempts`` actions have been started below it, any further one fails instead.
    Retry-until-success (↺) ticks its one child again when that fails, ``attempts`` times in all, and
    forgets what is remembered below it after each time.

    ``template`` is the ground template this subtree was expanded from, ``reason`` the condition
    it was inserted for, ``name`` a label of its own.
    """

    id: str
    kind: ControlKind
    children: tuple[Node, ...]
    name: str | None = None
    template: str | None = None
    reason: str | None = None
    attempts: int | None = None

    def __reduce__(self) -> tuple[Callable[..., Node], tuple[object, ...]]:
        """Pickled node by node: a pickler's recursion ends at fewer levels than a tree may have."""
        nodes = [
            (n.id, n.kind, len(n.children), n.name, n.template, n.reason, n.attempts)
            if isinstance(n, ControlNode)
            else n
            for n in walk(self)
        ]
        return _put_together, tuple(nodes)


@dataclass(frozen=True, slots=True)
class ConditionNode:
    """Success, failure or running for a condition that is true, false or unknown."""

    id: str
    condition: Condition
    name: str | None = None
    template: str | None = None
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class ActionNode:
    """Starts a ground action and is running until its outcome applies; a latched node that has
    finished returns success and never starts it again.

    A ``guarded`` node, before it starts, reads the action's precondition as a condition would and
    returns failure or running unless it is true. Template bodies use it: there no condition nodes
    of their own stand before an action, and its own effect may end its precondition.
    """

    id: str
    action: str
    latched: bool = True
    guarded: bool = False
    name: str | None = None
    template: str | None = None
    reason: str | None = None


Node: TypeAlias = ControlNode | ConditionNode | ActionNode

PlanStatus: TypeAlias = Literal["target-reached", "out-of-reach", "stuck", "limit-reached", "interrupted"]
"""How planning ended. What a node returns at a tick is a :class:`bbtc.belief.tick.NodeStatus`."""


@dataclass(frozen=True, slots=True)
class SuccessBy:
    """Bounds of the probability that a tree succeeds within so many seconds."""

    seconds: Fraction
    at_least: Fraction
    at_most: Fraction


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree with the task its conditions and actions refer to, and the planner's claim.

    ``success_probability`` is exact; ``target`` is the probability that was asked for. ``bounds``,
    where known, hold the best probability that any policy could reach. With ``success_by``, the target is one
    of success by a deadline. With a ``monitor``, the task tells
    what is true, and the monitor what is known of it.
    """

    task: Task
    root: Node
    success_probability: Fraction
    target: Fraction
    status: PlanStatus
    bounds: tuple[Fraction, Fraction] | None = None
    monitor: Monitor | None = None
    success_by: SuccessBy | None = None

    def _repr_svg_(self) -> str | None:
        """The tree as a picture, for notebooks."""
        return picture(self)


def walk(node: Node) -> Iterator[Node]:
    """Every node, parents before children, from left to right."""
    stack = [node]
    while stack:
        node = stack.pop()
        yield node
        match node:
            case ControlNode():
                stack.extend(reversed(node.children))
            case ConditionNode() | ActionNode():
                pass
            case _:
                assert_never(node)


_Entry: TypeAlias = tuple[str, ControlKind, int, str | None, str | None, str | None, int | None]


def _put_together(*nodes: _Entry | ConditionNode | ActionNode) -> Node:
    """The tree of these nodes, which are in the order of :func:`walk`; a control node tells how many children
    it has."""
    done: list[Node] = []
    for node in reversed(nodes):
        if isinstance(node, tuple):
            key, kind, count, name, template, reason, attempts = node
            children = tuple(done.pop() for _ in range(count))
            done.append(ControlNode(key, kind, children, name, template, reason, attempts))
        else:
            done.append(node)
    return done.pop()


def levels(root: Node) -> Iterator[tuple[Node, int]]:
    """Every node with its level, from 1 on. Iterative: any tree can be measured."""
    stack = [(root, 1)]
    while stack:
        node, level = stack.pop()
        yield node, level
        if isinstance(node, ControlNode):
            stack.extend((child, level + 1) for child in node.children)


def tree_depth(root: Node) -> int:
    """The number of levels of a tree."""
    return max(level for _, level in levels(root))


def retries_of(node: Node) -> Iterator[tuple[ControlNode, int]]:
    """The retry nodes, parents before children, from left to right, each with its attempts."""
    return _counting(node, "retry")


def retries_until_success_of(node: Node) -> Iterator[tuple[ControlNode, int]]:
    """The retry-until-success nodes, likewise."""
    return _counting(node, "retry-until-success")


def _counting(node: Node, kind: ControlKind) -> Iterator[tuple[ControlNode, int]]:
    for each in walk(node):
        if isinstance(each, ControlNode) and each.kind == kind and each.attempts is not None:
            yield each, each.attempts


def actions_of(node: Node) -> Iterator[ActionNode]:
    """The action nodes, from left to right."""
    return (n for n in walk(node) if isinstance(n, ActionNode))


def tries_without_end(root: Node) -> bool:
    """Whether nothing bounds how often some action starts: it is not below a retry node, and not latched, or
    only until a retry-until-success node forgets it."""
    bounded = {action.id for retry, _ in retries_of(root) for action in actions_of(retry)}
    forgotten = {action.id for until, _ in retries_until_success_of(root) for action in actions_of(until)}
    return any(
        action.id not in bounded and (not action.latched or action.id in forgotten)
        for action in actions_of(root)
    )
