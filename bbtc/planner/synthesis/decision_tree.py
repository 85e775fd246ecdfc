"""From a policy to a tree fast, however large it is: a decision tree over the states that runs visit.

The test is taken that tells most about what to do (information gain: Quinlan 1986), until all states left
want the same. It has more nodes than rules would (:mod:`bbtc.planner.synthesis.rules`), but takes time
linear in states and tests.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bbtc.ground.condition import FALSE
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.transitions import Index
from bbtc.planner.synthesis.permissive import MultiPolicy
from bbtc.planner.synthesis.rules import Literal, Test, cuts_of
from bbtc.planner.synthesis.tree import control, goal_node, truths
from bbtc.rewrite.simplify import numbered
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node

_END = -1


def decision_tree(task: Task, policy: MultiPolicy, limits: Limits, *, fall_through: bool = False) -> Node:
    """A tree that takes the first of the policy's choices in every state a run visits, and otherwise fails.
    With ``fall_through`` it does so too once its actions may not start any more, and where the goal is
    unknown and nothing is done about it, so that what follows gets its turn. Raises ``LimitReached`` when the
    time is over."""
    label = np.full(len(policy.goal), _END, dtype=np.int64)
    label[policy.choice_state[::-1]] = policy.choice_action[::-1]
    goal = truths(task.goal, policy.values)
    unknown: Flags = goal == Truth.UNKNOWN
    build = _Builder(task, policy.values, label, limits, fails=fall_through)
    node = goal_node(task, policy.values)
    if (unknown & (label != _END)).any():
        watching = build.tree(np.flatnonzero(unknown))
        assert watching is not None
        node = ControlNode("", "skipper", (node, watching))
    elif fall_through and unknown.any():
        node = ControlNode("", "skipper", (node, ConditionNode("", FALSE)))
    acting = build.tree(np.flatnonzero((goal == Truth.FALSE) | (unknown & (label == _END))))
    return numbered(node if acting is None else control("fallback", [node, acting]))


@dataclass(frozen=True, slots=True)
class _Branch:
    """A test whose two subtrees have been begun."""

    test: Literal


class _Builder:
    def __init__(
        self, task: Task, values: npt.NDArray[np.uint8], label: Index, limits: Limits, *, fails: bool
    ) -> None:
        self.task, self.values, self.label, self.limits = task, values, label, limits
        self.fails = fails
        """May any action fail to start?"""
        facts = [at for at in range(values.shape[1]) if task.variables[at].digit is None]
        found = [Literal(at, test) for at in facts for test in (Test.TRUE, Test.UNKNOWN)]
        found += cuts_of(task, values)
        found = [each for each in found if each.holds(values).any() and not each.holds(values).all()]
        self.literals = found
        columns = [literal.holds(values) for literal in found]
        self.holds = np.array(columns, dtype=np.bool_).T.reshape(len(values), len(found))
        self.variable = np.array([literal.variable for literal in found], dtype=np.int64)
        self.truth: Flags = np.array([literal.test is Test.TRUE for literal in found], dtype=np.bool_)

    def tree(self, states: Index) -> Node | None:
        """A tree that starts the action of each of some states, and fails where there is none; None if
        there is none anywhere."""
        # Iterative, since trees may be deep: what is to be done, last first.
        work: list[Index | _Branch] = [states]
        done: list[tuple[Node | None, bool]] = []
        while work:
            item = work.pop()
            if isinstance(item, _Branch):
                done.append(self._joined(item.test, done.pop(), done.pop()))
                continue
            self.limits.check_time("the search for a small tree")
            wanted, often = np.unique(self.label[item], return_counts=True)
            column = self._best(item) if len(wanted) > 1 else None
            if column is None:  # or what is believed differs, and nothing that can be read tells it
                action = int(wanted[np.argmax(often)]) if len(wanted) else _END
                leaf = (
                    None if action == _END else ActionNode("", self.task.actions[action].name, latched=False)
                )
                done.append((leaf, self.fails or leaf is None))
                continue
            inside = self.holds[item, column]
            work.extend([_Branch(self.literals[column]), item[inside], item[~inside]])
        return done[0][0]

    def _best(self, states: Index) -> int | None:
        """The column of the test that tells most about the actions of some states; None if none does."""
        order = np.argsort(self.label[states], kind="stable")
        states = states[order]
        starts = np.flatnonzero(np.diff(self.label[states], prepend=-2))
        holds = self.holds[states]
        true = np.add.reduceat(holds, starts, axis=0, dtype=np.int64)
        false = np.diff(starts, append=len(states))[:, None] - true
        usable = holds.any(axis=0) & ~holds.all(axis=0)
        # Where a variable may be unknown, that is asked first.
        doubtful = (self.values[states] == Truth.UNKNOWN).any(axis=0)
        usable &= ~(self.truth & doubtful[self.variable])
        rest = _entropy(true) + _entropy(false)
        rest[~usable] = np.inf
        return int(np.argmin(rest)) if usable.any() else None

    @staticmethod
    def _joined(
        test: Literal, true: tuple[Node | None, bool], false: tuple[Node | None, bool]
    ) -> tuple[Node | None, bool]:
        """A tree for where a test holds and one for where it does not, as one; each with whether it may
        fail where it is meant to be used."""
        (left, left_fails), (right, right_fails) = true, false
        parts: list[Node] = []
        if left is not None:
            parts.append(
                control("sequence", [ConditionNode("", test.condition), *_children(left, "sequence")])
            )
        if right is not None and (left is None or left_fails):
            opposite = test.opposite.condition
            right = control("sequence", [ConditionNode("", opposite), *_children(right, "sequence")])
        if right is not None:
            parts.extend(_children(right, "fallback"))
        return (control("fallback", parts) if parts else None), left_fails or right_fails


def _children(node: Node, kind: str) -> Iterator[Node]:
    """Of a node of some kind its children, else itself."""
    if isinstance(node, ControlNode) and node.kind == kind:
        yield from node.children
    else:
        yield node


def _entropy(counts: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """For each column, its sum times the entropy of its shares."""
    total = counts.sum(axis=0)
    found: npt.NDArray[np.float64] = total * np.log2(np.maximum(total, 1))
    found -= (counts * np.log2(np.maximum(counts, 1))).sum(axis=0)
    return found
