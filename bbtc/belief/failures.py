"""Why a run stopped short of success: the conditions that did not hold in its last tick."""

from __future__ import annotations

from typing import NamedTuple

from bbtc.belief.state import State
from bbtc.belief.tick import Status, compile_tick
from bbtc.tree.nodes import ConditionNode, ControlNode, Node


class Failing(NamedTuple):
    """A condition node that a tick found false (failure) or unknown (running)."""

    node: ConditionNode
    status: Status
    depth: int


class FailureFinder:
    """Finds the conditions that fail in a state, for one tree."""

    def __init__(self, root: Node) -> None:
        self._depth = _depths(root)
        self._seen: list[Failing] = []
        self._tick = compile_tick(root, self._observe)

    def _observe(self, node: Node, status: int) -> None:
        if isinstance(node, ConditionNode) and status != Status.SUCCESS:
            self._seen.append(Failing(node, Status(status), self._depth[node.id]))

    def failing(self, state: State) -> list[Failing]:
        """The conditions ticked and not true, deepest first; of equals, the last ticked first.

        Paper, section "Finding a condition to resolve": the first of these is the deepest failed
        condition of the state.
        """
        self._seen.clear()
        self._tick(state.values, state.finished)
        return sorted(reversed(self._seen), key=lambda f: -f.depth)


def _depths(root: Node) -> dict[str, int]:
    depths: dict[str, int] = {}
    stack = [(root, 0)]
    while stack:
        node, depth = stack.pop()
        depths[node.id] = depth
        if isinstance(node, ControlNode):
            stack.extend((child, depth + 1) for child in node.children)
    return depths
