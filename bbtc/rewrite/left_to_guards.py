"""Tests that are left to the action behind them, which reads its precondition anyway.

``Sequence(…, c, …, a)`` becomes ``Sequence(…, …, a)`` for a test c, with none but tests up to an action a,
which is guarded then, if that returns and starts the same in every state that there may be
(:mod:`bbtc.rewrite.ensured`): where c is false, so is the precondition, and where c is unknown, that is
neither true nor false. The tree is smaller, and no less is read before the action starts; while it runs, its
own effects do not cancel it.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

from bbtc.belief.tick import NodeStatus
from bbtc.ground.condition import Condition, leaves
from bbtc.ground.task import Task
from bbtc.rewrite.ensured import GO_ON, All, Facts, Formula, returned, worth
from bbtc.tree.nodes import COUNTING, ActionNode, ConditionNode, ControlNode, Node


def left_to_guards(task: Task, root: Node) -> Node:
    """A tree whose actions read their preconditions, or have them ensured, without tests that the action
    behind them makes itself. Templates keep the shape that their author gave them; below a retry node, where
    attempts may be used up, all stays as it is."""
    while True:
        repeated: set[str] = set()
        _repeated(task, root, repeated)
        found = _Walk(task, repeated).node(root)
        if found == root:
            return root
        root = found  # the tests that are left may be needless where others are gone


def _repeated(task: Task, node: Node, found: set[str]) -> None:
    """Find tests of what the action behind them may read, too, and the nodes around them."""
    if not isinstance(node, ControlNode) or node.template is not None or node.kind in COUNTING:
        return
    read: set[int] = set()
    for child in reversed(node.children):
        if isinstance(child, ActionNode) and not child.latched and node.kind == "sequence":
            read = {leaf.variable for leaf in leaves(task.action_by_name[child.action].precondition)}
        elif not isinstance(child, ConditionNode):
            read = set()
            _repeated(task, child, found)
        elif any(leaf.variable in read for leaf in leaves(child.condition)):
            found.add(child.id)
        if child.id in found:
            found.add(node.id)


class _Walk:
    """A walk through a tree, with what is sure at each node."""

    def __init__(self, task: Task, repeated: Set[str]) -> None:
        self.task, self.facts, self.repeated = task, Facts(task), repeated

    def node(self, node: Node) -> Node:
        """The node, made smaller."""
        if node.id not in self.repeated or not isinstance(node, ControlNode):
            return node
        children: list[Node] = []
        told, left = 0, False
        with self.facts.meanwhile():
            for at, child in enumerate(node.children):
                if child.id in self.repeated:
                    for earlier in children[told:]:  # what they returned matters from here on
                        self.facts.add(returned(self.task, earlier, GO_ON[node.kind]))
                    told = len(children)
                    if isinstance(child, ConditionNode) and self._needless(child, node.children[at + 1 :]):
                        left = True
                        continue
                if left and isinstance(child, ActionNode):
                    children.append(replace(child, guarded=True))
                    left = False
                else:
                    children.append(self.node(child))
        return children[0] if len(children) == 1 else replace(node, children=tuple(children))

    def _needless(self, test: ConditionNode, behind: Sequence[Node]) -> bool:
        """Does what stands behind a test do the same by itself wherever that is not true?"""
        conditions: list[Condition] = []
        for node in behind:
            if isinstance(node, ActionNode):
                conditions.append(self.task.action_by_name[node.action].precondition)
                break
            assert isinstance(node, ConditionNode)
            conditions.append(node.condition)
        return all(
            self._only(status, worth(test.condition, status), conditions)
            for status in (NodeStatus.FAILURE, NodeStatus.RUNNING)
        )

    def _only(self, status: NodeStatus, where: Formula, conditions: Sequence[Condition]) -> bool:
        """Where something holds, do conditions, read one after another, return this status for sure?"""
        before: list[Formula] = [where]
        for condition in conditions:
            for other in (NodeStatus.FAILURE, NodeStatus.RUNNING):
                if other is not status and self.facts.possible(All((*before, worth(condition, other)))):
                    return False
            before.append(worth(condition, NodeStatus.SUCCESS))
        return not self.facts.possible(All(tuple(before)))
