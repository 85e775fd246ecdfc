"""Branches that no run of a tree ever uses, taken out."""

from __future__ import annotations

from dataclasses import replace

from bbtc.belief.chain import Chain
from bbtc.belief.tick import Status, compile_tick
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.tree.nodes import ControlNode, Node, actions_of

_LOOK = 1024  # states between two looks at the clock


def without_idle_branches(task: Task, root: Node, chain: Chain, limits: Limits) -> Node:
    """The tree without those alternatives of Fallbacks that hold actions and only ever failed.

    In every state of the chain such a branch returns failure, and a Fallback goes on after it as
    if it were not there: statuses, started actions and probabilities stay as they are. The root
    itself is returned where nothing was taken out. Raises ``LimitReached`` when the time is over.
    """
    active: set[str] = set()

    def observe(node: Node, status: int) -> None:
        if status != Status.FAILURE:
            active.add(node.id)

    tick = compile_tick(task, root, observe)
    for number, state in enumerate(chain.states):
        if number % _LOOK == _LOOK - 1:
            limits.check_time("the search for a small tree")
        tick(state.values, state.finished)

    def kept(node: Node) -> Node:
        if not isinstance(node, ControlNode):
            return node
        children = node.children
        if node.kind == "fallback" and node.template is None:
            used = tuple(c for c in children if c.id in active or not any(actions_of(c)))
            children = used or children
        children = tuple(kept(child) for child in children)
        if node.kind == "fallback" and len(children) == 1:
            return children[0]
        unchanged = len(children) == len(node.children) and all(
            a is b for a, b in zip(children, node.children, strict=True)
        )
        return node if unchanged else replace(node, children=children)

    return kept(root)
