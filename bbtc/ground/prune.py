"""Leaves out of a task with templates what cannot matter to its goal.

What the body of a template calls, and with which arguments, is known only once it is made; without
templates :mod:`bbtc.ground.relevance` tells from argument rows, before anything is made.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

from typing_extensions import assert_never

from bbtc.ground import task as gt
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, variables
from bbtc.ground.effects import arrange, merge_outcomes
from bbtc.markov import distribution, reachable


def prune(task: gt.Task) -> gt.Task:
    """The task without variables that nothing kept reads, without the effects on them, and without
    actions and templates that change nothing that matters.

    Backward relevance: the goal's variables matter; what sets a variable that matters is kept, and
    with it the variables its precondition and guards read. A template is kept if its guide sets a
    variable that matters (only its guide makes a planner insert it), or if a kept one calls it;
    then all its body is kept.
    Outcomes that become equal are merged. Under a reward metric actions with rewards are kept too.
    """
    relevant = _relevant(task)
    actions = [each for index, each in enumerate(task.actions) if ("action", index) in relevant]
    templates = [each for index, each in enumerate(task.templates) if ("template", index) in relevant]
    kept = [index for index in range(len(task.variables)) if ("variable", index) in relevant]
    if len(actions) < len(task.actions) or len(templates) < len(task.templates):
        task = replace(task, actions=tuple(actions), templates=tuple(templates))
    return task if len(kept) == len(task.variables) else reordered(task, kept)


def reordered(task: gt.Task, order: Sequence[int]) -> gt.Task:
    """The task with the given variables, by their old numbers in their new order, without effects on others.
    Those that effects set keep their order."""
    renumber = {old: new for new, old in enumerate(order)}
    mapper = _Mapper(renumber)
    initial = distribution(
        (tuple(state.values[old] for old in renumber), state.probability) for state in task.initial
    )
    return replace(
        task,
        variables=tuple(task.variables[old] for old in renumber),
        initial=tuple(gt.InitialState(probability, values) for values, probability in initial.items()),
        goal=mapper.condition(task.goal),
        actions=tuple(map(mapper.action, task.actions)),
        templates=tuple(map(mapper.template, task.templates)),
        components=tuple(map(mapper.component, task.components)),
    )


# --- relevance -------------------------------------------------------------------------------

_Node: TypeAlias = tuple[Literal["variable", "action", "template"], int]


def _relevant(task: gt.Task) -> set[_Node]:
    """What can be reached from the goal where a variable leads to what sets it and to the guards of that, and
    an action or a template to what it reads and calls."""
    actions = {action.name: index for index, action in enumerate(task.actions)}
    templates = {template.name: index for index, template in enumerate(task.templates)}
    setters: dict[int, list[_Node]] = {}
    owners: list[tuple[_Node, tuple[gt.Factor, ...]]] = [
        *((("action", index), action.factors) for index, action in enumerate(task.actions)),
        *((("template", index), template.factors) for index, template in enumerate(task.templates)),
    ]
    for owner, factors in owners:
        for effect in gt.effects_of(factors):
            for variable, _ in effect.sets:
                setters.setdefault(variable, []).extend([owner, *_read(effect.when)])

    def leads(node: _Node) -> Iterator[_Node]:
        kind, index = node
        if kind == "variable":
            yield from setters.get(index, ())
            return
        each = task.actions[index] if kind == "action" else task.templates[index]
        yield from _read(each.precondition)
        for charge in gt.charges_of(each.factors):
            yield from _read(charge.when)
        for part in gt.walk_body(each.body) if isinstance(each, gt.GroundTemplate) else ():
            match part:
                case gt.BodyCondition(condition):
                    yield from _read(condition)
                case gt.BodyAction(action):
                    yield "action", actions[action]
                case gt.BodyTemplate(called):
                    yield "template", templates[called]
                case gt.BodyControl():
                    pass
                case _:
                    assert_never(part)

    start = list(_read(task.goal))
    if task.metric == "reward":
        start += [node for node, factors in owners if node[0] == "action" and _earns(factors)]
    return reachable(start, leads)


def _read(condition: Condition | None) -> Iterator[_Node]:
    return (("variable", number) for number in (() if condition is None else variables(condition)))


def _earns(factors: Iterable[gt.Factor]) -> bool:
    return any(
        outcome.reward or any(charge.reward for charge in outcome.charges)
        for outcome in gt.outcomes_of(factors)
    )


# --- leaving out -----------------------------------------------------------------------------


class _Mapper:
    """Rewrites conditions and effects to the kept variables; equal conditions stay shared."""

    def __init__(self, renumber: Mapping[int, int]) -> None:
        self.renumber = renumber
        self._conditions: dict[Condition, Condition] = {}

    def condition(self, condition: Condition) -> Condition:
        """The condition over the new numbers (all its variables are kept)."""
        found = self._conditions.get(condition)
        if found is None:
            found = self._conditions[condition] = self._renumbered(condition)
        return found

    def _renumbered(self, condition: Condition) -> Condition:
        match condition:
            case Is(variable, value):
                return Is(self.renumber[variable], value)
            case Known(variable):
                return Known(self.renumber[variable])
            case And(parts):
                return And(tuple(self.condition(part) for part in parts))
            case Or(parts):
                return Or(tuple(self.condition(part) for part in parts))
            case Not(part):
                return Not(self.condition(part))
            case Constant():
                return condition
            case _:
                assert_never(condition)

    def factors(self, factors: Iterable[gt.Factor]) -> tuple[gt.Factor, ...]:
        """The factors without those that no longer do anything."""
        return arrange(
            gt.Factor(merge_outcomes(map(self._outcome, factor.outcomes)), factor.oneof) for factor in factors
        )

    def _outcome(self, outcome: gt.Outcome) -> gt.Outcome:
        effects = []
        for effect in outcome.effects:
            sets = tuple((self.renumber[v], value) for v, value in effect.sets if v in self.renumber)
            if sets:
                # A guard is kept with what it guards.
                when = None if effect.when is None else self.condition(effect.when)
                effects.append(gt.Effect(when, sets))
        factors = self.factors(outcome.factors)
        charges = tuple(replace(charge, when=self.condition(charge.when)) for charge in outcome.charges)
        return replace(outcome, effects=tuple(effects), factors=factors, charges=charges)

    def action(self, action: gt.GroundAction) -> gt.GroundAction:
        """The action over the kept variables."""
        return replace(
            action,
            precondition=self.condition(action.precondition),
            factors=self.factors(action.factors) or (gt.NO_CHANGE,),
            changes=tuple(replace(change, seen=self._seen(change.seen)) for change in action.changes),
        )

    def component(self, component: gt.Component) -> gt.Component:
        """The component over the kept variables."""
        known = tuple(replace(each, variable=self.renumber[each.variable]) for each in component.known)
        return replace(component, known=known, seen=self._seen(component.seen))

    def _seen(self, seen: Iterable[int]) -> tuple[int, ...]:
        return tuple(self.renumber[variable] for variable in seen)

    def template(self, template: gt.GroundTemplate) -> gt.GroundTemplate:
        """The template over the kept variables."""
        return replace(
            template,
            precondition=self.condition(template.precondition),
            factors=self.factors(template.factors),
            body=self._body(template.body),
        )

    def _body(self, body: gt.Body) -> gt.Body:
        match body:
            case gt.BodyControl(kind, children):
                return gt.BodyControl(kind, tuple(self._body(child) for child in children))
            case gt.BodyCondition(condition):
                return gt.BodyCondition(self.condition(condition))
            case gt.BodyAction() | gt.BodyTemplate():
                return body
            case _:
                assert_never(body)
