"""Formulas, effects, terms and numbers as syntax nodes: the productions of the lower part of the grammar.

The grammar doubles some forms for speed: ``(not (p a))`` is one token, while ``(not (or …))`` is a nest of
productions. Both give the same node; the docstring of either method names the other.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal, TypeAlias

from bbtc.kleene import Truth
from bbtc.source import Span
from bbtc.syntax import ast, leaves
from bbtc.syntax.engine import Token
from bbtc.syntax.hints import CONNECTIVES, NOT_IN_EFFECT, nearest
from bbtc.syntax.leaves import Misuse

DRAWN: Mapping[str, tuple[Literal["uniform", "triangular", "lognormal"], tuple[str, ...]]] = {
    "uniform": ("uniform", ("least", "greatest")),
    "triangular": ("triangular", ("least", "likeliest", "greatest")),
    "lognormal": ("lognormal", ("median", "sigma")),
}
"""Distributions of durations, and what numbers they take."""


_WHENS: Mapping[str, ast.Moment] = {"AT_START": "at start", "OVER_ALL": "over all", "AT_END": "at end"}
Operand: TypeAlias = ast.Term | ast.NumericExpression | ast.Unsupported

_WORD = re.compile(r"\??[^\s()?]+")


def keyword(head: Token) -> str:
    """The keyword in a terminal that opens a form."""
    return head.text.lstrip("(").strip().lower()


def unsupported(construct: str, first: Token, last: Token) -> ast.Unsupported:
    """What stands from one token to another, refused by name."""
    return ast.Unsupported(construct, leaves.plain_text(first, last), first.to(last))


def parameters_of(entries: ast.TypedList, last: Token) -> ast.TypedList:
    """Parameters of a form that ends with a token. Some files write ``?b-block`` for ``?b - block``: read it
    so where the form uses ``?b`` and never ``?b-block``."""
    if not any("-" in name.text for group in entries for name in group.names):
        return entries
    end = entries[-1].span.end
    used = {word.lower() for word in _WORD.findall(last.source.text[end : last.start])}
    groups: list[ast.TypedGroup] = []
    for group in entries:
        names: list[ast.Term] = []
        for name in group.names:
            short, _, kind = name.text.partition("-")
            if not kind or kind[0] == "-" or name.key in used or short.lower() not in used:
                names.append(name)
                continue
            source, start, stop = name.span
            middle = start + len(short)
            names.append(ast.Variable(short, Span(source, start, middle)))
            type_name = ast.Name(kind, Span(source, middle + 1, stop))
            groups.append(ast.TypedGroup(tuple(names), (type_name,), Span(source, names[0].span.start, stop)))
            names = []
        if names:
            span = Span(group.span.source, names[0].span.start, group.span.end)
            groups.append(ast.TypedGroup(tuple(names), group.types, span))
    return tuple(groups)


def numeric(operand: Operand) -> ast.NumericExpression | None:
    """An operand as a numeric expression, if it is one."""
    match operand:
        case ast.Number() | ast.FluentRef() | ast.Arithmetic():
            return operand
        case ast.Name():
            leaves.refuse_head(operand.text, operand.span, "a number or a numeric fluent")
            return ast.FluentRef(operand, (), operand.span)
        case _:
            return None


def seconds(head: Token, operand: Operand) -> ast.NumericExpression:
    """A number of seconds."""
    expression = numeric(operand)
    if expression is None:
        span = operand.span if isinstance(operand, ast.Unsupported) else head.span
        message, hint = (
            "this is no number of seconds",
            "a number, or a function that `:init` gives: `(time ?a ?b)`",
        )
        raise Misuse("BBT0101", message, span, hint)
    return expression


def _as_term(operand: Operand) -> ast.Term | None:
    """An operand as a term, if it can be one: a number may name an object."""
    match operand:
        case ast.Name() | ast.Variable():
            return operand
        case ast.Number(text, span):
            return ast.Name(text, span)
        case _:
            return None


class Expressions:
    """Callbacks of the parser, named as the rules and their aliases."""

    # --- terms and numbers -------------------------------------------------------------------

    def term(self, token: Token) -> ast.Term:
        return ast.Variable(token.text, token.span) if token.kind == "VARIABLE" else leaves.name(token)

    def number(self, token: Token) -> ast.Number:
        return leaves.number(token.text, token.span)

    def fluent(self, token: Token) -> ast.FluentRef:
        atom = leaves.flat(token)
        return ast.FluentRef(atom.predicate, atom.args, atom.span)

    def arithmetic(self, head: Token, operands: list[Operand], close: Token) -> Operand:
        parts = [part for part in map(numeric, operands) if part is not None]
        if len(parts) < len(operands):
            return unsupported("arithmetic on objects", head, close)
        return ast.Arithmetic(keyword(head), tuple(parts), head.to(close))

    def nested(self, head: Token, _operands: list[Operand], close: Token) -> ast.Unsupported:
        """An atom whose arguments are no plain terms: an object fluent, or a misspelt keyword."""
        word = keyword(head)
        near = nearest(word, CONNECTIVES)
        if near is not None:
            raise Misuse("BBT0101", f"`{word}` is no keyword", head.span, f"did you mean `{near}`?")
        return unsupported("object fluent", head, close)

    # --- formulas ----------------------------------------------------------------------------

    atom = staticmethod(leaves.atom)

    def empty(self, token: Token) -> ast.Empty:
        return ast.Empty(token.span)

    def negation(self, head: Token, part: ast.Formula, close: Token) -> ast.Not:
        """Its fast forms are :meth:`negated` and :meth:`unequal`."""
        return ast.Not(part, head.to(close))

    def negated(self, token: Token) -> ast.Not:
        """The fast form of :meth:`negation` for an atom."""
        return ast.Not(leaves.negated(token), token.span)

    def unequal(self, token: Token) -> ast.Not:
        """The fast form of :meth:`negation` for an equation."""
        start = token.text.index("(", 1)
        inner = token.text[start : token.text.index(")") + 1]
        return ast.Not(leaves.equation(inner, token.start + start, token.source), token.span)

    def conjunction(self, head: Token, parts: list[ast.Formula], close: Token) -> ast.And:
        """Its fast form is :meth:`literals`."""
        return ast.And(tuple(parts), head.to(close))

    def literals(self, token: Token) -> ast.And:
        """The fast form of :meth:`conjunction`."""
        return ast.And(tuple(leaves.literals(token)), token.span)

    def disjunction(self, head: Token, parts: list[ast.Formula], close: Token) -> ast.Or:
        return ast.Or(tuple(parts), head.to(close))

    def implication(self, head: Token, left: ast.Formula, right: ast.Formula, close: Token) -> ast.Imply:
        return ast.Imply(left, right, head.to(close))

    def quantified(
        self, head: Token, parameters: ast.TypedList, part: ast.Formula, close: Token
    ) -> ast.Quantified:
        kind: Literal["exists", "forall"] = "forall" if head.kind == "FORALL" else "exists"
        return ast.Quantified(kind, parameters_of(parameters, close), part, head.to(close))

    def test(self, head: Token, atom: ast.Atom, close: Token) -> ast.Test:
        return ast.Test("known" if head.kind == "KNOWN" else "unknown", atom, head.to(close))

    def believed(self, head: Token, part: ast.Formula, number: Token, close: Token) -> ast.Believed:
        return ast.Believed(part, self.number(number), head.to(close))

    def test_believed(self, head: Token, part: ast.Believed, close: Token) -> ast.Test:
        return ast.Test("known" if head.kind == "KNOWN" else "unknown", part, head.to(close))

    def comparison(
        self, head: Token, left: Operand, right: Operand, close: Token
    ) -> ast.Equality | ast.Comparison | ast.Unsupported:
        """The fast form of an equation is :meth:`equation`."""
        if head.kind == "EQUAL":
            first, second = _as_term(left), _as_term(right)
            numbers = isinstance(left, ast.Number) and isinstance(right, ast.Number)
            if first is not None and second is not None and not numbers:
                return ast.Equality(first, second, head.to(close))
            if any(isinstance(side, ast.Name | ast.Variable | ast.Unsupported) for side in (left, right)):
                return unsupported("object fluent", head, close)
        one, other = numeric(left), numeric(right)
        if one is None or other is None:
            return unsupported("comparison of objects", head, close)
        return ast.Comparison(head.text.lstrip("(").strip(), one, other, head.to(close))

    def equation(self, token: Token) -> ast.Equality:
        """The fast form of :meth:`comparison` for ``=`` between a name or variable and another."""
        return leaves.equation(token.text, token.start, token.source)

    def preference(self, head: Token, _forms: list[None], close: Token) -> ast.Unsupported:
        return unsupported("preference", head, close)

    def trajectory(self, head: Token, _forms: list[None], close: Token) -> ast.Unsupported:
        return unsupported("trajectory constraint", head, close)

    # --- effects -----------------------------------------------------------------------------

    def assign_true(self, token: Token) -> ast.Assign:
        return leaves.assign(leaves.atom(token), Truth.TRUE, token.span)

    def assign_negated(self, token: Token) -> ast.Assign:
        return leaves.assign(leaves.negated(token), Truth.FALSE, token.span)

    def assign_not(self, head: Token, atom: Token, close: Token) -> ast.Assign:
        return leaves.assign(leaves.atom(atom), Truth.FALSE, head.to(close))

    def assign_unknown(self, head: Token, atom: ast.Atom, close: Token) -> ast.Assign:
        return leaves.assign(atom, Truth.UNKNOWN, head.to(close))

    def effect_and(self, head: Token, parts: list[ast.Effect], close: Token) -> ast.EffectAnd:
        """Its fast form is :meth:`effect_literals`."""
        return ast.EffectAnd(tuple(parts), head.to(close))

    def effect_literals(self, token: Token) -> ast.EffectAnd:
        """The fast form of :meth:`effect_and`."""
        parts: list[ast.Effect] = []
        for literal in leaves.literals(token):
            match literal:
                case ast.Atom():
                    parts.append(leaves.assign(literal, Truth.TRUE, literal.span))
                case ast.Not(ast.Atom() as atom):
                    parts.append(leaves.assign(atom, Truth.FALSE, literal.span))
                case _:
                    raise Misuse("BBT0101", "an effect cannot say `=`", literal.span, NOT_IN_EFFECT["="])
        return ast.EffectAnd(tuple(parts), token.span)

    def when(self, head: Token, condition: ast.Formula, effect: ast.Effect, close: Token) -> ast.When:
        return ast.When(condition, effect, head.to(close))

    def effect_forall(
        self, head: Token, parameters: ast.TypedList, effect: ast.Effect, close: Token
    ) -> ast.EffectForall:
        return ast.EffectForall(parameters_of(parameters, close), effect, head.to(close))

    def probabilistic(self, head: Token, branches: list[ast.Branch], close: Token) -> ast.Probabilistic:
        return ast.Probabilistic(tuple(branches), head.to(close))

    def branch(self, number: Token, effect: ast.Effect) -> ast.Branch:
        span = Span(number.source, number.start, effect.span.end)
        return ast.Branch(self.number(number), effect, span)

    def one_of(self, head: Token, parts: list[ast.Effect], close: Token) -> ast.OneOf:
        return ast.OneOf(tuple(parts), head.to(close))

    def fluent_effect(
        self, head: Token, target: Operand, amount: Operand, close: Token
    ) -> ast.FluentEffect | ast.Unsupported:
        fluent, expression = numeric(target), numeric(amount)
        if isinstance(fluent, ast.FluentRef) and expression is not None:
            return ast.FluentEffect(keyword(head), fluent, expression, head.to(close))
        return unsupported("object fluent", head, close)

    # --- durative actions ----------------------------------------------------------------------

    def timed_formula(self, head: Token, formula: ast.Formula, close: Token) -> ast.TimedFormula:
        return ast.TimedFormula(_WHENS[head.kind], formula, head.to(close))

    def timed_change(self, head: Token, effect: ast.Effect, close: Token) -> ast.TimedChange:
        return ast.TimedChange(_WHENS[head.kind], effect, head.to(close))

    def timed_all(self, head: Token, parts: list[ast.Timed], close: Token) -> ast.TimedAll:
        return ast.TimedAll(tuple(parts), head.to(close))

    def timed_nothing(self, token: Token) -> ast.TimedAll:
        return ast.TimedAll((), token.span)

    def timed_forall(
        self, head: Token, parameters: ast.TypedList, part: ast.Timed, close: Token
    ) -> ast.TimedForall:
        return ast.TimedForall(parameters_of(parameters, close), part, head.to(close))

    def timed_when(self, head: Token, condition: ast.Timed, effect: ast.Timed, close: Token) -> ast.TimedWhen:
        return ast.TimedWhen(condition, effect, head.to(close))

    def timed_continuous(self, head: Token, _forms: list[None], close: Token) -> ast.TimedAll:
        message = "a number that changes while an action runs is not supported"
        raise Misuse("BBT0449", message, head.to(close), "effects stand in `(at start …)` or `(at end …)`")

    # --- what is refused by name -------------------------------------------------------------

    def sexpr(self, *_parts: Token | list[None]) -> None:
        """Nothing: what is refused keeps its text only."""
