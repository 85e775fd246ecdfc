"""The ``:init`` section, resolved."""

from __future__ import annotations

from fractions import Fraction

from typing_extensions import assert_never

from bbtc.analysis import formulas, truth_words
from bbtc.analysis.names import Names
from bbtc.diagnostics import Related
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.source import Span
from bbtc.syntax import ast


def initial(names: Names, inits: list[ast.Init]) -> md.Init:
    """Certain facts, numbers and everything uncertain; errors are reported."""
    reader = _Reader(names)
    for init in inits:
        for element in init.elements:
            reader.read(element)
    return md.Init(
        tuple(reader.facts.values()),
        reader.numbers,
        tuple(reader.choices),
        tuple(reader.clauses),
        inits[0].span if inits else None,
    )


class _Reader:
    def __init__(self, names: Names) -> None:
        self.names = names
        self.facts: dict[tuple[str, tuple[str, ...]], md.InitialFact] = {}
        self.numbers: dict[tuple[str, tuple[str, ...]], Fraction] = {}
        self.places: dict[tuple[str, tuple[str, ...]], Span] = {}
        self.choices: list[me.Effect] = []
        self.clauses: list[md.InitialClause] = []

    def read(self, element: ast.InitElement) -> None:
        names = self.names
        match element:
            case ast.Assign():
                self._fact(element)
            case ast.InitAnd(parts):
                for part in parts:
                    self.read(part)
            case ast.Probabilistic() | ast.OneOf() | ast.EffectForall():
                self.choices.append(formulas.effect(names, element, {}))
            case ast.FluentValue(fluent, value):
                self._number(fluent, value)
            case ast.InitClause(ast.Or(()), span):
                formulas.nothing_to_choose(names, "or", span)
            case ast.InitClause(formula, span):
                self.clauses.append(md.InitialClause(formulas.formula(names, formula, {}), False, span))
            case ast.Invariant(parts, span):
                either = mf.Or(tuple(formulas.formula(names, part, {}) for part in parts), span)
                self.clauses.append(md.InitialClause(either, True, span))
            case ast.Unsupported():
                formulas.unsupported(names, element)
            case ast.Empty():
                pass
            case _:
                assert_never(element)

    def _fact(self, given: ast.Assign) -> None:
        test = truth_words.tested(self.names, given.atom)
        if test is not None and given.value is Truth.FALSE:
            # As with the parentheses that it lacks: uncertain, and refused as such.
            denied = formulas.formula(self.names, ast.Not(test, given.span), {})
            self.clauses.append(md.InitialClause(denied, False, given.span))
            return
        element = truth_words.assigned(self.names, given)
        atom = None if element is None else formulas.atom(self.names, element.atom, {})
        if element is None or atom is None:
            return
        key = (atom.predicate, atom.args)
        fact = md.InitialFact(atom.predicate, atom.args, element.value, element.span)
        before = self.facts.setdefault(key, fact)
        if before.value is not fact.value:
            self.names.report.error(
                "BBT0223",
                f"`{element.atom.span.text}` is given two values at the start",
                element.span,
                related=[Related(f"first given as {before.value.word} here", before.span)],
            )
        elif self.names.predicates[atom.predicate].derived:
            self.names.report.error(
                "BBT0219",
                f"the derived predicate `{element.atom.predicate.text}` cannot be set",
                element.span,
                "its rules alone say when it holds",
            )

    def _number(self, fluent: ast.FluentRef, value: ast.Number) -> None:
        names = self.names
        function = names.functions.get(fluent.name.key)
        if function is None:
            if fluent.name.key not in names.costs and fluent.name.key not in names.rewards:
                names.unknown("BBT0220", "function", fluent.name, names.functions)
            return
        args = names.arguments("function", fluent.name, function, fluent.args, {}, span=fluent.span)
        if args is None:
            return
        key = (fluent.name.key, args)
        first = self.places.setdefault(key, fluent.span)
        if self.numbers.setdefault(key, value.value) != value.value:
            names.report.error(
                "BBT0223",
                f"`{fluent.span.text}` is given two values at the start",
                fluent.span,
                related=[Related(f"first given as {self.numbers[key]} here", first)],
            )
