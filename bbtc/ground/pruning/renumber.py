"""Ground tasks over other variables: the same ones in another order, or some of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from typing_extensions import assert_never

from bbtc.ground import task as gt
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within
from bbtc.ground.effects import arrange
from bbtc.markov import distribution


def reordered(task: gt.Task, order: Sequence[int]) -> gt.Task:
    """The task with the given variables, by their old numbers in their new order, without effects on others.
    Those that effects set keep their order."""
    renumber = {old: new for new, old in enumerate(order)}
    mapper = Renumbering(renumber)
    initial = distribution(
        (tuple(state.values[old] for old in renumber), state.probability) for state in task.initial
    )
    return replace(
        task,
        variables=tuple(task.variables[old] for old in renumber),
        initial=tuple(gt.InitialState(probability, values) for values, probability in initial.items()),
        goal=mapper.condition(task.goal),
        actions=tuple(map(mapper.action, task.actions)),
        events=tuple(map(mapper.event, task.events)),
        templates=tuple(map(mapper.template, task.templates)),
        components=tuple(map(mapper.component, task.components)),
    )


class Renumbering:
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
            case Within(digits):
                return replace(condition, digits=tuple(self.renumber[digit] for digit in digits))
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
            gt.Factor(gt.merge_outcomes(map(self._outcome, factor.outcomes)), factor.oneof)
            for factor in factors
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
        changes = tuple(
            self._change(change) for change in outcome.changes if change.digits[0] in self.renumber
        )
        return replace(outcome, effects=tuple(effects), factors=factors, charges=charges, changes=changes)

    def _change(self, change: gt.NumberChange) -> gt.NumberChange:
        cases = (
            case if case.when is None else replace(case, when=self.condition(case.when))
            for case in change.cases
        )
        return gt.NumberChange(tuple(self.renumber[digit] for digit in change.digits), tuple(cases))

    def action(self, action: gt.GroundAction) -> gt.GroundAction:
        """The action over the kept variables."""
        return replace(
            action,
            precondition=self.condition(action.precondition),
            factors=self.factors(action.factors) or (gt.NO_CHANGE,),
            changes=tuple(replace(change, seen=self._seen(change.seen)) for change in action.changes),
            during=None if action.during is None else self.condition(action.during),
            on_abort=self.factors(action.on_abort),
        )

    def event(self, event: gt.GroundEvent) -> gt.GroundEvent:
        """The event over the kept variables."""
        return replace(
            event,
            precondition=self.condition(event.precondition),
            factors=self.factors(event.factors) or (gt.NO_CHANGE,),
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
            case gt.BodyControl(_, children):
                return replace(body, children=tuple(self._body(child) for child in children))
            case gt.BodyCondition(condition):
                return gt.BodyCondition(self.condition(condition))
            case gt.BodyAction() | gt.BodyTemplate():
                return body
            case _:
                assert_never(body)
