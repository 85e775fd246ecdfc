"""Conditions and effects of the syntax tree, resolved."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import lcm
from typing import TYPE_CHECKING, TypeAlias

from typing_extensions import assert_never

from bbtc.analysis import truth_words
from bbtc.analysis.names import Names, Scope, nearest
from bbtc.diagnostics import Related
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.amount import functions
from bbtc.model.types import Parameter
from bbtc.rounding import decimal, too_long
from bbtc.source import Span
from bbtc.syntax import ast
from bbtc.syntax.words import TEST_WORDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

HALF = Fraction(1, 2)
ROUNDING = Fraction(1, 10**9)
"""Probabilities whose sum differs from 1 by at most this are taken as rounded: each is divided
by the sum. A smaller sum gets a no-change branch, a larger one is an error."""


_COMPARATORS: Mapping[str, mf.Comparator] = {"<": "<", "<=": "<=", "=": "=", ">=": ">=", ">": ">"}
_OPERATORS: Mapping[str, me.Operator]
_OPERATORS = {
    "increase": "increase",
    "decrease": "decrease",
    "assign": "assign",
    "scale-up": "scale-up",
    "scale-down": "scale-down",
}


def inner_scope(names: Names, groups: ast.TypedList, scope: Scope) -> tuple[tuple[Parameter, ...], Scope]:
    """Parameters of a quantifier, renamed (``?x``, ``?x'``, …) where they would shadow another."""
    inside = dict(scope)
    taken = {parameter.name for parameter in scope.values()}
    result = []
    for parameter in names.parameters(groups):
        fresh = parameter.name
        while fresh in taken:
            fresh += "'"
        taken.add(fresh)
        renamed = Parameter(fresh, parameter.types, parameter.span)
        if parameter.name in inside:
            # Stays taken, under a key that no name in a file has: it may not be used further in.
            inside[f"{fresh} is taken"] = inside[parameter.name]
        inside[parameter.name] = renamed
        result.append(renamed)
    return tuple(result), inside


def unsupported(names: Names, node: ast.Unsupported) -> None:
    """Report a construct the language leaves out."""
    names.report.error(
        "BBT0212",
        f"{node.construct} is not supported",
        node.span,
        "bbtc reads conditions over true, false and unknown facts and over whole numbers",
    )


# --- conditions ------------------------------------------------------------------------------


def atom(names: Names, node: ast.Atom, scope: Scope) -> mf.Atom | None:
    """An atom, or None after an error."""
    found = _predicate_args(names, node.predicate, node.args, node.span, scope)
    return None if found is None else mf.Atom(node.predicate.key, found, node.span)


def _predicate_args(
    names: Names, name: ast.Name, args: Sequence[ast.Term], span: Span, scope: Scope
) -> tuple[mf.Term, ...] | None:
    predicate = names.predicate(name, args)
    if predicate is None:
        for arg in args if name.key not in TEST_WORDS else ():
            names.term(arg, scope)
        return None
    return names.arguments("predicate", name, predicate, args, scope, span=span)


def formula(names: Names, node: ast.Formula, scope: Scope) -> mf.Formula:
    """A condition; parts with errors, which are reported, count as true."""
    match node:
        case ast.Atom():
            test = truth_words.tested(names, node)
            if test is not None:
                return formula(names, test, scope)
            return names.type_test(node, scope) or atom(names, node, scope) or mf.ALWAYS
        case ast.Empty():
            return mf.ALWAYS
        case ast.Equality(left, right, span):
            first, second = names.term(left, scope), names.term(right, scope)
            return mf.Equal(first[0], second[0], span) if first and second else mf.ALWAYS
        case ast.Comparison(operator, left, right, span):
            one, other = amount(names, left, scope), amount(names, right, scope)
            if one is None or other is None:
                return mf.ALWAYS
            return mf.Compare(_COMPARATORS[operator], one, other, _numbers(names, one, other), span)
        case ast.Not(part, span):
            return mf.Not(formula(names, part, scope), span)
        case ast.And(parts, span):
            return mf.And(tuple(formula(names, p, scope) for p in parts), span)
        case ast.Or(parts, span):
            return mf.Or(tuple(formula(names, p, scope) for p in parts), span)
        case ast.Imply(premise, conclusion, span):
            # In strong Kleene logic a implies b is (or (not a) b).
            negated = mf.Not(formula(names, premise, scope), premise.span)
            return mf.Or((negated, formula(names, conclusion, scope)), span)
        case ast.Quantified(kind, groups, part, span):
            parameters, inside = inner_scope(names, groups, scope)
            return mf.Quantified(kind, parameters, formula(names, part, inside), span)
        case ast.Believed():
            return believed(names, node, scope) or mf.ALWAYS
        case ast.Test(kind, tested, span):
            found = (
                atom(names, tested, scope) if isinstance(tested, ast.Atom) else believed(names, tested, scope)
            )
            return mf.ALWAYS if found is None else mf.Test(kind, found, span)
        case ast.Unsupported():
            unsupported(names, node)
            return mf.ALWAYS
        case _:
            assert_never(node)


def believed(names: Names, node: ast.Believed, scope: Scope) -> mf.Atom | None:
    """A threshold on what is believed, as a fact that stands for it; None after an error."""
    part = formula(names, node.part, scope)
    value = node.at_least.value
    if not HALF < value <= 1:
        message = f"`believed` asks for a probability above 1/2, up to 1, not {node.at_least.text}"
        hint = "that the contrary is as probable is asked as `(believed (not …) …)`"
        names.report.error("BBT0420", message, node.at_least.span, percentage(value) or hint)
        return None
    if any(reading.value in (None, Truth.UNKNOWN) for reading in mf.readings(part)) or any(
        read.predicate in names.thresholds for read in mf.atoms(part)
    ):
        message = "`believed` is about facts, not about what is known or believed"
        names.report.error("BBT0420", message, node.part.span)
        return None
    free = [parameter for parameter in scope.values() if parameter.name in mf.free(part)]
    args = tuple(parameter.name for parameter in free)
    name = f"believed {_shape(part, args)} {value}"
    threshold = md.Threshold(tuple(free), part, value, _called(part), node.span)
    if names.thresholds.setdefault(name, threshold) is threshold:
        parameters = tuple(replace(each, types=each.types) for each in free)
        names.predicates[name] = md.Predicate(
            name, parameters, declared_three_valued=True, span=node.span, inferred=True
        )
    return mf.Atom(name, args, node.span)


def _shape(part: mf.Formula, args: Sequence[str]) -> str:
    """The same for formulas that differ only in the names of their parameters."""
    places = {arg: f"?{number}" for number, arg in enumerate(args, 1)}
    return repr(mf.substitute(part, {**places}))


def _called(part: mf.Formula) -> str:
    """What a threshold on a formula is called."""
    match part:
        case mf.Atom(predicate):
            return predicate
        case mf.Not(mf.Atom(predicate)):
            return f"not-{predicate}"
        case _:
            return "formula"


# --- effects ---------------------------------------------------------------------------------


def effect(names: Names, node: ast.Effect, scope: Scope) -> me.Effect:
    """An effect; parts with errors, which are reported, count as no change."""
    match node:
        case ast.Empty():
            return me.NOTHING
        case ast.Assign():
            return _setting(names, node, scope)
        case ast.EffectAnd(parts, span):
            return me.Together(tuple(effect(names, p, scope) for p in parts), span)
        case ast.When(condition, inner, span):
            return me.When(formula(names, condition, scope), effect(names, inner, scope), span)
        case ast.EffectForall(groups, inner, span):
            parameters, inside = inner_scope(names, groups, scope)
            return me.ForEach(parameters, effect(names, inner, inside), span)
        case ast.Probabilistic():
            return probabilistic(names, node, scope)
        case ast.OneOf(parts, span):
            if not parts:
                nothing_to_choose(names, "oneof", span)
                return me.NOTHING
            share = Fraction(1, len(parts))
            branches = tuple(me.Branch(share, effect(names, p, scope), p.span) for p in parts)
            return me.Choice(branches, True, span)
        case ast.FluentEffect():
            return _fluent_effect(names, node, scope)
        case ast.Unsupported():
            unsupported(names, node)
            return me.NOTHING
        case _:
            assert_never(node)


def nothing_to_choose(names: Names, word: str, span: Span) -> None:
    """Report a form of which one part holds, and that has none."""
    hint = "leave it out; `(and)` says nothing, and changes nothing"
    names.report.error("BBT0418", f"one part of `({word})` should hold, but there is none", span, hint)


def _setting(names: Names, node: ast.Assign, scope: Scope) -> me.Effect:
    assigned = truth_words.assigned(names, node)
    if assigned is None:
        return me.NOTHING
    target = assigned.atom
    args = _predicate_args(names, target.predicate, target.args, target.span, scope)
    if args is None or _is_derived(names, target):
        return me.NOTHING
    return me.Set(target.predicate.key, args, assigned.value, assigned.span)


def _is_derived(names: Names, target: ast.Atom) -> bool:
    predicate = names.predicates[target.predicate.key]
    if predicate.derived:
        names.report.error(
            "BBT0219",
            f"the derived predicate `{target.predicate.text}` cannot be set",
            target.span,
            "its rules alone say when it holds",
            [Related("declared here", predicate.span)],
        )
    return predicate.derived


def noisy_reading(names: Names, node: ast.Probabilistic, scope: Scope) -> me.Choice:
    """What a noisy reading tells: of a fact, and, if it errs otherwise there, of its contrary, how probably
    it is right where that is true."""
    drawn, faulty = _drawn(names, node, scope)
    if faulty or not me.both_ways([each for _, each, _ in drawn]):
        return _summed(names, node, drawn, faulty)
    total = sum((value for value, _, _ in drawn), Fraction(0))
    if total <= 1:
        told = "nothing" if total == 1 else "the contrary"
        message = f"this reading tells {told}: it has to be right with probabilities that sum to more than 1"
        hint = "`(probabilistic q (p) r (not (p)))` is right with q where `(p)` is true, with r where not"
        names.report.error("BBT0432", message, node.span, hint)
    return me.Choice(
        tuple(me.Branch(value, part, branch.span) for value, part, branch in drawn), False, node.span
    )


def probabilistic(names: Names, node: ast.Probabilistic, scope: Scope) -> me.Choice:
    """A draw with probabilities that sum to 1 (see :data:`ROUNDING`)."""
    return _summed(names, node, *_drawn(names, node, scope))


_Drawn: TypeAlias = list[tuple[Fraction, me.Effect, ast.Branch]]


def _drawn(names: Names, node: ast.Probabilistic, scope: Scope) -> tuple[_Drawn, bool]:
    """The branches of a draw, and whether something is wrong with their numbers."""
    drawn: _Drawn = []
    faulty = False
    for branch in node.branches:
        value = branch.probability.value
        if not 0 <= value <= 1:
            names.report.error(
                "BBT0210",
                f"probability {branch.probability.text} is outside [0, 1]",
                branch.probability.span,
                percentage(value),
            )
            faulty = True
        drawn.append((value, effect(names, branch.effect, scope), branch))
    if _too_long_together(branch.probability.value for branch in node.branches):
        message = "the sum of the probabilities has too many digits"
        names.report.error("BBT0113", message, node.span, "give them a common denominator")
        faulty = True
    return drawn, faulty


def _summed(names: Names, node: ast.Probabilistic, drawn: _Drawn, faulty: bool) -> me.Choice:
    total = Fraction(1) if faulty else sum((value for value, _, _ in drawn), Fraction(0))
    if faulty:
        total = Fraction(1)
    elif total > 1 + ROUNDING:
        names.report.error(
            "BBT0211",
            f"the probabilities sum to {_decimal(total)}, above 1",
            node.span,
            "what is missing to 1 means no change; it cannot be more than 1",
        )
        total = Fraction(1)
    scale = total if abs(total - 1) <= ROUNDING else Fraction(1)
    branches = [me.Branch(value / scale, part, branch.span) for value, part, branch in drawn]
    if total / scale < 1:
        branches.append(me.Branch(1 - total, me.NOTHING, node.span))
    return me.Choice(tuple(branches), False, node.span)


def _too_long_together(values: Iterable[Fraction]) -> bool:
    """May some of the numbers have a sum with too many digits?"""
    common = 1
    for value in values:
        common = lcm(common, value.denominator)
        if too_long(Fraction(1, common)):
            return True
    return False


def percentage(value: Fraction) -> str | None:
    """The hint about a probability that is too large, if it seems to be a percentage."""
    return f"if this is a percentage, write {_decimal(value / 100)}" if 2 <= value <= 100 else None


def _decimal(value: Fraction) -> str:
    return decimal(value, 12)


def _fluent_effect(names: Names, node: ast.FluentEffect, scope: Scope) -> me.Effect:
    key = node.fluent.name.key
    to = "cost" if key in names.costs else "reward" if key in names.rewards else None
    if to is None:
        return _change(names, node, scope)
    if node.fluent.args or node.operator not in ("increase", "decrease"):
        names.report.error(
            "BBT0212",
            f"the numeric effect `{node.operator} {node.fluent.name.text}` is not supported",
            node.span,
            "what counts costs or rewards is read by the metric alone: `increase` or `decrease` it",
        )
        return me.NOTHING
    found = amount(names, node.amount, scope)
    if found is None or key not in names.counted:
        return me.NOTHING
    sign = 1 if node.operator == "increase" else -1
    weight = names.weights.get(key, Fraction(1))
    if weight != 1:
        found = me.Arithmetic("*", (me.Constant(weight), found), node.span)
    return me.Add("cost" if to == "cost" else "reward", found, sign, node.span)


def _change(names: Names, node: ast.FluentEffect, scope: Scope) -> me.Effect:
    """A change of a number that is part of the state."""
    key = node.fluent.name.key
    near = None if key in names.functions else nearest(key, sorted(names.costs | names.rewards))
    if near is not None:
        message = f"the numeric effect `{node.operator} {node.fluent.name.text}` is not supported"
        names.report.error("BBT0212", message, node.span, f"did you mean `{near}`?")
        return me.NOTHING
    target, found = amount(names, node.fluent, scope), amount(names, node.amount, scope)
    if not isinstance(target, me.FunctionValue) or found is None:
        return me.NOTHING
    own, read = _numbers(names, target), _numbers(names, found)
    operator = _OPERATORS[node.operator.lower()]
    return me.Change(target.function, target.args, operator, found, own, read, node.span)


def _numbers(names: Names, *amounts: me.Amount) -> tuple[mf.Atom, ...]:
    """What stands for the values of functions until it is settled how they are written."""
    found: dict[mf.Atom, None] = {}
    for value in (value for each in amounts for value in functions(each)):
        function = names.functions[value.function]
        name = md.number_predicate(value.function)
        names.predicates.setdefault(
            name, md.Predicate(name, function.parameters, span=function.span, inferred=True)
        )
        found[mf.Atom(name, value.args, value.span)] = None
    return tuple(found)


def amount(names: Names, node: ast.NumericExpression, scope: Scope) -> me.Amount | None:
    """A numeric expression, or None after an error."""
    match node:
        case ast.Number():
            return me.Constant(node.value)
        case ast.FluentRef(name, args, span):
            function = names.functions.get(name.key)
            if function is None and not args and name.key in names.objects:
                unsupported(names, ast.Unsupported("object fluent", name.text, span))
                return None
            if function is None:
                names.unknown("BBT0220", "function", name, names.functions)
                return None
            if name.key in names.costs or name.key in names.rewards:
                names.report.error(
                    "BBT0212",
                    f"reading the numeric fluent `{name.text}` is not supported",
                    span,
                    "what counts costs or rewards is read by the metric alone",
                )
                return None
            found = names.arguments("function", name, function, args, scope, span=span)
            return None if found is None else me.FunctionValue(name.key, found, span)
        case ast.Arithmetic(operator, operands, span):
            parts = [amount(names, operand, scope) for operand in operands]
            known = tuple(part for part in parts if part is not None)
            return me.Arithmetic(operator, known, span) if len(known) == len(parts) else None
        case _:
            assert_never(node)
