"""Leaves out of a task what cannot matter to its goal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from typing_extensions import assert_never

from bbtc.ground import task as gt
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, variables
from bbtc.ground.effects import arrange, merge_outcomes


def prune(task: gt.Task) -> gt.Task:
    """The task without variables that nothing kept reads, without the effects on them, and without
    actions and templates that change nothing that matters.

    Backward relevance: the goal's variables matter; what sets a variable that matters is kept, and
    with it the variables its precondition and guards read. A template is kept if its guide sets a
    variable that matters (only its guide makes a planner insert it), or if a kept one calls it;
    then all its body is kept.
    Outcomes that become equal are merged. Under a reward metric actions with rewards are kept too.
    """
    relevance = _Relevance(task)
    relevance.close()
    kept = relevance.variables
    actions = [task.actions[index] for index in sorted(relevance.actions)]
    templates = [task.templates[index] for index in sorted(relevance.templates)]
    if len(actions) < len(task.actions) or len(templates) < len(task.templates):
        task = replace(task, actions=tuple(actions), templates=tuple(templates))
    return task if len(kept) == len(task.variables) else reordered(task, sorted(kept))


def reordered(task: gt.Task, order: Sequence[int]) -> gt.Task:
    """The task with the given variables, by their old numbers in their new order, without effects on others.
    Those that effects set keep their order."""
    renumber = {old: new for new, old in enumerate(order)}
    mapper = _Mapper(renumber)
    initial: dict[tuple[object, ...], gt.InitialState] = {}
    for state in task.initial:
        values = tuple(state.values[old] for old in renumber)
        before = initial.get(values)
        more = before.probability if before is not None else 0
        initial[values] = gt.InitialState(state.probability + more, values)
    return replace(
        task,
        variables=tuple(task.variables[old] for old in renumber),
        initial=tuple(initial.values()),
        goal=mapper.condition(task.goal),
        actions=tuple(map(mapper.action, task.actions)),
        templates=tuple(map(mapper.template, task.templates)),
    )


# --- relevance -------------------------------------------------------------------------------


class _Relevance:
    """The least sets of variables, actions and templates (by index) that matter."""

    def __init__(self, task: gt.Task) -> None:
        self.task = task
        self.variables: set[int] = set()
        self.actions: set[int] = set()
        self.templates: set[int] = set()
        self._fresh: list[int] = []
        self._action_index = {action.name: index for index, action in enumerate(task.actions)}
        self._template_index = {template.name: index for index, template in enumerate(task.templates)}
        # For each variable: the actions and templates that set it, with the guard they set it under.
        self._action_setters: dict[int, list[tuple[int, Condition | None]]] = {}
        self._template_setters: dict[int, list[tuple[int, Condition | None]]] = {}
        for index, action in enumerate(task.actions):
            for guard, variable in _settings(action.factors):
                self._action_setters.setdefault(variable, []).append((index, guard))
        for index, template in enumerate(task.templates):
            for guard, variable in _settings(template.factors):
                self._template_setters.setdefault(variable, []).append((index, guard))

    def close(self) -> None:
        """Start from the goal (and rewards, if they are the metric) and follow everything up."""
        self._read(self.task.goal)
        if self.task.metric == "reward":
            for index, action in enumerate(self.task.actions):
                if any(map(_earns, gt.outcomes_of(action.factors))):
                    self._keep_action(index)
        while self._fresh:
            variable = self._fresh.pop()
            for index, guard in self._action_setters.get(variable, ()):
                self._keep_action(index)
                self._read(guard)
            for index, guard in self._template_setters.get(variable, ()):
                self._keep_template(index)
                self._read(guard)

    def _read(self, condition: Condition | None) -> None:
        if condition is not None:
            for variable in variables(condition):
                if variable not in self.variables:
                    self.variables.add(variable)
                    self._fresh.append(variable)

    def _keep_action(self, index: int) -> None:
        if index not in self.actions:
            self.actions.add(index)
            action = self.task.actions[index]
            self._read(action.precondition)
            self._read_charges(action.factors)

    def _read_charges(self, factors: Iterable[gt.Factor]) -> None:
        for charge in gt.charges_of(factors):
            self._read(charge.when)

    def _keep_template(self, index: int) -> None:
        todo = [index]
        while todo:
            current = todo.pop()
            if current in self.templates:
                continue
            self.templates.add(current)
            template = self.task.templates[current]
            self._read(template.precondition)
            self._read_charges(template.factors)
            for part in gt.walk_body(template.body):
                match part:
                    case gt.BodyCondition(condition):
                        self._read(condition)
                    case gt.BodyAction(action):
                        self._keep_action(self._action_index[action])
                    case gt.BodyTemplate(called):
                        todo.append(self._template_index[called])
                    case gt.BodyControl():
                        pass
                    case _:
                        assert_never(part)


def _earns(outcome: gt.Outcome) -> bool:
    return bool(outcome.reward) or any(charge.reward for charge in outcome.charges)


def _settings(factors: Iterable[gt.Factor]) -> Iterator[tuple[Condition | None, int]]:
    for effect in gt.effects_of(factors):
        for variable, _ in effect.sets:
            yield effect.when, variable


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
        )

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
