"""From a multi-policy to a readable tree, by way of rules (:mod:`bbtc.planner.synthesis.rules`).

Rewrite rules, where "tests: action" is a rule of a policy:

1. Rules ``r, …`` for states where the goal is false become ``Fallback(goal, r, …)``.
2. Rules ``q, …`` for states where it is unknown put ``Skipper(goal, Fallback(q, …))`` in the goal's place.
3. The goal ``a and b`` becomes ``Sequence(a, b)`` where neither is ever unknown: an unknown part would hide a
   false one behind it.
4. ``x, y: act`` becomes ``Sequence(x, y, act)``, the tests in an order in which none is ever unknown.
5. Where there is no such order, ``known(x)`` comes before ``x``.
6. Neighbours ``x: act``, ``y: act`` become ``Sequence(Fallback(x, y), act)``.
7. Neighbours ``x, y: act``, ``x: do`` become ``Sequence(x, Fallback(Sequence(y, act), do))``, and the like
   for more of them, where that saves nodes and x is never unknown.
8. Policies that follow one another after m, n, … actions become ``Fallback(Retry(m, …), Retry(n, …), …)``.

Actions are not latched: a rule that applies again tries again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from bbtc.ground.condition import FALSE, Condition, compile_condition, conjuncts, within
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.transitions import Index
from bbtc.planner.synthesis.permissive import MultiPolicy
from bbtc.planner.synthesis.rules import Learner, Literal, Rule, Test
from bbtc.rewrite.simplify import numbered
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, walk

_MOST_LOOKS = 5_000
"""How many rules are looked at, again and again, for tests to share: every run of rules that share one is
tried, and what is left and right of it and in it, which takes exponential time where little is shared."""


def synthesize(task: Task, policy: MultiPolicy, limits: Limits) -> Node:
    """A tree that takes one of the policy's choices in every state a run visits, and otherwise fails.
    Raises ``LimitReached`` when the time is over."""
    return numbered(_tree(task, policy, limits, fall_through=False))


def in_phases(task: Task, phases: Sequence[tuple[int, MultiPolicy]], limits: Limits) -> Node:
    """Trees for multi-policies that follow one another, each after so many actions of the one before.
    Raises ``LimitReached`` when the time is over."""
    parts = [
        _tree(task, policy, limits, fall_through=number < len(phases))
        for number, (_, policy) in enumerate(phases, 1)
    ]
    return one_after_another(task, [steps for steps, _ in phases], parts)


def one_after_another(task: Task, steps: Sequence[int], trees: Sequence[Node]) -> Node:
    """Trees that follow one another, each after so many actions of the one before (rule 8)."""
    parts = [
        ControlNode("", "retry", (tree,), attempts=most) for most, tree in zip(steps, trees, strict=True)
    ]
    return numbered(control("fallback", parts) if parts else ConditionNode("", task.goal))


def _tree(task: Task, policy: MultiPolicy, limits: Limits, *, fall_through: bool) -> Node:
    """``fall_through``: fail where the goal is unknown and nothing is done about it, so that what
    follows gets its turn."""
    goal = truths(task.goal, policy.values)
    unknown: Flags = goal == Truth.UNKNOWN
    false: Flags = goal == Truth.FALSE
    nowhere = np.zeros_like(unknown)
    learner = Learner(task, policy, limits)
    ending = ~policy.having()
    watching = learner.learn(unknown, nowhere, fall_through=fall_through)
    acting = learner.learn(false, unknown & ending, fall_through=fall_through)
    node = goal_node(task, policy.values[learner.relevant()])
    build = _Builder(task, policy.values, limits)
    if watching:  # rule 2
        node = control("skipper", [node, build.choice(build.rules(watching))])
    elif fall_through and (unknown & learner.relevant()).any():
        node = control("skipper", [node, ConditionNode("", FALSE)])
    children = build.rules(acting)
    return control("fallback", [node, *children]) if children else node  # rule 1


def truths(condition: Condition, values: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """The truth value of a condition in each row of values."""
    test = compile_condition(condition)
    return np.array([int(test(row)) for row in values.tolist()], dtype=np.int64)


def goal_node(task: Task, values: npt.NDArray[np.uint8]) -> Node:
    """The goal, a node for each of its parts unless some part may be unknown: in a Sequence, an
    unknown part would hide a false one behind it."""
    parts = conjuncts(task.goal)
    if len(parts) < 2 or any((truths(part, values) == Truth.UNKNOWN).any() for part in parts):
        return ConditionNode("", task.goal)
    return control("sequence", [ConditionNode("", part) for part in parts])  # rule 3


def control(kind: ControlKind, children: Sequence[Node]) -> Node:
    """A control node; of a single child, that child."""
    return children[0] if len(children) == 1 else ControlNode("", kind, tuple(children))


def _size(nodes: Sequence[Node]) -> int:
    return sum(1 for node in nodes for _ in walk(node))


@dataclass(slots=True)
class _Builder:
    task: Task
    values: npt.NDArray[np.uint8]
    limits: Limits
    left: int = _MOST_LOOKS
    """Rules that may still be looked at for tests to share."""

    def choice(self, children: list[Node]) -> Node:
        return control("fallback", children)

    def rules(self, rules: Sequence[Rule]) -> list[Node]:
        """The rules as children of a Fallback, in order."""
        self.limits.check_time("the search for a small tree")
        self.left -= len(rules)
        best = self._flat(rules)
        # Rule 7.
        for literal, start, end in self._shared(rules):
            inner = [replace(r, tests=tuple(t for t in r.tests if t != literal)) for r in rules[start:end]]
            if not self._settled([literal], rules[start].asked):
                continue
            if self.left < 0:
                break
            asked = rules[start].asked[literal.holds(self.values[rules[start].asked])]
            inner[0] = replace(inner[0], asked=asked)
            branch = control(
                "sequence", [ConditionNode("", literal.condition), self.choice(self.rules(inner))]
            )
            nodes = [*self.rules(rules[:start]), branch, *self.rules(rules[end:])]
            if _size(nodes) < _size(best):
                best = nodes
                break
        return best

    def _shared(self, rules: Sequence[Rule]) -> list[tuple[Literal, int, int]]:
        """Runs of neighbouring rules that share a test, the longest first."""
        found: list[tuple[Literal, int, int]] = []
        for literal in sorted({test for rule in rules for test in rule.tests}):
            start = None
            for position in range(len(rules) + 1):
                inside = position < len(rules) and literal in rules[position].tests
                if inside and start is None:
                    start = position
                elif not inside and start is not None:
                    if position - start > 1:
                        found.append((literal, start, position))
                    start = None
        return sorted(found, key=lambda run: (run[1] - run[2], run[0]))

    def _flat(self, rules: Sequence[Rule]) -> list[Node]:
        nodes: list[Node] = []
        position = 0
        while position < len(rules):
            rule = rules[position]
            alike = [rule]
            while position + len(alike) < len(rules) and rules[position + len(alike)].action == rule.action:
                alike.append(rules[position + len(alike)])
            action = ActionNode("", self.task.actions[rule.action].name, latched=False)
            if all(each.tests for each in alike) and len(alike) > 1:  # rule 6
                tests = [control("sequence", self._conditions(each)) for each in alike]
                nodes.append(control("sequence", [self.choice(tests), action]))
            else:
                nodes.extend(control("sequence", [*self._conditions(each), action]) for each in alike)
            position += len(alike)
        return nodes

    def _conditions(self, rule: Rule) -> list[Node]:
        """The tests of a rule: rule 4."""
        waiting = list(rule.tests)
        asked = rule.asked
        nodes: list[Node] = []
        while waiting:
            if waiting[0].digits:  # all that is asked of a number at once
                alike = [test for test in waiting if test.digits == waiting[0].digits]
                waiting = [test for test in waiting if test not in alike]
                nodes.append(ConditionNode("", _together(alike)))
                for test in alike:
                    asked = asked[test.holds(self.values[asked])]
                continue
            literal = next((t for t in waiting if self._settled([t], asked)), None)
            if literal is None:  # rule 5
                literal = Literal(waiting[0].variable, Test.KNOWN)
            else:
                waiting.remove(literal)
            nodes.append(ConditionNode("", literal.condition))
            asked = asked[literal.holds(self.values[asked])]
        return nodes

    def _settled(self, tests: Sequence[Literal], asked: Index) -> bool:
        """Is none of the tests unknown in any of the states?"""
        return all(
            test.test in {Test.UNKNOWN, Test.KNOWN}
            or not (self.values[asked, test.variable] == Truth.UNKNOWN).any()
            for test in tests
        )


def _together(tests: Sequence[Literal]) -> Condition:
    """Tests of one number as one condition."""
    digits = tests[0].digits
    low = max((test.bound for test in tests if test.test is Test.AT_LEAST), default=0)
    below = min((test.bound for test in tests if test.test is Test.BELOW), default=1 << len(digits))
    return within(digits, low, below - 1)
