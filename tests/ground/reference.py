"""An independent meaning of the lifted model, by enumeration: what grounding is compared with.

It shares nothing with ``bbtc.ground``: bindings are enumerated, the fixpoint is a loop, conditions
and effects are interpreted as written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import product

from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.types import Parameter

Atom = tuple[str, tuple[str, ...]]
World = Mapping[Atom, Truth]
Binding = Mapping[str, str]
Change = frozenset[tuple[Atom, Truth]]
Reachable = set[tuple[Atom, Truth]]
T, F, U = Truth.TRUE, Truth.FALSE, Truth.UNKNOWN


def objects_of(model: md.Model, types: tuple[str, ...]) -> list[str]:
    def above(name: str) -> set[str]:
        found = {name, "object"}
        for parent in model.types.types[name].parents:
            found |= above(parent)
        return found

    return [name for name, each in model.objects.items() if any(above(t) & set(types) for t in each.types)]


def bindings(model: md.Model, parameters: tuple[Parameter, ...], around: Binding) -> Iterator[Binding]:
    for row in product(*(objects_of(model, parameter.types) for parameter in parameters)):
        yield {**around, **{p.name: name for p, name in zip(parameters, row, strict=True)}}


def ground_atom(predicate: str, args: tuple[str, ...], binding: Binding) -> Atom:
    return predicate, tuple(binding.get(arg, arg) for arg in args)


# --- exact meaning ---------------------------------------------------------------------------


def value(model: md.Model, formula: mf.Formula, binding: Binding, world: World) -> Truth:
    """The Kleene value of a condition in a world that gives every atom a value."""
    match formula:
        case mf.Atom(predicate, args):
            return world[ground_atom(predicate, args, binding)]
        case mf.Test(kind, atom):
            unknown = world[ground_atom(atom.predicate, atom.args, binding)] is U
            return T if unknown == (kind == "unknown") else F
        case mf.Compare(operator, me.Constant(one), me.Constant(other)):
            found = {"<": one < other, "<=": one <= other, "=": one == other, ">=": one >= other}
            return T if found.get(operator, one > other if operator == ">" else one != other) else F
        case mf.Compare():
            raise AssertionError("numbers that change have a reference of their own")
        case mf.Equal(left, right):
            return T if binding.get(left, left) == binding.get(right, right) else F
        case mf.Not(part):
            return {T: F, F: T, U: U}[value(model, part, binding, world)]
        case mf.And(parts):
            values = [value(model, part, binding, world) for part in parts]
            return F if F in values else U if U in values else T
        case mf.Or(parts):
            values = [value(model, part, binding, world) for part in parts]
            return T if T in values else U if U in values else F
        case mf.Quantified(kind, parameters, part):
            values = [value(model, part, each, world) for each in bindings(model, parameters, binding)]
            if kind == "forall":
                return F if F in values else U if U in values else T
            return T if T in values else U if U in values else F


def outcomes(model: md.Model, effect: me.Effect, binding: Binding, world: World) -> dict[Change, Fraction]:
    """The distribution over sets of settings; the greatest value wins where several meet."""
    match effect:
        case me.Set(predicate, args, truth):
            return {frozenset({(ground_atom(predicate, args, binding), truth)}): Fraction(1)}
        case me.Add() | me.Change():
            return {frozenset(): Fraction(1)}
        case me.Together(parts):
            return _together([outcomes(model, part, binding, world) for part in parts])
        case me.When(condition, inner):
            if value(model, condition, binding, world) is T:
                return outcomes(model, inner, binding, world)
            return {frozenset(): Fraction(1)}
        case me.ForEach(parameters, inner):
            every = bindings(model, parameters, binding)
            return _together([outcomes(model, inner, each, world) for each in every])
        case me.Choice(branches):
            result: dict[Change, Fraction] = {}
            for branch in branches:
                for change, p in outcomes(model, branch.effect, binding, world).items():
                    result[change] = result.get(change, Fraction(0)) + p * branch.probability
            return {change: p for change, p in result.items() if p}


def _together(parts: list[dict[Change, Fraction]]) -> dict[Change, Fraction]:
    result: dict[Change, Fraction] = {frozenset(): Fraction(1)}
    for part in parts:
        longer: dict[Change, Fraction] = {}
        for (one, p), (other, q) in product(result.items(), part.items()):
            settings: dict[Atom, Truth] = {}
            for atom, truth in (*one, *other):
                settings[atom] = max(truth, settings.get(atom, truth))
            key = frozenset(settings.items())
            longer[key] = longer.get(key, Fraction(0)) + p * q
        result = longer
    return result


# --- what others may change ------------------------------------------------------------------


def open_predicates(model: md.Model) -> set[str]:
    """Predicates that an effect mentions, and those that are declared as external."""
    mentioned = {
        leaf.predicate
        for schema in model.schemas.values()
        for leaf in me.leaves(schema.effect)
        if isinstance(leaf, me.Set)
    }
    return mentioned | {name for name, predicate in model.predicates.items() if predicate.external}


def well_typed(model: md.Model, atom: Atom) -> bool:
    """Whether the arguments are of the types that the predicate is declared with."""
    parameters = model.predicates[atom[0]].parameters
    return all(arg in objects_of(model, p.types) for arg, p in zip(atom[1], parameters, strict=True))


def world_values(model: md.Model, reachable: Reachable) -> dict[Atom, set[Truth]]:
    """The values of every atom where others change what they may: unknown for those predicates only that
    something makes unknown."""
    found: dict[Atom, set[Truth]] = {}
    for atom, truth in reachable:
        found.setdefault(atom, set()).add(truth)
    opened = open_predicates(model)
    for atom, values in found.items():
        if atom[0] in opened and (well_typed(model, atom) or values != {F}):
            values |= {T, F, U} if model.predicates[atom[0]].three_valued else {T, F}
    return found


# --- relaxed reachability --------------------------------------------------------------------


def all_atoms(model: md.Model) -> list[Atom]:
    """Of any objects: through a parameter of a more general type, an effect may set such an atom."""
    return [
        (name, args)
        for name, predicate in model.predicates.items()
        for args in product(model.objects, repeat=len(predicate.parameters))
    ]


def start(model: md.Model) -> dict[Atom, Truth]:
    world = dict.fromkeys(all_atoms(model), F)
    world.update({(fact.predicate, fact.args): fact.value for fact in model.init.facts})
    return world


def may_be(
    model: md.Model, formula: mf.Formula, binding: Binding, reachable: Reachable, wanted: bool
) -> bool:
    """Whether the condition may be true (or, if not ``wanted``, false) in the relaxation."""
    match formula:
        case mf.Atom(predicate, args):
            return (ground_atom(predicate, args, binding), T if wanted else F) in reachable
        case mf.Test(kind, atom):
            ground = ground_atom(atom.predicate, atom.args, binding)
            if (kind == "unknown") == wanted:
                return (ground, U) in reachable
            return (ground, T) in reachable or (ground, F) in reachable
        case mf.Compare():
            return True
        case mf.Equal(left, right):
            return (binding.get(left, left) == binding.get(right, right)) == wanted
        case mf.Not(part):
            return may_be(model, part, binding, reachable, not wanted)
        case mf.And(parts) | mf.Or(parts):
            found = [may_be(model, part, binding, reachable, wanted) for part in parts]
            return all(found) if isinstance(formula, mf.And) == wanted else any(found)
        case mf.Quantified(kind, parameters, part):
            every = bindings(model, parameters, binding)
            found = [may_be(model, part, each, reachable, wanted) for each in every]
            return all(found) if (kind == "forall") == wanted else any(found)


def _may_set(model: md.Model, effect: me.Effect, binding: Binding, reachable: Reachable) -> Reachable:
    match effect:
        case me.Set(predicate, args, truth):
            return {(ground_atom(predicate, args, binding), truth)}
        case me.Add() | me.Change():
            return set()
        case me.Together(parts):
            return {each for part in parts for each in _may_set(model, part, binding, reachable)}
        case me.When(condition, inner):
            met = may_be(model, condition, binding, reachable, True)
            return _may_set(model, inner, binding, reachable) if met else set()
        case me.ForEach(parameters, inner):
            every = bindings(model, parameters, binding)
            return {each for bound in every for each in _may_set(model, inner, bound, reachable)}
        case me.Choice(branches):
            possible = [branch.effect for branch in branches if branch.probability]
            return {each for part in possible for each in _may_set(model, part, binding, reachable)}


def _does_something(model: md.Model, schema: md.Schema, binding: Binding, reachable: Reachable) -> bool:
    """Whether some effect can happen; making false what can be nothing else is none."""
    return any(
        value is not F or (atom, T) in reachable or (atom, U) in reachable
        for atom, value in _may_set(model, schema.effect, binding, reachable)
    )


def relaxed(model: md.Model) -> tuple[Reachable, dict[str, tuple[md.Schema, Binding]]]:
    """Every value each atom can have, and every action that can apply and do something, by name."""
    reachable: Reachable = set(start(model).items())
    actions: dict[str, tuple[md.Schema, Binding]] = {}
    while True:
        before = len(reachable), len(actions)
        for schema in model.schemas.values():
            for binding in bindings(model, schema.parameters, {}):
                if may_be(model, schema.precondition, binding, reachable, True):
                    args = ",".join(binding[p.name] for p in schema.parameters)
                    actions[f"{schema.name}({args})"] = schema, binding
                    reachable |= _may_set(model, schema.effect, binding, reachable)
        if (len(reachable), len(actions)) == before:
            return reachable, {
                name: (schema, binding)
                for name, (schema, binding) in actions.items()
                if _does_something(model, schema, binding, reachable)
            }
