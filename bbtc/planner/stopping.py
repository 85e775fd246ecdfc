"""Stopping where the goal is not known, but believed: plans for the probability that it is true then.

A task whose goal may be stopped at is planned as one with an action more, *stop*, which shows the robot
whether the goal is true, and after which nothing else can be done. P* of that task is the greatest
probability, over all policies, that the robot stops and the goal is true; in the tree, to stop is to succeed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.belief.chain import explore
from bbtc.belief.hidden import refuse_hidden
from bbtc.belief.simulate import figures
from bbtc.ground.condition import (
    FALSE,
    TRUE,
    Condition,
    Is,
    Known,
    conjunction,
    conjuncts,
    is_test,
    leaves,
    negation,
    replaced,
    variables,
)
from bbtc.ground.pruning.renumber import reordered
from bbtc.ground.task import (
    ONE,
    Change,
    Effect,
    Factor,
    GroundAction,
    InitialState,
    Outcome,
    Task,
    Variable,
    unused_name,
)
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.rewrite.simplify import numbered, simplified
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node


def doubtful_goal(task: Task) -> bool:
    """Does the goal read what is believed only, and need not be true where it is met?"""
    read = set(variables(task.goal))
    return any(
        each.variable in read and each.at_least < 1
        for component in task.components
        for each in component.known
    )


@dataclass(frozen=True, slots=True)
class Stopping:
    """A task, and the one that is planned for it, with the action ``stop``."""

    own: Task
    task: Task
    stop: str
    added: frozenset[int]
    """Variables of the planned task that its own does not have."""

    @classmethod
    def of(cls, task: Task, *, anywhere: bool) -> Stopping | None:
        """Stopping wherever the goal is believed, or ``anywhere``; None where the goal reads nothing that is
        hidden. Raises :class:`bbtc.diagnostics.BbtcError` (BBT0506) for a part of the goal that reads more
        than one component."""
        parts, seen = _by_component(task)
        if not parts:
            return None
        predicates = {variable.predicate for variable in task.variables}
        schemas = {action.schema for action in task.actions}
        stop = unused_name("stop", schemas)
        done = Variable(unused_name("stopped", predicates), (), three_valued=False)
        true = unused_name("true", predicates)
        reached = [Variable(true, (str(index + 1),), three_valued=False) for index in parts]
        first = len(task.variables)
        going = Is(first, Truth.FALSE)
        changes = tuple(
            _shown(task, index, conditions, first + 1 + place)
            for place, (index, conditions) in enumerate(parts.items())
        )
        ready = conjunction([going, *seen, *([] if anywhere else [task.goal])])
        ends = Factor((Outcome(ONE, (Effect(None, ((first, Truth.TRUE),)),)),))
        action = GroundAction(stop, (), ready, (ends,), Fraction(0), changes)
        others = (
            replace(each, precondition=conjunction([going, each.precondition])) for each in task.actions
        )
        planned = replace(
            task,
            variables=(*task.variables, done, *reached),
            initial=tuple(
                InitialState(state.probability, (*state.values, Truth.FALSE, *(Truth.FALSE for _ in reached)))
                for state in task.initial
            ),
            goal=conjunction(Is(first + 1 + place, Truth.TRUE) for place in range(len(reached))),
            actions=tuple(sorted((*others, action), key=lambda each: each.name)),
            templates=(),
        )
        return cls(task, planned, action.name, frozenset(range(first, first + 1 + len(reached))))

    def tree_of(self, plan: Plan, limits: Limits) -> Plan:
        """A plan for the planned task as one for its own: where it stops, its tree succeeds. Raises
        :class:`bbtc.diagnostics.LimitReached`."""
        found = plan.tree.task
        kept = [variable for variable in range(len(found.variables)) if variable not in self.added]
        number = {old: new for new, old in enumerate(kept)}
        task = reordered(replace(found, goal=self.own.goal, actions=self._own_actions(found)), kept)
        root = self._node(plan.tree.root, number)
        root = numbered(simplified(task, root, limits))
        chain = explore(task, root, limits)
        done = figures(task, root, chain)
        tree = replace(plan.tree, task=task, root=root, success_probability=done.success)
        return replace(plan, tree=tree, figures=done, chain=chain)

    def _own_actions(self, found: Task) -> tuple[GroundAction, ...]:
        """Preconditions and changes as they were: the variables of the own task stand first in both."""
        own = self.own.action_by_name
        return tuple(own[action.name] for action in found.actions if action.name in own)

    def _node(self, node: Node, number: dict[int, int]) -> Node:
        match node:
            case ActionNode():
                return ConditionNode(node.id, TRUE) if node.action == self.stop else node
            case ConditionNode():
                if node.condition == self.task.goal:
                    return ConditionNode(node.id, known_goal(self.own))
                return replace(node, condition=self._condition(node.condition, number))
            case ControlNode():
                return replace(node, children=tuple(self._node(child, number) for child in node.children))

    def _condition(self, condition: Condition, number: dict[int, int]) -> Condition:
        def leaf(each: Is | Known) -> Condition:
            if each.variable in self.added:  # nothing is done once it has stopped
                return TRUE if isinstance(each, Known) or each.value is Truth.FALSE else FALSE
            return replace(each, variable=number[each.variable])

        return replaced(condition, leaf)


def stopping_of(task: Task, options: Options) -> Stopping | None:
    """How to stop at the goal of a task, if it may be stopped at without being known. Raises as
    :meth:`Stopping.of` does."""
    if task.components and (options.allow_guess or doubtful_goal(task)):
        return Stopping.of(task, anywhere=options.allow_guess)
    return None


def known_goal(task: Task) -> Condition:
    """The goal, false where something that it reads is unknown."""
    unsure = {each.variable for component in task.components for each in component.known}
    read = dict.fromkeys(variable for variable in variables(task.goal) if variable in unsure)
    return conjunction([*map(Known, read), task.goal])


def _by_component(task: Task) -> tuple[dict[int, list[Condition]], list[Condition]]:
    """The parts of the goal that read a component, by component, and those that read none."""
    owner = {
        each.variable: index for index, component in enumerate(task.components) for each in component.known
    }
    parts: dict[int, list[Condition]] = {}
    seen: list[Condition] = []
    for part in conjuncts(task.goal):
        found = {
            owner[leaf.variable] for leaf in leaves(part) if leaf.variable in owner and not is_test(leaf)
        }
        if len(found) > 1:
            refuse_hidden(task, "stopped at, where a part of the goal joins facts that are apart")
        if found:
            parts.setdefault(found.pop(), []).append(part)
        else:
            seen.append(part)
    return parts, seen


def _shown(task: Task, index: int, parts: Iterable[Condition], reached: int) -> Change:
    """The robot sees whether some parts of the goal are true."""
    component = task.components[index]
    condition = conjunction(parts)
    known = {each.variable: each.condition for each in component.known}
    others = sorted(
        {leaf.variable for leaf in leaves(condition) if leaf.variable not in known or is_test(leaf)}
    )
    seen = (*others, reached)
    local = {variable: len(component.facts) + place for place, variable in enumerate(seen)}

    def leaf(each: Is | Known) -> Condition:
        if each.variable in known and isinstance(each, Is) and not is_test(each):
            inner = known[each.variable]
            return inner if each.value is Truth.TRUE else negation(inner)
        return replace(each, variable=local[each.variable])

    true = Effect(replaced(condition, leaf), ((local[reached], Truth.TRUE),))
    return Change(index, seen, (Factor((Outcome(ONE, (true,)),)),))
