"""Tests of derived predicates, ``(known (d))`` and ``(unknown (d))``: whether ``d`` is the same in every
world still possible. That is no question about the facts behind it one by one, so a variable stands for each
``d`` that is asked for."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.ground import task as gt
from bbtc.model import domain as md
from bbtc.model import formula as mf


def with_asked(model: md.Model) -> tuple[md.Model, frozenset[str]]:
    """The model in which conditions test predicates that stand for derived ones, and the names of these. What
    effects ask under conditions stays."""
    asking = _Asking(model)
    schemas = {
        name: replace(schema, precondition=asking.formula(schema.precondition))
        for name, schema in model.schemas.items()
    }
    templates = {
        name: replace(
            template, precondition=asking.formula(template.precondition), body=asking.body(template.body)
        )
        for name, template in model.templates.items()
    }
    goal = None if model.goal is None else asking.formula(model.goal)
    if not asking.thresholds:
        return model, frozenset()
    predicates = {
        name: md.Predicate(name, each.parameters, declared_three_valued=True, inferred=True)
        for name, each in asking.thresholds.items()
    }
    made = replace(
        model,
        schemas=schemas,
        templates=templates,
        goal=goal,
        predicates={**model.predicates, **predicates},
        thresholds={**model.thresholds, **asking.thresholds},
    )
    return made, frozenset(asking.thresholds)


class _Asking:
    def __init__(self, model: md.Model) -> None:
        self._model = model
        self.thresholds: dict[str, md.Threshold] = {}

    def formula(self, formula: mf.Formula) -> mf.Formula:
        match formula:
            case mf.Test(kind, atom, span) if self._model.predicates[atom.predicate].derived:
                return mf.Test(kind, replace(atom, predicate=self._asked(atom.predicate)), span)
            case mf.Not(part, span):
                return mf.Not(self.formula(part), span)
            case mf.And(parts, span):
                return mf.And(tuple(map(self.formula, parts)), span)
            case mf.Or(parts, span):
                return mf.Or(tuple(map(self.formula, parts)), span)
            case mf.Quantified(_, _, part):
                return replace(formula, part=self.formula(part))
            case mf.Atom() | mf.Test() | mf.Equal() | mf.Compare():
                return formula
            case _:
                assert_never(formula)

    def body(self, body: md.Body) -> md.Body:
        match body:
            case md.BodyControl(_, children):
                return replace(body, children=tuple(map(self.body, children)))
            case md.BodyCondition(condition):
                return replace(body, condition=self.formula(condition))
            case md.BodyForeach(_, child) | md.BodyRetry(_, child):
                return replace(body, child=self.body(child))
            case md.BodyCall():
                return body
            case _:
                assert_never(body)

    def _asked(self, predicate: str) -> str:
        """The predicate that stands for a derived one."""
        name = gt.unused_name(f"asked {predicate}", self._model.predicates)
        if name not in self.thresholds:
            of = self._model.predicates[predicate]
            atom = mf.Atom(predicate, tuple(each.name for each in of.parameters))
            self.thresholds[name] = md.Threshold(of.parameters, atom, Fraction(1), predicate, of.span)
        return name
