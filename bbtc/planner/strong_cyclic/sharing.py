"""Rules under what they share: neighbours ``x, y: act`` and ``x, z: do`` become
``Sequence(x, Fallback(y: act, z: do))`` where that makes the tree smaller, nodes and literals in conditions
counted alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from bbtc.ground.condition import Condition, conjunction, leaves
from bbtc.ground.task import Task
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node

Guarded: TypeAlias = tuple[tuple[Condition, ...], ActionNode]
"""Conditions that must all hold, and the action to start."""

_FARTHEST = 100  # rules of one group
_GROUP = 3  # nodes that a group takes: sequence, condition, fallback


def factored(task: Task, rules: Sequence[Guarded]) -> list[Node]:
    """The rules as children of a fallback, in their order."""
    best = _best(task, rules)
    if best is None:
        return [_alone(guards, action) for guards, action in rules]
    start, end, common = best
    inner = [
        (tuple(guard for guard in guards if guard not in common), action)
        for guards, action in rules[start:end]
    ]
    group = ControlNode(
        "",
        "sequence",
        (ConditionNode("", conjunction(common)), ControlNode("", "fallback", tuple(factored(task, inner)))),
    )
    return [*factored(task, rules[:start]), group, *factored(task, rules[end:])]


def _alone(guards: tuple[Condition, ...], action: ActionNode) -> Node:
    if not guards:
        return action
    return ControlNode("", "sequence", (ConditionNode("", conjunction(guards)), action))


def _best(task: Task, rules: Sequence[Guarded]) -> tuple[int, int, tuple[Condition, ...]] | None:
    """The neighbours, from one to before another, whose shared conditions save most, and these."""
    found, most = None, 0
    fit = [[guard for guard in guards if _never_unknown(task, guard)] for guards, _ in rules]
    for start in range(len(rules)):
        common = fit[start]
        for end in range(start + 1, min(len(rules), start + _FARTHEST)):
            common = [guard for guard in common if guard in fit[end]]
            if not common:
                break
            saved = (end - start) * sum(map(_literals, common)) - _GROUP
            saved += 2 * sum(len(guards) == len(common) for guards, _ in rules[start : end + 1])
            if saved > most:
                found, most = (start, end + 1, tuple(common)), saved
    return found


def _never_unknown(task: Task, condition: Condition) -> bool:
    """Others are read with what they need to be known, and stay with it."""
    return not any(task.variables[leaf.variable].three_valued for leaf in leaves(condition))


def _literals(condition: Condition) -> int:
    return sum(1 for _ in leaves(condition))
