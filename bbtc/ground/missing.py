"""What is missing at the root of a goal that nothing can make true: down from the goal, through what could
set each fact and what that needs, to facts that nothing at all brings about (:mod:`bbtc.ground.repair`).

What the relaxed reachability of a model cannot reach, nothing can.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.ground.normal import conjuncts, normal_form
from bbtc.ground.reachability.program import all_groups
from bbtc.ground.reachability.reach import Reach
from bbtc.ground.repair import Need, Repairs, Root, Some, Way, every, some
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import formula as mf
from bbtc.model.types import Parameter
from bbtc.source import Span

_MOST_MEMBERS = 20
"""A quantifier over more objects is asked for any of them."""
_COSTS = {"unknown": 2.0, "fact": 3.0, "object": 3.0, "together": 4.0}
"""What it takes to put a root right: an action that nobody can take is explained last."""

_Env: TypeAlias = Mapping[str, int]
_Row: TypeAlias = tuple[int | None, ...]


@dataclass(frozen=True, slots=True)
class Fact:
    """An atom that would have to have the value; an argument None stands for any object."""

    predicate: str
    row: _Row
    value: Truth
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class NoObject:
    """An object of one of these types: there is none."""

    types: tuple[str, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class NoneTogether:
    """Objects that meet all that the action (or rule) asks at once: each part alone can be met."""

    name: str
    span: Span | None = field(default=None, compare=False, repr=False)


Lack: TypeAlias = Fact | NoObject | NoneTogether
Missing: TypeAlias = Root[Lack]
_Need: TypeAlias = Need[Lack]


class Search:
    """Looks for what is missing in one model."""

    def __init__(self, reach: Reach, limits: Limits) -> None:
        self.reach = reach
        self.universe = reach.universe
        self._limits = limits
        model = reach.usage.model
        self._setters: dict[tuple[str, Truth], list[_Setter]] = {}
        for schema in model.schemas.values():
            needs = tuple(conjuncts(normal_form(schema.precondition)))
            for group in all_groups(reach.usage.blocks[schema.name]):
                for leaf in group.sets:
                    setter = _Setter(
                        schema.name,
                        schema.span,
                        schema.parameters + group.parameters,
                        leaf.args,
                        needs + group.guard,
                    )
                    self._setters.setdefault((leaf.predicate, leaf.value), []).append(setter)
        for rule in model.rules:
            needs = tuple(conjuncts(normal_form(rule.condition)))
            setter = _Setter(rule.predicate, rule.span, rule.parameters, rule.args, needs)
            self._setters.setdefault((rule.predicate, Truth.TRUE), []).append(setter)
            unknown = mf.Or(tuple(mf.Test("unknown", atom) for atom in mf.atoms(rule.condition)))
            setter = _Setter(rule.predicate, rule.span, rule.parameters, rule.args, (unknown,))
            self._setters.setdefault((rule.predicate, Truth.UNKNOWN), []).append(setter)
        self._possible: dict[Fact, bool] = {}
        self._repairs: Repairs[Lack] = Repairs(self._ways_to, lambda lack: _COSTS[_kind(lack)], limits)

    def missing(self, part: mf.Formula) -> tuple[Missing, ...]:
        """What a part of the goal that nothing can make true lacks, nearest to the goal first; empty where
        that cannot be told."""
        return self._repairs.roots(self._need(normal_form(part), {}))

    # --- what a condition lacks ----------------------------------------------------------------

    def _need(self, formula: mf.Formula, env: _Env) -> _Need | None:
        """What a condition in normal form lacks; None if nothing. Parameters that ``env`` does not bind
        stand for any object."""
        match formula:
            case mf.Atom(predicate, args, span):
                return self._lacking(Fact(predicate, self._row(args, env), Truth.TRUE, span))
            case mf.Not(mf.Atom(predicate, args, span)):
                return self._lacking(Fact(predicate, self._row(args, env), Truth.FALSE, span))
            case mf.Test(kind, atom, span):
                values = (Truth.UNKNOWN,) if kind == "unknown" else (Truth.TRUE, Truth.FALSE)
                row = self._row(atom.args, env)
                return some(self._lacking(Fact(atom.predicate, row, value, span)) for value in values)
            case mf.Equal(left, right):
                return None if self._may_equal(left, right, env, same=True) else Some(())
            case mf.Not(mf.Equal(left, right)):
                return None if self._may_equal(left, right, env, same=False) else Some(())
            case mf.Compare():
                return None  # what numbers can be is not traced
            case mf.And(parts):
                return every(self._need(part, env) for part in parts)
            case mf.Or(parts):
                return some(self._need(part, env) for part in parts)
            case mf.Quantified(kind, (parameter,), inner):
                return self._quantified(kind, parameter, inner, env)
            case mf.Not() | mf.Quantified():
                raise AssertionError("not in normal form")
            case _:
                assert_never(formula)

    def _quantified(self, kind: str, parameter: Parameter, inner: mf.Formula, env: _Env) -> _Need | None:
        members = self.universe.members(parameter.types)
        if not members:
            return NoObject(parameter.types, parameter.span) if kind == "exists" else None
        self._limits.check_time("grounding")
        free = {name: number for name, number in env.items() if name != parameter.name}
        if len(members) > _MOST_MEMBERS:
            return self._need(inner, free)
        each = (self._need(inner, {**free, parameter.name: member}) for member in members)
        return some(each) if kind == "exists" else every(each)

    def _lacking(self, fact: Fact) -> Fact | None:
        if fact not in self._possible:
            self._possible[fact] = self._can_be(fact)
        return None if self._possible[fact] else fact

    def _can_be(self, fact: Fact) -> bool:
        if None not in fact.row:
            row = tuple(number for number in fact.row if number is not None)
            return self._true_or_other(fact, row)
        if fact.value is Truth.FALSE:
            return True  # of any object: few facts hold of all of them
        rows = self.reach.values[fact.value][fact.predicate]
        return any(
            all(wanted in (None, number) for wanted, number in zip(fact.row, row, strict=True))
            for row in rows
        )

    def _true_or_other(self, fact: Fact, row: tuple[int, ...]) -> bool:
        if fact.value is Truth.FALSE and fact.predicate in self.reach.usage.derived:
            return True  # whether a derived atom can be false is not traced
        return self.reach.can_be(fact.value, fact.predicate, row)

    def _row(self, args: Iterable[mf.Term], env: _Env) -> _Row:
        return tuple(env.get(arg) if mf.is_parameter(arg) else self.universe.index[arg] for arg in args)

    def _may_equal(self, left: mf.Term, right: mf.Term, env: _Env, *, same: bool) -> bool:
        one, other = self._row((left, right), env)
        if left == right:
            return same
        return one is None or other is None or (one == other) is same

    # --- who could bring it about --------------------------------------------------------------

    def _ways_to(self, fact: Lack) -> Iterator[Way[Lack]]:
        if not isinstance(fact, Fact):
            return
        derived = fact.predicate in self.reach.usage.derived
        if fact.value is Truth.UNKNOWN and not derived:
            return  # what is not known is, nearly always, for `:init` to say
        for setter in self._setters.get((fact.predicate, fact.value), ()):
            unified = self._unified(setter, fact.row)
            for env in [] if unified is None else self._narrowed(setter, unified):
                yield self._way(setter, env)

    def _way(self, setter: _Setter, env: _Env) -> Way[Lack]:
        needs: list[_Need | None] = [
            NoObject(parameter.types, parameter.span)
            for parameter in setter.parameters
            if parameter.name not in env and not self.universe.members(parameter.types)
        ]
        needs.extend(self._need(part, env) for part in setter.needs)
        return Way(setter.by, every(needs) or NoneTogether(setter.by, setter.span))

    def _narrowed(self, setter: _Setter, env: dict[str, int]) -> list[dict[str, int]]:
        """The ways to bind more parameters by what never changes, as long as they are few: a map tells where
        one may come from."""
        envs = [env]
        for part in setter.needs:
            if not isinstance(part, mf.Atom) or part.predicate in self.reach.usage.derived:
                continue
            if not self.reach.usage.is_static(part.predicate):
                continue
            rows = self.reach.values[Truth.TRUE][part.predicate]
            found = [more for each in envs for more in self._joined(setter, part.args, each, rows)]
            if 0 < len(found) <= _MOST_MEMBERS:
                envs = found
        return envs

    def _joined(
        self, setter: _Setter, args: tuple[mf.Term, ...], env: dict[str, int], rows: Iterable[tuple[int, ...]]
    ) -> list[dict[str, int]]:
        """The bindings that a relation adds, in order of its objects; only the first few if they are many."""
        wanted = self._row(args, env)
        fitting = [
            row for row in rows if all(w in (None, number) for w, number in zip(wanted, row, strict=True))
        ]
        if len(fitting) > _MOST_MEMBERS:
            return [env] * len(fitting)
        types = {parameter.name: parameter.types for parameter in setter.parameters}
        found = []
        for row in sorted(fitting):
            more = dict(env)
            if all(
                not mf.is_parameter(arg)
                or (more.setdefault(arg, number) == number and number in self.universe.members(types[arg]))
                for arg, number in zip(args, row, strict=True)
            ):
                found.append(more)
        return found

    def _unified(self, setter: _Setter, row: _Row) -> dict[str, int] | None:
        """The parameters of a setter that sets just this atom; None if it never does."""
        types = {parameter.name: parameter.types for parameter in setter.parameters}
        env: dict[str, int] = {}
        for arg, number in zip(setter.args, row, strict=True):
            if number is None:
                continue
            if not mf.is_parameter(arg):
                if self.universe.index[arg] != number:
                    return None
            elif env.setdefault(arg, number) != number or number not in self.universe.members(types[arg]):
                return None
        return env


@dataclass(frozen=True, slots=True)
class _Setter:
    """What gives an atom a value: an action's effect, or a rule."""

    by: str
    span: Span | None
    parameters: tuple[Parameter, ...]
    args: tuple[mf.Term, ...]
    needs: tuple[mf.Formula, ...]


def _kind(root: Lack) -> str:
    match root:
        case Fact():
            return "unknown" if root.value is Truth.UNKNOWN else "fact"
        case NoObject():
            return "object"
        case NoneTogether():
            return "together"
        case _:
            assert_never(root)
