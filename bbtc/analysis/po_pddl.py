"""The forms of PO-PDDL, and of the partially observable track of the planning competition of 2011: models of
what is observed, and of what is believed at the start."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.analysis import formulas
from bbtc.analysis.declare import sections
from bbtc.analysis.names import Names, Scope
from bbtc.analysis.replanner import bindings
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.types import Parameter
from bbtc.source import Span
from bbtc.syntax import ast

_HINT = "an observable is true with `q` where a condition is, and with `1 - q` where it is not"


def is_po_pddl(*definitions: ast.Definition) -> bool:
    """Do definitions use these forms? Then preconditions may be about what is hidden."""
    forms = (ast.Observables, ast.ObservationModel, ast.InitBelief)
    return any(isinstance(section, forms) for each in definitions for section in each.sections)


@dataclass(frozen=True, slots=True)
class _Rule:
    """Where the condition holds, an observable is true with the probability."""

    condition: mf.Formula
    probability: Fraction


_Rules = dict[tuple[str, tuple[str, ...]], list[_Rule]]


def of_domain(names: Names, domain: ast.Definition) -> tuple[md.Reading, ...]:
    """What every ``:observation`` of a domain tells after each action."""
    rules: _Rules = {}
    for node in sections(domain, ast.ObservationModel):
        names.section = f"observation {node.name.key}"
        parameters = names.parameters(node.parameters)
        scope: Scope = {parameter.name: parameter for parameter in parameters}
        condition = mf.ALWAYS if node.condition is None else formulas.formula(names, node.condition, scope)
        told = formulas.effect(names, node.distribution, scope)
        _collect(names, told, parameters, (condition,), rules)
    span = next((node.span for node in sections(domain, ast.ObservationModel)), domain.span)
    return tuple(_readings(names, rules, span))


def of_action(names: Names, node: ast.SensingModel, scope: Scope) -> tuple[md.Reading, ...]:
    """What the ``:observation`` of an action tells."""
    rules: _Rules = {}
    _collect(names, formulas.effect(names, node.effect, scope), (), (), rules)
    return tuple(_readings(names, rules, node.span))


def _collect(
    names: Names,
    effect: me.Effect,
    parameters: tuple[Parameter, ...],
    conditions: tuple[mf.Formula, ...],
    rules: _Rules,
) -> None:
    match effect:
        case me.Set() | me.Choice():
            found = _observable(names, effect)
            if found is None:
                return
            (predicate, args), probability = found
            own = [each for each in parameters if each.name in args]
            others = tuple(each for each in parameters if each.name not in args)
            together: mf.Formula = mf.And(conditions)
            together = mf.Quantified("exists", others, together) if others else together
            for binding in bindings(names, own):
                key = predicate, tuple(binding.get(arg, arg) for arg in args)
                condition = mf.substitute(together, {**binding})
                rules.setdefault(key, []).append(_Rule(condition, probability))
        case me.Together(parts):
            for part in parts:
                _collect(names, part, parameters, conditions, rules)
        case me.When(condition, inner):
            _collect(names, inner, parameters, (*conditions, condition), rules)
        case me.ForEach(more, inner):
            _collect(names, inner, (*parameters, *more), conditions, rules)
        case me.Add() | me.Change():
            names.report.error("BBT0421", "what is observed adds nothing to costs", effect.span)
        case _:
            assert_never(effect)


def _observable(
    names: Names, effect: me.Set | me.Choice
) -> tuple[tuple[str, tuple[str, ...]], Fraction] | None:
    """The one observable of a draw, and how probably it is true; None after an error."""
    branches = [me.Branch(Fraction(1), effect)] if isinstance(effect, me.Set) else effect.branches
    found: dict[tuple[str, tuple[str, ...]], Fraction] = {}
    for branch in branches:
        sets = branch.effect
        if isinstance(sets, me.Set) and sets.value is not Truth.UNKNOWN:
            key = sets.predicate, sets.args
            found[key] = found.get(key, Fraction(0)) + branch.probability * (sets.value is Truth.TRUE)
        elif sets != me.NOTHING:
            break
    else:
        if len(found) == 1:
            return next(iter(found.items()))
    message = "a draw of what is observed is about one observable: `(probabilistic q (o) 1-q (not (o)))`"
    names.report.error("BBT0421", message, effect.span, _HINT)
    return None


def _readings(names: Names, rules: _Rules, span: Span) -> Iterator[md.Reading]:
    """What is told of each observable: whether a condition is true, rightly with some probability."""
    for (predicate, args), found in rules.items():
        levels = sorted({rule.probability for rule in found}, reverse=True)
        accuracy, otherwise = levels[0], 1 - levels[-1]
        if len(levels) > 2:
            shown = " ".join((predicate, *args))
            message = f"`({shown})` is told with {len(levels)} probabilities, and two are read"
            names.report.error("BBT0421", message, span, _HINT)
        elif len(levels) == 2 or accuracy * 2 > 1:
            right = mf.Or(tuple(rule.condition for rule in found if rule.probability == accuracy))
            false = None if len(levels) == 1 or otherwise == accuracy else otherwise
            yield md.Reading(right, accuracy, mf.Or(tuple(rule.condition for rule in found)), false)


# --- the start -----------------------------------------------------------------------------------


def believed(names: Names, nodes: Iterable[ast.InitBelief], init: md.Init) -> md.Init:
    """The start as ``:init-belief`` has it; of ``:init``, which is what is true, the numbers are left."""
    facts: list[md.InitialFact] = []
    choices: list[me.Effect] = []
    joint: dict[frozenset[tuple[str, tuple[str, ...]]], list[tuple[Fraction, list[me.Set], Span]]] = {}
    spans = []
    for node in nodes:
        spans.append(node.span)
        for element in node.elements:
            value = element.probability.value
            if not 0 <= value <= 1:
                message = f"probability {element.probability.text} is outside [0, 1]"
                names.report.error("BBT0210", message, element.probability.span, formulas.percentage(value))
                continue
            if isinstance(element, ast.FactBelief):
                atom = formulas.atom(names, element.atom, {})
                if atom is not None:
                    _believe(atom, value, element.span, facts, choices)
                continue
            sets = _literals(names, element)
            key = frozenset((each.predicate, each.args) for each in sets)
            joint.setdefault(key, []).append((value, sets, element.span))
    for parts in joint.values():
        whole = sum((value for value, _, _ in parts), Fraction(0))
        if abs(whole - 1) > formulas.ROUNDING:
            message = "the probabilities of `joint` about the same facts do not sum to 1"
            names.report.error("BBT0211", message, parts[0][2], f"they sum to {float(whole):.6g}")
        branches = (
            me.Branch(value / whole if whole else value, me.Together(tuple(sets), span), span)
            for value, sets, span in parts
        )
        choices.append(me.Choice(tuple(branches), False, parts[0][2]))
    return md.Init(tuple(facts), init.numbers, tuple(choices), (), spans[0] if spans else init.span)


def _believe(
    atom: mf.Atom,
    value: Fraction,
    span: Span,
    facts: list[md.InitialFact],
    choices: list[me.Effect],
) -> None:
    if value in (0, 1):
        facts.append(md.InitialFact(atom.predicate, atom.args, Truth.of(value == 1), span))
        return
    true, false = (me.Set(atom.predicate, atom.args, Truth.of(each), span) for each in (True, False))
    branches = me.Branch(value, true, span), me.Branch(1 - value, false, span)
    choices.append(me.Choice(branches, False, span))


def _literals(names: Names, node: ast.JointBelief) -> list[me.Set]:
    found = []
    parts = node.condition.parts if isinstance(node.condition, ast.And) else (node.condition,)
    for part in parts:
        denied = isinstance(part, ast.Not)
        inner = part.part if isinstance(part, ast.Not) else part
        if not isinstance(inner, ast.Atom):
            message = "`joint` is about literals, `(and (p) (not (q)))`"
            names.report.error("BBT0101", message, part.span)
            continue
        atom = formulas.atom(names, inner, {})
        if atom is not None:
            found.append(me.Set(atom.predicate, atom.args, Truth.of(not denied), part.span))
    return found
