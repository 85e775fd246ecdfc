"""Equal attempts that follow one another, put together under a retry node.

Rewrite rules, kept if both trees, run side by side, do the same (:mod:`bbtc.belief.same_runs`) and the tree
gets smaller:

1. ``Fallback(…, a, a, a, …)`` becomes ``Fallback(…, Retry(3, b), …)``, where a is a Sequence of conditions,
   one action and a check of what came of it, or only some of them, and b is a without its latch, and without
   the check: what the action is there for is read before the Fallback, in the next tick.
2. ``Fallback(…, a, a, a, …)`` becomes ``Fallback(…, Retry-until-success(3, a), …)`` for any other attempt a,
   of several actions, say: a retry node counts starts of actions, this one counts attempts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bbtc.belief.chain import Chain
from bbtc.belief.same_runs import same_runs
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.rewrite.simplify import numbered, size
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of, walk


def with_repeats(task: Task, root: Node, chain: Chain, limits: Limits) -> Node:
    """The tree with equal neighbours put together; itself, where there are none. Raises ``LimitReached`` when
    the time is over."""
    found = root
    barred = 0  # so many places from the left were tried in vain
    while True:
        for number, smaller in enumerate(_repeated(found)):
            if number < barred:
                continue
            limits.check_time("the search for a small tree")
            if size(smaller) < size(found) and same_runs(task, chain, smaller):
                found = smaller
                break
            barred += 1
        else:
            return found if found is root else numbered(found)


def _repeated(node: Node) -> Iterator[Node]:
    """Trees in which the neighbours of one place are put together, from left to right."""
    if not isinstance(node, ControlNode) or node.template is not None:
        return
    at = 0
    while node.kind == "fallback" and at < len(node.children):
        end = at + 1
        while end < len(node.children) and _equal(node.children[at], node.children[end]):
            end += 1
        if end - at > 1 and any(actions_of(node.children[at])):
            retry = _retry(node.children[at], end - at)
            children = (*node.children[:at], retry, *node.children[end:])
            yield retry if len(children) == 1 else replace(node, children=children)
        at = end
    for at, child in enumerate(node.children):
        for smaller in _repeated(child):
            yield replace(node, children=(*node.children[:at], smaller, *node.children[at + 1 :]))


def _retry(attempt: Node, attempts: int) -> ControlNode:
    """So many attempts, as one."""
    name, again = f"{attempt.id}.retry", _again(attempt)
    if again is not None:  # rule 1
        return ControlNode(name, "retry", (again,), attempts=attempts)
    return ControlNode(name, "retry-until-success", (attempt,), attempts=attempts)  # rule 2


def _again(attempt: Node) -> Node | None:
    """The attempt without its latch, up to its action; None where it is of another form."""
    if isinstance(attempt, ActionNode):
        return replace(attempt, latched=False) if attempt.latched else None
    if not isinstance(attempt, ControlNode) or attempt.kind != "sequence" or attempt.template is not None:
        return None
    children: list[Node] = []
    for child in attempt.children:
        match child:
            case ActionNode(latched=True):
                action = replace(child, latched=False)
                if any(actions_of(ControlNode("", "sequence", attempt.children[len(children) + 1 :]))):
                    return None
                return replace(attempt, children=(*children, action)) if children else action
            case ConditionNode():
                children.append(child)
            case _:
                return None
    return None


def _equal(one: Node, other: Node) -> bool:
    """Are they equal but for ids?"""
    nodes, others = list(walk(one)), list(walk(other))
    return len(nodes) == len(others) and all(
        replace(first, id="") == replace(second, id="")
        if not isinstance(first, ControlNode) or not isinstance(second, ControlNode)
        else _label(first) == _label(second)
        for first, second in zip(nodes, others, strict=True)
    )


def _label(node: ControlNode) -> tuple[object, ...]:
    return (node.kind, len(node.children), node.name, node.template, node.attempts)
