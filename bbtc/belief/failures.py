"""Why a run stopped short of success: the conditions that did not hold in its last tick."""

from __future__ import annotations

from typing import NamedTuple

from bbtc.belief.state import State
from bbtc.belief.tick import NodeStatus, compile_tick, memory_of
from bbtc.ground.condition import Condition, conjuncts, evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, levels


class Failing(NamedTuple):
    """A condition that a tick found false (failure) or unknown (running): that of a condition
    node, or a conjunct of a guarded action's precondition."""

    node: str
    condition: Condition
    status: NodeStatus
    depth: int


class Stop(NamedTuple):
    """What stopped a run: the deepest condition that was not true, with its node and whether that was false
    or unknown; a retry node of which the attempts are used up, with neither; or nothing that was asked."""

    node: str | None
    condition: Condition | None
    status: NodeStatus | None


class FailureFinder:
    """Finds the conditions that fail in a state, for one tree."""

    def __init__(self, task: Task, root: Node) -> None:
        self._depth = {node.id: level for node, level in levels(root)}
        self._seen: list[tuple[ConditionNode | ActionNode, int]] = []
        self._task = task
        self._tick = compile_tick(task, root, self._observe)
        counters = memory_of(root).counters
        self._counters = {node.id: counters[i] for i, node in enumerate(actions_of(root))}

    def _observe(self, node: Node, status: int) -> None:
        if not isinstance(node, ControlNode) and status < NodeStatus.SUCCESS:
            self._seen.append((node, status))

    def failing(self, state: State) -> list[Failing]:
        """The conditions ticked and not true, deepest first; of equals, the last ticked first.

        Paper, section "Finding a condition to resolve": the first of these is the deepest failed
        condition of the state. Where the tree is blocked, unknown conditions come before false
        ones: a false one deeper in a branch that failed over is not what stopped it.
        """
        self._seen.clear()
        root = self._tick(state.values, state.finished)
        found = [
            Failing(node.id, self._condition(node, state), NodeStatus(status), self._depth[node.id])
            for node, status in reversed(self._seen)
            if isinstance(node, ConditionNode) or self._lacks_precondition(node, state)
        ]
        return sorted(found, key=lambda f: (f.status != root, -f.depth))

    def stopped(self, state: State) -> Stop:
        """What stopped a run in a final state."""
        used_up = self.used_up(state)
        if used_up is not None:
            return Stop(used_up, None, None)
        failing = self.failing(state)
        return (
            Stop(failing[0].node, failing[0].condition, failing[0].status)
            if failing
            else Stop(None, None, None)
        )

    def used_up(self, state: State) -> str | None:
        """The retry node that refused an action for want of attempts; None if none did."""
        self._seen.clear()
        self._tick(state.values, state.finished)
        for node, status in self._seen:
            if not isinstance(node, ActionNode) or status != NodeStatus.FAILURE:
                continue
            if self._lacks_precondition(node, state):
                continue
            for counter in self._counters[node.id]:
                if counter.used_up(state.finished):
                    return counter.node
        return None

    def _lacks_precondition(self, node: ActionNode, state: State) -> bool:
        """Is it guarded by a precondition that is not true? (If it is true, a retry node refused it.)"""
        precondition = self._task.action_by_name[node.action].precondition
        return node.guarded and evaluate(precondition, state.values) is not Truth.TRUE

    def _condition(self, node: ConditionNode | ActionNode, state: State) -> Condition:
        if isinstance(node, ConditionNode):
            return node.condition
        precondition = self._task.action_by_name[node.action].precondition
        return min(conjuncts(precondition), key=lambda part: evaluate(part, state.values))
