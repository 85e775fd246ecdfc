"""What holds where a node of a tree is ticked, in any state that there may be, visited or not.

A tick reads conditions that do not change meanwhile. So where a node is ticked, those before it in a Sequence
have succeeded, in a Fallback failed, in a Skipper been running, and so have those around it. What a node has
returned is a formula over the values of variables ("x is true or unknown"): exact for conditions, and weaker
than the truth for what depends on what the tree remembers, since a latched action may have returned anything.
What follows is found by unit propagation, and by telling a few cases apart: sound, and complete but for what
takes more cases.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.belief.tick import STARTED, NodeStatus
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, in_digits, negation
from bbtc.ground.task import Task
from bbtc.kleene import Truth, negate
from bbtc.tree.nodes import COUNTING, ActionNode, ConditionNode, ControlKind, ControlNode, Node, actions_of

_ANY = 0b111  # a set of truth values: bit i stands for the value i
_TWO = 0b101

_CASES = 3
"""Choices made one within the other to show that something cannot be."""


@dataclass(frozen=True, slots=True)
class Among:
    """The variable has one of these values."""

    variable: int
    values: int


@dataclass(frozen=True, slots=True)
class All:
    """Each part holds."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """A part holds."""

    parts: tuple[Formula, ...]


Formula: TypeAlias = Among | All | Some
ALWAYS: Formula = All(())
NEVER: Formula = Some(())


def at_least(condition: Condition, value: Truth) -> Formula:
    """The condition has this value, unknown or true, or a greater one."""
    match condition:
        case Is(variable, Truth.TRUE):
            return Among(variable, _from(value))
        case Is(variable, Truth.FALSE):
            return Among(variable, _up_to(2 - value))
        case Is(variable, _):
            return Among(variable, 1 << Truth.UNKNOWN)
        case Known(variable):
            return Among(variable, _TWO)
        case Within():
            return at_least(in_digits(condition), value)
        case And(parts):
            return All(tuple([at_least(part, value) for part in parts]))
        case Or(parts):
            return Some(tuple([at_least(part, value) for part in parts]))
        case Not(part):
            return at_least(negation(part), value)
        case Constant(holds):
            return ALWAYS if holds else NEVER
        case _:
            assert_never(condition)


def at_most(condition: Condition, value: Truth) -> Formula:
    """The condition has this value, false or unknown, or a smaller one: its negation is as great."""
    return at_least(negation(condition), negate(value))


def _from(value: int) -> int:
    return _ANY & ~((1 << value) - 1)


def _up_to(value: int) -> int:
    return (2 << value) - 1


def worth(condition: Condition, status: NodeStatus) -> Formula:
    """A condition node returns this status."""
    match status:
        case NodeStatus.SUCCESS:
            return at_least(condition, Truth.TRUE)
        case NodeStatus.FAILURE:
            return at_most(condition, Truth.FALSE)
        case NodeStatus.RUNNING:
            return All((at_least(condition, Truth.UNKNOWN), at_most(condition, Truth.UNKNOWN)))
        case _:
            assert_never(status)


GO_ON: dict[ControlKind, NodeStatus] = {
    "sequence": NodeStatus.SUCCESS,
    "fallback": NodeStatus.FAILURE,
    "skipper": NodeStatus.RUNNING,
}
"""After which status of a child a control node ticks the next one."""


def returned(task: Task, node: Node, status: NodeStatus, *, bounded: bool = False) -> Formula:
    """What is sure where a node has returned a status, without starting an action in this tick unless that is
    running; ``bounded``: it stands below a retry node."""
    match node:
        case ConditionNode():
            return worth(node.condition, status)
        case ActionNode():
            if status is NodeStatus.RUNNING or node.latched:
                return ALWAYS
            if status is NodeStatus.SUCCESS:
                return NEVER
            if bounded:
                return ALWAYS
            return worth(task.action_by_name[node.action].precondition, status) if node.guarded else NEVER
        case ControlNode():
            bounded = bounded or node.kind == "retry"
            parts = [returned(task, child, status, bounded=bounded) for child in node.children]
            if node.kind in COUNTING:
                return parts[0]
            if status is GO_ON[node.kind]:
                return All(tuple(parts))
            # Of the children before the one that decides, only conditions are told again: with all of them a
            # formula would take space that is exponential in the depth of a tree.
            before: list[Formula] = []
            for at, child in enumerate(node.children):
                parts[at] = All((*before, parts[at])) if before else parts[at]
                if isinstance(child, ConditionNode):
                    before.append(worth(child.condition, GO_ON[node.kind]))
            return Some(tuple(parts))
        case _:
            assert_never(node)


def may_return(task: Task, root: Node) -> dict[str, set[int]]:
    """By the id of each node, what it may return where it is ticked, in any state, or ``STARTED`` where it
    may start an action; nothing, where it is never ticked."""
    facts = Facts(task)
    found: dict[str, set[int]] = {}

    def visit(node: Node, *, bounded: bool) -> None:
        ways = {s: returned(task, node, s, bounded=bounded) for s in NodeStatus}
        found[node.id] = {int(status) for status, way in ways.items() if facts.possible(way)}
        if found[node.id] and any(actions_of(node)):
            found[node.id].add(STARTED)
        if isinstance(node, ControlNode):
            bounded = bounded or node.kind == "retry"
            with facts.meanwhile():
                for child in node.children:
                    visit(child, bounded=bounded)
                    if node.kind not in COUNTING:
                        facts.add(returned(task, child, GO_ON[node.kind], bounded=bounded))

    visit(root, bounded=False)
    return found


class Facts:
    """What is taken to hold, and what follows from it. What was added last is taken back first."""

    def __init__(self, task: Task) -> None:
        self._values = [_ANY if variable.three_valued else _TWO for variable in task.variables]
        self._open: list[Some] = []
        self._known: set[int] = set()
        """The identities of the formulas in there."""
        self._reading: dict[int, list[int]] = {}
        """By variable, the numbers of open formulas that speak of it."""
        self._trail: list[tuple[int, int]] = []
        self._impossible = 0

    @property
    def impossible(self) -> bool:
        """Does nothing satisfy all that was added?"""
        return self._impossible > 0

    @contextmanager
    def meanwhile(self) -> Iterator[None]:
        """What is added until the end of the block is forgotten then."""
        mark, still_open, impossible = len(self._trail), len(self._open), self._impossible
        try:
            yield
        finally:
            while len(self._trail) > mark:
                variable, values = self._trail.pop()
                self._values[variable] = values
            while len(self._open) > still_open:
                gone = self._open.pop()
                self._known.discard(id(gone))
                for variable in _variables(gone):
                    self._reading[variable].pop()
            self._impossible = impossible

    def add(self, formula: Formula) -> None:
        """Take a formula to hold."""
        waiting = [formula]
        while waiting and not self._impossible:
            now = waiting.pop()
            match now:
                case Among(variable, values):
                    before = self._values[variable]
                    if not before & ~values:
                        continue
                    self._trail.append((variable, before))
                    self._values[variable] = before & values
                    if not before & values:
                        self._impossible += 1
                        return
                    waiting.extend(self._open[number] for number in self._reading.get(variable, ()))
                case All(parts):
                    waiting.extend(parts)
                case Some(parts):
                    left: list[Formula] = []
                    for part in parts:
                        holds = self._holds(part)
                        if holds:
                            break
                        if holds is None:
                            left.append(part)
                    else:
                        if not left:
                            self._impossible += 1
                        elif len(left) == 1:
                            waiting.append(left[0])
                        elif id(now) not in self._known:
                            self._keep(now)
                case _:
                    assert_never(now)

    def sure(self, condition: Condition) -> bool:
        """Is the condition true for sure?"""
        if isinstance(condition, And):
            return all(self.sure(part) for part in condition.parts)
        return self._excluded(at_most(condition, Truth.UNKNOWN))

    def never_unknown(self, condition: Condition) -> bool:
        """Is the condition true or false for sure?"""
        return self._excluded(worth(condition, NodeStatus.RUNNING))

    def possible(self, formula: Formula) -> bool:
        """May a formula hold besides?"""
        return not self._excluded(formula)

    def _excluded(self, formula: Formula) -> bool:
        with self.meanwhile():
            asked = len(self._open)
            self.add(formula)
            return self._refuted(asked, _CASES)

    def _refuted(self, asked: int, cases: int) -> bool:
        """Does nothing satisfy all that was added, whichever part holds of the formulas from a number on?"""
        if self.impossible or not cases:
            return self.impossible
        choices = [
            [part for part in each.parts if self._holds(part) is None]
            for each in self._open[asked:]
            if self._holds(each) is None
        ]
        if not choices:
            return False
        for part in min(choices, key=len):
            with self.meanwhile():
                self.add(part)
                if not self._refuted(asked, cases - 1):
                    return False
        return True

    def _keep(self, formula: Some) -> None:
        for variable in _variables(formula):
            self._reading.setdefault(variable, []).append(len(self._open))
        self._open.append(formula)
        self._known.add(id(formula))

    def _holds(self, formula: Formula) -> bool | None:
        """None: it may or may not."""
        match formula:
            case Among(variable, values):
                if not self._values[variable] & values:
                    return False
                return True if not self._values[variable] & ~values else None
            case All(parts) | Some(parts):
                settles = isinstance(formula, Some)
                found: bool | None = not settles
                for part in parts:
                    holds = self._holds(part)
                    if holds is settles:
                        return settles
                    if holds is None:
                        found = None
                return found
            case _:
                assert_never(formula)


def _variables(formula: Formula) -> Iterator[int]:
    """Each once, in a fixed order."""
    found: dict[int, None] = {}
    stack = [formula]
    while stack:
        now = stack.pop()
        if isinstance(now, Among):
            found[now.variable] = None
        else:
            stack.extend(now.parts)
    return iter(found)
