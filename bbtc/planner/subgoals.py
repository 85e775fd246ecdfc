"""Names for the rules of a tree: what each is there for.

A planner that refines tells of every branch for which condition it was inserted. A tree that was written
from rules is a list of Sequences, ``conditions, action``. Each gets the name ``for FACT``, where the fact is
one that its action may bring about and that is wanted: by the goal, or else one that it makes true, or finds
out, and that the rule farthest to the left reads, since the rules before it come nearer to the goal. What the
rule itself reads to be so already is not it; nor is what the rule that reads it puts an end to: ``battery
low: charge`` does not want the battery to be low. Rules that bring about nothing that is wanted get no name,
nor do nodes that have a name, a reason or a template.

Names change nothing that a tree does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Set
from dataclasses import dataclass, field, replace
from operator import is_

from typing_extensions import assert_never

from bbtc.ground.condition import Condition, Is, Known, conjuncts, leaves, replaced
from bbtc.ground.describe import describe
from bbtc.ground.task import GroundAction, Task, effects_of
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of


def with_subgoals(task: Task, root: Node) -> Node:
    """The tree with its rules named; itself, where there are none."""
    naming = _Naming(task, frozenset(leaves(_normal(task.goal))))
    naming.want([task.goal])
    return naming.node(root, ())


@dataclass(slots=True)
class _Naming:
    """A walk from left to right. ``wanted`` are literals in the order in which they were met."""

    task: Task
    goal: frozenset[Is | Known]
    wanted: dict[Is | Known, None] = field(default_factory=dict)

    def want(self, conditions: Iterable[Condition], action: GroundAction | None = None) -> None:
        """What conditions read is wanted, unless the action that they are read for ends it; a value rather
        than that it is known."""
        found = [leaf for each in conditions for leaf in leaves(_normal(each))]
        values = {} if action is None else _values(action)
        kept = [each for each in found if not _ended(each, values.get(each.variable, set()))]
        self.wanted.update(dict.fromkeys(each for each in kept if isinstance(each, Is)))
        self.wanted.update(dict.fromkeys(kept))

    def node(self, node: Node, tests: tuple[Condition, ...]) -> Node:
        """The node with names; ``tests`` are the conditions that were true wherever it is ticked."""
        match node:
            case ConditionNode():
                return node
            case ActionNode():
                action = self.task.action_by_name[node.action]
                self.want([*tests, action.precondition], action)
                return node
            case ControlNode():
                named = node.name is None and node.reason is None and node.template is None
                name = self._subgoal(node, tests) if named else node.name
                children = []
                for child in node.children:
                    children.append(self.node(child, tests))
                    if node.kind == "sequence" and isinstance(child, ConditionNode):
                        tests = (*tests, child.condition)
                if name == node.name and all(map(is_, children, node.children)):
                    return node
                return replace(node, children=tuple(children), name=name)
            case _:
                assert_never(node)

    def _subgoal(self, node: ControlNode, tests: tuple[Condition, ...]) -> str | None:
        """What a rule is there for; None if it is none, or for nothing that is wanted."""
        *before, last = node.children
        if node.kind != "sequence" or not before or not isinstance(last, ActionNode):
            return None
        if any(any(actions_of(each)) for each in before):
            return None
        action = self.task.action_by_name[last.action]
        own = [each.condition for each in before if isinstance(each, ConditionNode)]
        held = {part for each in (*tests, *own, action.precondition) for part in conjuncts(_normal(each))}
        brought = set(_brought_about(action, held)) - held
        for each in self.wanted:
            if self.task.variables[each.variable].digit is not None:
                continue
            if each in brought and (each in self.goal or isinstance(each, Known) or each.value is Truth.TRUE):
                return f"for {describe(self.task, each)}"
        return None


def _values(action: GroundAction) -> dict[int, set[Truth]]:
    """The values that an action may give to variables."""
    values: dict[int, set[Truth]] = {}
    for effect in effects_of(action.factors):
        for variable, value in effect.sets:
            values.setdefault(variable, set()).add(value)
    return values


def _ended(literal: Is | Known, values: Set[Truth]) -> bool:
    """May a literal, where it is so, no longer be so when its variable gets one of these values?"""
    return Truth.UNKNOWN in values if isinstance(literal, Known) else bool(values - {literal.value})


def _brought_about(action: GroundAction, held: Set[Condition]) -> Iterator[Condition]:
    """What an action may bring about. One that starts where a fact is unknown finds it out; whether it is
    true then is not the action's doing if it may find either."""
    for variable, found in _values(action).items():
        asked = Is(variable, Truth.UNKNOWN) in held
        if asked and Truth.UNKNOWN not in found:
            yield Known(variable)
        if not (asked and {Truth.TRUE, Truth.FALSE} <= found):
            yield from (Is(variable, value) for value in sorted(found))


def _normal(condition: Condition) -> Condition:
    return replaced(condition, lambda leaf: leaf)
