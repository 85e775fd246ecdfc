"""The forms of K-replanner (Bonet and Geffner 2011, 2014), read as what they are short for: variables of
several values, of which one holds; what actions tell of them; what is always told; and what stays true."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

from typing_extensions import assert_never

from bbtc.analysis import formulas
from bbtc.analysis.declare import sections
from bbtc.analysis.names import Names, Scope
from bbtc.diagnostics import Related
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.formula import is_parameter
from bbtc.model.types import Parameter
from bbtc.source import Span
from bbtc.syntax import ast


@dataclass(frozen=True, slots=True)
class Value:
    """The atoms that are values of a variable, one for each binding of the parameters."""

    parameters: tuple[Parameter, ...]
    atom: mf.Atom


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable: one of its values holds, or, if it has one only, that does or does not."""

    name: str
    parameters: tuple[Parameter, ...]
    values: tuple[Value, ...]
    span: Span

    @property
    def predicates(self) -> frozenset[str]:
        """The predicates of its values."""
        return frozenset(value.atom.predicate for value in self.values)

    @property
    def is_fact(self) -> bool:
        """Has it a single value, which holds or does not?"""
        return len(self.values) == 1 and not self.values[0].parameters


def variables(names: Names, domain: ast.Definition) -> tuple[Variable, ...]:
    """Every ``:variable``. What an ``:obs-variable`` names is only checked: it is the sensing models that
    tell."""
    found = []
    for node in sections(domain, ast.StateVariable):
        names.section = f"variable {node.name.key}"
        parameters = names.parameters(node.parameters or ())
        scope: Scope = {parameter.name: parameter for parameter in parameters}
        values = [value for each in node.values for value in _values(names, each, scope, node.name.key)]
        if node.kind == "variable":
            found.append(Variable(node.name.key, parameters, tuple(values), node.span))
    return tuple(found)


def symbols(names: Names, domain: ast.Definition) -> frozenset[str]:
    """The predicates that an ``:obs-variable`` names."""
    nodes = (node for node in sections(domain, ast.StateVariable) if node.kind == "obs-variable")
    values = (value for node in nodes for value in node.values)
    return frozenset(_atom(value).predicate.key for value in values) & names.predicates.keys()


def _atom(node: ast.Formula) -> ast.Atom:
    while isinstance(node, ast.Quantified):
        node = node.part
    assert isinstance(node, ast.Atom)  # others are refused
    return node


def _values(names: Names, node: ast.Formula, scope: Scope, of: str) -> Iterator[Value]:
    parameters: list[Parameter] = []
    while isinstance(node, ast.Quantified):
        more, scope = formulas.inner_scope(names, node.parameters, scope)
        parameters += more
        node = node.part
    assert isinstance(node, ast.Atom)  # others are refused
    atom = formulas.atom(names, node, scope)
    if atom is not None:
        own = {each.name: f"{each.name} of {of}" for each in parameters}
        renamed = (Parameter(own[each.name], each.types, each.span) for each in parameters)
        args = tuple(own.get(arg, arg) for arg in atom.args)
        yield Value(tuple(renamed), replace(atom, args=args))


# --- the start -----------------------------------------------------------------------------------


def completed(names: Names, found: Iterable[Variable], init: md.Init) -> md.Init:
    """The start with what it leaves open of variables: one of the values, or whether the only one holds."""
    given = {(fact.predicate, fact.args): fact.value for fact in init.facts}
    mentioned = {leaf.predicate for choice in init.choices for leaf in me.settings(choice)}
    mentioned |= {atom.predicate for clause in init.clauses for atom in mf.atoms(clause.condition)}
    facts, choices = list(init.facts), list(init.choices)
    for variable in found:
        for binding in bindings(names, variable.parameters):
            atoms = [
                _ground(value.atom, {**binding, **inner})
                for value in variable.values
                for inner in bindings(names, value.parameters)
            ]
            if variable.is_fact:
                (atom,) = atoms
                if (atom.predicate, atom.args) not in given and atom.predicate not in mentioned:
                    facts.append(md.InitialFact(atom.predicate, atom.args, Truth.UNKNOWN, variable.span))
                continue
            values = [given.get((atom.predicate, atom.args)) for atom in atoms]
            if Truth.TRUE in values:
                continue
            left = [atom for atom, value in zip(atoms, values, strict=True) if value is not Truth.FALSE]
            if not left:
                message = f"`:init` denies every value of the variable `{variable.name}`"
                related = [Related("its values are given here", variable.span)]
                names.report.error("BBT0414", message, init.span or variable.span, related=related)
            elif len(left) == 1:
                facts.append(md.InitialFact(left[0].predicate, left[0].args, Truth.TRUE, variable.span))
            else:
                share = Fraction(1, len(left))
                sets = (me.Set(atom.predicate, atom.args, Truth.TRUE, variable.span) for atom in left)
                branches = tuple(me.Branch(share, each, variable.span) for each in sets)
                choices.append(me.Choice(branches, True, variable.span))
    return replace(init, facts=tuple(facts), choices=tuple(choices))


def _ground(atom: mf.Atom, binding: dict[str, str]) -> mf.Atom:
    return replace(atom, args=tuple(binding.get(arg, arg) for arg in atom.args))


def bindings(names: Names, parameters: Sequence[Parameter]) -> Iterator[dict[str, str]]:
    """The objects that some parameters may stand for, in every way."""
    members = [
        [name for name, thing in names.objects.items() if names.hierarchy.contains(each.types, thing)]
        for each in parameters
    ]
    keys = [each.name for each in parameters]
    return (dict(zip(keys, objects, strict=True)) for objects in product(*members))


# --- effects -------------------------------------------------------------------------------------


def one_value(
    found: Sequence[Variable], effect: me.Effect, denied: frozenset[str] = frozenset()
) -> me.Effect:
    """The effect in which a variable that gets a value loses its other ones, unless it says so itself: it
    denies some beside it."""
    match effect:
        case me.Set(predicate, _, Truth.TRUE):
            others = [
                lost
                for variable in found
                if not variable.is_fact and predicate in variable.predicates
                if denied.isdisjoint(variable.predicates)
                for lost in _others(variable, effect)
            ]
            return me.Together((effect, *others), effect.span) if others else effect
        case me.Together(parts, span):
            sets = [part for part in parts if isinstance(part, me.Set)]
            here = {each.predicate for each in sets if each.value is Truth.FALSE}
            return me.Together(tuple(one_value(found, part, denied | here) for part in parts), span)
        case me.When(condition, inner, span):
            return me.When(condition, one_value(found, inner, denied), span)
        case me.ForEach(parameters, inner, span):
            return me.ForEach(parameters, one_value(found, inner, denied), span)
        case me.Choice(branches):
            made = (replace(each, effect=one_value(found, each.effect, denied)) for each in branches)
            return replace(effect, branches=tuple(made))
        case me.Set() | me.Add() | me.Change():
            return effect
        case _:
            assert_never(effect)


def _others(variable: Variable, effect: me.Set) -> Iterator[me.Effect]:
    """What makes all values of a variable false, for each of them that an effect may set."""
    for value in variable.values:
        if value.atom.predicate != effect.predicate:
            continue
        binding: dict[str, str] = {}
        guards: list[mf.Formula] = []
        for pattern, arg in zip(value.atom.args, effect.args, strict=True):
            wanted = binding.setdefault(pattern, arg) if is_parameter(pattern) else pattern
            if wanted != arg:
                guards.append(mf.Equal(wanted, arg))
        if any(not is_parameter(each.left) and not is_parameter(each.right)
               for each in guards if isinstance(each, mf.Equal)):  # fmt: skip
            continue  # another object
        outer = {each.name: binding[each.name] for each in variable.parameters if each.name in binding}
        lost = tuple(
            me.ForEach(other.parameters, me.Set(atom.predicate, atom.args, Truth.FALSE, effect.span))
            for other in variable.values
            for atom in [_ground(other.atom, outer)]
        )
        together = me.Together(lost, effect.span)
        yield me.When(mf.And(tuple(guards)), together, effect.span) if guards else together


# --- what is told --------------------------------------------------------------------------------

_Rules = dict[tuple[str, tuple[str, ...]], tuple[list[mf.Formula], list[mf.Formula]]]
"""By atom: the conditions under which it is told to be true, and false."""


def sensing(names: Names, node: ast.Effect, scope: Scope) -> dict[tuple[str, tuple[str, ...]], mf.Formula]:
    """What a sensing model tells: by the atom that stands for it, the condition that is told. Where a model
    says when an atom is true, that is it; else, when it is not false."""
    rules: _Rules = {}
    _collect(names, formulas.effect(names, node, scope), (), (), rules)
    return {
        key: mf.Or(tuple(true)) if true else mf.Not(mf.Or(tuple(false)))
        for key, (true, false) in rules.items()
    }


def _collect(
    names: Names,
    effect: me.Effect,
    parameters: tuple[Parameter, ...],
    conditions: tuple[mf.Formula, ...],
    rules: _Rules,
) -> None:
    match effect:
        case me.Set(predicate, args, value):
            own = [each for each in parameters if each.name in args]
            others = tuple(each for each in parameters if each.name not in args)
            together: mf.Formula = mf.And(conditions)
            together = mf.Quantified("exists", others, together) if others else together
            for binding in bindings(names, own):
                key = predicate, tuple(binding.get(arg, arg) for arg in args)
                true, false = rules.setdefault(key, ([], []))
                (true if value is Truth.TRUE else false).append(mf.substitute(together, {**binding}))
        case me.Together(parts):
            for part in parts:
                _collect(names, part, parameters, conditions, rules)
        case me.When(condition, inner):
            _collect(names, inner, parameters, (*conditions, condition), rules)
        case me.ForEach(more, inner):
            _collect(names, inner, (*parameters, *more), conditions, rules)
        case me.Choice() | me.Add() | me.Change():
            message = "a sensing model with chance, or with costs, is not supported"
            hint = "a noisy reading is written `:observe (probabilistic q (p))`"
            names.report.error("BBT0212", message, effect.span, hint)
        case _:
            assert_never(effect)


def told(found: dict[tuple[str, tuple[str, ...]], mf.Formula], span: Span) -> mf.Formula:
    """What is told, as one observation of several parts; each is told as a whole."""
    return mf.And(tuple(mf.Or((each,)) for each in found.values()), span)


def derived(
    names: Names, found: dict[tuple[str, tuple[str, ...]], mf.Formula], span: Span
) -> Iterator[md.Rule]:
    """Rules for the atoms of the sensing model that all actions share: conditions may read them."""
    for (predicate, args), condition in found.items():
        declared = names.predicates.get(predicate)
        if declared is not None:
            names.predicates[predicate] = replace(declared, derived=True)
            yield md.Rule(predicate, args, (), condition, span)


def always_told(names: Names, domain: ast.Definition) -> Iterator[md.Sensor]:
    """What ``:observable`` lists, as sensors that always tell."""
    number = 0
    for node in sections(domain, ast.AtomList):
        if node.kind == "observable":
            names.section = "observable"
            for each in node.values:
                for value in _values(names, each, {}, "observable"):
                    number += 1
                    name = f"observable-{number}"
                    yield md.Sensor(name, value.parameters, mf.ALWAYS, value.atom, span=node.span)


# --- what stays true -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Sticky:
    """A derived atom that stays true once it is: another one tells that it was true before the action."""

    parameters: tuple[Parameter, ...]
    atom: mf.Atom
    before: mf.Atom

    @property
    def rule(self) -> md.Rule:
        """It is true where it was."""
        return md.Rule(self.atom.predicate, self.atom.args, self.parameters, self.before, self.atom.span)

    @property
    def effect(self) -> me.Effect:
        """What every action does."""
        sets = me.Set(self.before.predicate, self.before.args, Truth.TRUE)
        return me.ForEach(self.parameters, me.When(self.atom, sets))


def sticky(names: Names, domain: ast.Definition) -> Iterator[Sticky]:
    """What ``:sticky`` lists, as far as it is derived: other facts stay true anyway."""
    for node in sections(domain, ast.AtomList):
        if node.kind == "sticky":
            names.section = "sticky"
            for each in node.values:
                for value in _values(names, each, {}, "sticky"):
                    declared = names.predicates[value.atom.predicate]
                    if declared.derived:
                        name = f"{declared.name}-before"
                        while name in names.predicates:
                            name += "-"
                        names.predicates[name] = replace(declared, name=name, derived=False)
                        yield Sticky(value.parameters, value.atom, replace(value.atom, predicate=name))
