"""The tree under construction: conditions to hold, and the attempts inserted to make them hold.

A draft keeps what the frozen tree forgets (which condition a branch is for), so that the planner
can find the place of an insertion; :func:`freeze` turns it into nodes:

* a subgoal without attempts is a condition node;
* attempts to observe it stand as ``Skipper(c, Fallback(attempt…))``;
* attempts to achieve it stand as ``Fallback(c or that Skipper, attempt…)``;
* an attempt is ``Sequence(preconditions…, action or template body, post-check)``. The post-check
  of an observation is ``known(c)``, that of an action is ``c`` itself.

In a reactive draft actions are not latched: an attempt tries again for as long as its place in the tree
asks for it, and needs no post-check.

Preconditions that the place of an attempt already implies are left out (:func:`_implied`). Node
ids are given when a node is first needed and never change, so a refinement leaves the ids of what
stood before it alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.condition import (
    Condition,
    Is,
    Known,
    conjunction,
    conjuncts,
    negation,
    variables,
)
from bbtc.ground.describe import describe
from bbtc.ground.task import (
    Body,
    BodyAction,
    BodyCondition,
    BodyControl,
    BodyTemplate,
    GroundAction,
    GroundTemplate,
    Task,
    apparent_factors,
    effects_of,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, tree_depth
from bbtc.tree.validate import MAX_DEPTH

Doing: TypeAlias = GroundAction | GroundTemplate


@dataclass(slots=True, eq=False)
class Subgoal:
    """A condition that must hold here, with the attempts at observing and at achieving it."""

    condition: Condition
    parent: Attempt | None
    sensing: list[Attempt] = field(default_factory=list)
    acting: list[Attempt] = field(default_factory=list)
    ids: dict[str, str] = field(default_factory=dict)

    def attempts(self) -> Iterator[Attempt]:
        """All attempts, observing ones first."""
        yield from self.sensing
        yield from self.acting


@dataclass(slots=True, eq=False)
class Attempt:
    """One inserted branch. ``doing`` is None for a branch that only splits a disjunction into
    the preconditions of one of its parts."""

    subgoal: Subgoal
    doing: Doing | None
    preconditions: list[Subgoal] = field(default_factory=list)
    ids: dict[str, str] = field(default_factory=dict)

    def ancestors(self) -> Iterator[Attempt]:
        """This attempt and those it is nested in, innermost first."""
        attempt: Attempt | None = self
        while attempt is not None:
            yield attempt
            attempt = attempt.subgoal.parent


@dataclass(frozen=True, slots=True)
class Owner:
    """What a node of the frozen tree belongs to: the subgoal whose condition it reads, or the
    attempt whose template body it is part of."""

    subgoal: Subgoal | None
    attempt: Attempt | None


@dataclass(slots=True)
class Draft:
    """The root conditions in order, and the source of node ids."""

    task: Task
    goals: list[Subgoal]
    ids: dict[str, str] = field(default_factory=dict)
    next_id: int = 1
    reactive: bool = False

    @classmethod
    def start(cls, task: Task, *, reactive: bool = False) -> Draft:
        """The draft the paper starts from: the goal's conditions, nothing inserted."""
        goals = [Subgoal(part, None) for part in conjuncts(task.goal) or (task.goal,)]
        return cls(task, goals, reactive=reactive)

    def copied(self) -> tuple[Draft, dict[Subgoal, Subgoal]]:
        """A draft of its own, and its subgoals by those they are copies of."""
        copies: dict[Subgoal, Subgoal] = {}

        def subgoal(old: Subgoal, parent: Attempt | None) -> Subgoal:
            new = copies[old] = Subgoal(old.condition, parent, ids=dict(old.ids))
            new.sensing = [attempt(each, new) for each in old.sensing]
            new.acting = [attempt(each, new) for each in old.acting]
            return new

        def attempt(old: Attempt, of: Subgoal) -> Attempt:
            new = Attempt(of, old.doing, ids=dict(old.ids))
            new.preconditions = [subgoal(each, new) for each in old.preconditions]
            return new

        goals = [subgoal(goal, None) for goal in self.goals]
        return replace(self, goals=goals, ids=dict(self.ids)), copies


def new_attempt(subgoal: Subgoal, doing: Doing | None, conditions: list[Condition]) -> Attempt:
    """An attempt with a fresh subgoal for each precondition."""
    attempt = Attempt(subgoal, doing)
    attempt.preconditions = [Subgoal(condition, attempt) for condition in conditions]
    return attempt


def actions_in(task: Task, body: Body) -> Iterator[GroundAction]:
    """The actions of a template body, from left to right; those of a called template where it is called
    first. (A few templates that call one another can stand for very many nodes.)"""
    stack: list[Body] = [body]
    called: set[str] = set()
    while stack:
        part = stack.pop()
        match part:
            case BodyControl():
                stack.extend(reversed(part.children))
            case BodyCondition():
                pass
            case BodyAction():
                yield task.action_by_name[part.action]
            case BodyTemplate():
                if part.template not in called:
                    called.add(part.template)
                    stack.append(task.template_by_name[part.template].body)
            case _:
                assert_never(part)


def changed_by(task: Task, body: Body) -> frozenset[int]:
    """Variables that the actions of a template body can change."""
    return frozenset().union(*(changes(task, action) for action in actions_in(task, body)))


def changes(task: Task, action: GroundAction) -> frozenset[int]:
    """Variables that an action can change."""
    effects = effects_of(apparent_factors(task, action))
    return frozenset(variable for effect in effects for variable, _ in effect.sets)


class _Freezer:
    """Builds the nodes of a draft and remembers what each belongs to."""

    def __init__(self, draft: Draft, limits: Limits) -> None:
        self.draft = draft
        self.limits = limits
        self.nodes = 0
        self.calls = self.controls = 0  # how deep in the bodies of templates
        self.task = draft.task
        self.owners: dict[str, Owner] = {}
        self.actions: dict[str, Attempt] = {}

    def id(self, ids: dict[str, str], role: str) -> str:
        self.nodes += 1
        self.limits.check_nodes(self.nodes)
        if role not in ids:
            ids[role] = f"n{self.draft.next_id}"
            self.draft.next_id += 1
        return ids[role]

    def check(self, subgoal: Subgoal, ids: dict[str, str], role: str, condition: Condition) -> Node:
        node = ConditionNode(self.id(ids, role), condition)
        self.owners[node.id] = Owner(subgoal, None)
        return node

    def control(self, ids: dict[str, str], kind: ControlKind, role: str, children: list[Node]) -> Node:
        """A control node, or the child itself if there is only one."""
        if len(children) == 1:
            return children[0]
        return ControlNode(self.id(ids, role), kind, tuple(children))

    def subgoal(self, subgoal: Subgoal) -> Node:
        node = self.check(subgoal, subgoal.ids, "check", subgoal.condition)
        if subgoal.sensing:
            attempts = [self.attempt(attempt, sensing=True) for attempt in subgoal.sensing]
            last = self.control(subgoal.ids, "fallback", "observations", attempts)
            node = self.control(subgoal.ids, "skipper", "skipper", [node, last])
        if subgoal.acting:
            attempts = [self.attempt(attempt, sensing=False) for attempt in subgoal.acting]
            node = self.control(subgoal.ids, "fallback", "fallback", [node, *attempts])
        return node

    def attempt(self, attempt: Attempt, *, sensing: bool) -> Node:
        subgoal = attempt.subgoal
        goal = subgoal.condition
        children: list[Node] = []
        for position, precondition in enumerate(attempt.preconditions):
            if (
                not precondition.sensing
                and not precondition.acting
                and _implied(precondition.condition, subgoal, sensing=sensing)
            ):
                continue
            if precondition.condition == negation(goal):
                # The subgoal itself, read the other way round: it is resolved there, not here.
                role = f"implied{position}"
                children.append(self.check(subgoal, attempt.ids, role, precondition.condition))
            else:
                children.append(self.subgoal(precondition))
        children.extend(self.doing(attempt))
        if self.draft.reactive and isinstance(attempt.doing, GroundAction):
            return self.control(attempt.ids, "sequence", "sequence", children)
        post = conjunction(Known(v) for v in dict.fromkeys(variables(goal))) if sensing else goal
        children.append(self.check(subgoal, attempt.ids, "post", post))
        return ControlNode(
            self.id(attempt.ids, "sequence"), "sequence", tuple(children), reason=describe(self.task, goal)
        )

    def doing(self, attempt: Attempt) -> list[Node]:
        match attempt.doing:
            case None:
                return []
            case GroundAction():
                return [self.action(attempt, "action", attempt.doing.name, guarded=False)]
            case GroundTemplate():
                return [self.template(attempt, "body", attempt.doing)]
            case _:
                assert_never(attempt.doing)

    def action(self, attempt: Attempt, role: str, name: str, *, guarded: bool) -> Node:
        latched = not self.draft.reactive
        node = ActionNode(self.id(attempt.ids, role), name, latched=latched, guarded=guarded)
        self.actions[node.id] = attempt
        self.owners[node.id] = Owner(None, attempt)
        return node

    def template(self, attempt: Attempt, role: str, template: GroundTemplate) -> Node:
        self.calls += 1
        if self.calls > MAX_DEPTH:
            raise _too_deep()
        body = self.body(attempt, role, template.body)
        self.calls -= 1
        if isinstance(body, ControlNode) and body.template is None:
            return replace(body, template=template.name)
        # A body of one leaf, or of one call: the template still shows as a node of its own.
        return ControlNode(self.id(attempt.ids, f"{role}.call"), "sequence", (body,), template=template.name)

    def body(self, attempt: Attempt, role: str, body: Body) -> Node:
        match body:
            case BodyControl():
                self.controls += 1
                if self.controls > MAX_DEPTH:
                    raise _too_deep()
                children: list[Node] = []
                for position, child in enumerate(body.children):  # a loop: few frames for each level
                    children.append(self.body(attempt, f"{role}.{position}", child))
                self.controls -= 1
                key = self.id(attempt.ids, role)
                return ControlNode(key, body.kind, tuple(children), attempts=body.attempts)
            case BodyCondition():
                node = ConditionNode(self.id(attempt.ids, role), body.condition)
                self.owners[node.id] = Owner(None, attempt)
                return node
            case BodyAction():
                action = self.task.action_by_name[body.action]
                guarded = bool(conjuncts(action.precondition))
                return self.action(attempt, role, action.name, guarded=guarded)
            case BodyTemplate():
                # A role of its own: both templates may show as nodes of their own.
                return self.template(attempt, f"{role}.called", self.task.template_by_name[body.template])
            case _:
                assert_never(body)


def _too_deep() -> LimitReached:
    message = f"a tree has at most {MAX_DEPTH} levels, which ended planning"
    return LimitReached([Diagnostic("BBT0504", message, hint="another strategy may need fewer")])


def _implied(condition: Condition, subgoal: Subgoal, *, sensing: bool) -> bool:
    """Does the place of an attempt imply a precondition of it?

    Under a Skipper the literal is unknown whenever an attempt is ticked; under a Fallback
    whose first child is the plain literal, it is false.
    """
    goal = subgoal.condition
    if sensing:
        return isinstance(goal, Is) and condition == Is(goal.variable, Truth.UNKNOWN)
    return not subgoal.sensing and isinstance(goal, Is | Known) and condition == negation(goal)


@dataclass(frozen=True, slots=True)
class Frozen:
    """The nodes of a draft; ``owners`` by id of condition and action nodes, ``attempts`` by id
    of action nodes."""

    root: Node
    owners: dict[str, Owner]
    attempts: dict[str, Attempt]


def freeze(draft: Draft, limits: Limits) -> Frozen:
    """The draft as a tree. Raises :class:`bbtc.diagnostics.LimitReached` if it has too many nodes, or more
    levels than a tree may have."""
    freezer = _Freezer(draft, limits)
    goals = [freezer.subgoal(goal) for goal in draft.goals]
    root = freezer.control(draft.ids, "sequence", "root", goals)
    if tree_depth(root) > MAX_DEPTH:
        raise _too_deep()
    return Frozen(root, freezer.owners, freezer.actions)
