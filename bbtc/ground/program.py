"""The relaxed reachability of a model as a Datalog program.

Every value of a ground atom is a fact of its own: ``t3(1,2)`` says that predicate 3 can be true of
objects 1 and 2, ``f3`` that it can be false, ``u3`` unknown; ``a5(1,2)`` that action 5 can apply.
Nothing is ever taken back (delete relaxation), and each branch of a chance can happen. Conditions
are brought to negation normal form; disjunctions and universal quantifiers become auxiliary
predicates, asked for only where the rest of their conjunction holds. "Can be false" starts from the
closed world in the same way: only for atoms that something asks about.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import prod
from typing import Literal

from typing_extensions import assert_never

from bbtc.ground.normal import Block, Item, normalise
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.types import Parameter

_LETTER = {Truth.TRUE: "t", Truth.FALSE: "f", Truth.UNKNOWN: "u"}
_FIRST_CHAIN = 9
"""A universal quantifier over fewer objects is written out; over more it becomes a chain."""


@dataclass(frozen=True, slots=True)
class Start:
    """What can hold at the start: atoms (as object indices) that can be true, that can be unknown,
    and that are false in no initial state."""

    true: dict[str, list[tuple[int, ...]]]
    unknown: dict[str, list[tuple[int, ...]]]
    never_false: dict[str, list[tuple[int, ...]]]


@dataclass(slots=True)
class Program:
    """The rules, and what to read from them."""

    lines: list[str] = field(default_factory=list)
    outputs: dict[str, int] = field(default_factory=dict)
    counted: list[str] = field(default_factory=list)
    bound: int = 0


@dataclass(frozen=True, slots=True)
class Lifted:
    """An action or template to be grounded: its predicate name in the program, and what it reads."""

    predicate: str
    parameters: tuple[Parameter, ...]
    precondition: mf.Formula
    block: Block | None


class Builder:
    """Writes the program of one model."""

    def __init__(self, model: md.Model, start: Start) -> None:
        self.model = model
        self.start = start
        self.program = Program()
        self.object_index = {name: index for index, name in enumerate(model.objects)}
        self.number = {name: index for index, name in enumerate(model.predicates)}
        self.actions = [
            Lifted(f"a{i}", schema.parameters, schema.precondition, normalise(schema.effect))
            for i, schema in enumerate(model.schemas.values())
        ]
        self.templates = [
            Lifted(f"m{i}", template.parameters, template.precondition, None)
            for i, template in enumerate(model.templates.values())
        ]
        self.set_values = self._set_values()
        self.derived = {rule.predicate for rule in model.rules}
        self._loose = self._loose_positions()
        self._types: dict[tuple[str, ...], str] = {}
        self._ordered: set[str] = set()
        self._asked: set[str] = set()
        self._auxiliary = 0
        self._rules: list[str] = []

    # --- what the model says ---------------------------------------------------------------

    def _set_values(self) -> dict[str, set[Truth]]:
        """The values that effects of actions give to each predicate."""
        values: dict[str, set[Truth]] = {}
        for action in self.actions:
            for item in _items(action.block):
                if isinstance(item.leaf, me.Set):
                    values.setdefault(item.leaf.predicate, set()).add(item.leaf.value)
        return values

    def is_static(self, predicate: str) -> bool:
        """Whether no action changes the predicate."""
        return predicate not in self.set_values and predicate not in self.derived

    def can_be_unknown(self, predicate: str) -> bool:
        """Whether some atom of the predicate may be unknown at some time."""
        return (
            Truth.UNKNOWN in self.set_values.get(predicate, ())
            or bool(self.start.unknown.get(predicate))
            or (predicate in self.derived and self.model.predicates[predicate].three_valued)
        )

    def _loose_positions(self) -> set[tuple[str, int]]:
        """Argument positions that may hold objects outside their declared type, because an effect
        or a rule sets them through a parameter of a more general type."""
        loose: set[tuple[str, int]] = set()

        def look(predicate: str, args: tuple[mf.Term, ...], scope: dict[str, Parameter]) -> None:
            declared = self.model.predicates[predicate].parameters
            for position, (arg, parameter) in enumerate(zip(args, declared, strict=True)):
                if arg in scope and not self.model.types.fits(scope[arg].types, parameter.types):
                    loose.add((predicate, position))

        for action in self.actions:
            for item, around in _items_with_scope(action.block, action.parameters):
                if isinstance(item.leaf, me.Set):
                    look(item.leaf.predicate, item.leaf.args, {p.name: p for p in around})
        for rule in self.model.rules:
            look(rule.predicate, rule.args, {p.name: p for p in rule.parameters})
        return loose

    def members(self, types: tuple[str, ...]) -> list[int]:
        """Indices of the objects of one of the types, in order of declaration."""
        hierarchy = self.model.types
        return [
            index for index, each in enumerate(self.model.objects.values()) if hierarchy.contains(types, each)
        ]

    # --- the program -----------------------------------------------------------------------

    def build(self) -> Program:
        """All rules and facts."""
        for rule in self.model.rules:
            self._derive(rule)
        for lifted in self.actions:
            self._applicable(lifted)
            if lifted.block is not None:
                self._effects(lifted.block, _atom(lifted.predicate, lifted.parameters), ())
        for lifted in self.templates:
            self._applicable(lifted)
        self._facts()
        self.program.lines.extend(self._rules)
        self.program.counted = [lifted.predicate for lifted in (*self.actions, *self.templates)]
        return self.program

    def _facts(self) -> None:
        lines, outputs = self.program.lines, self.program.outputs
        for name, predicate in self.model.predicates.items():
            number, arity = self.number[name], len(predicate.parameters)
            lines.extend(_fact(f"t{number}", row) for row in self.start.true.get(name, ()))
            lines.extend(_fact(f"u{number}", row) for row in self.start.unknown.get(name, ()))
            if f"f{number}" in self._asked:
                lines.extend(_fact(f"n{number}", row) for row in self.start.never_false.get(name, ()))
            if not self.is_static(name):
                for value in (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN):
                    outputs[f"{_LETTER[value]}{number}"] = arity
        for lifted in (*self.actions, *self.templates):
            outputs[lifted.predicate] = len(lifted.parameters)

    def _derive(self, rule: md.Rule) -> None:
        number = self.number[rule.predicate]
        context = self._typed(rule.parameters, ())
        for value, letter in ((Truth.TRUE, "t"), (Truth.UNKNOWN, "u")):
            if value is Truth.UNKNOWN and not self.can_be_unknown(rule.predicate):
                continue
            # Where the rule reads something unknown is not traced further: any atom may be.
            body = context if value is Truth.UNKNOWN else self._conjunction(rule.condition, context)
            if body is not None:
                self._rule(self._call(f"{letter}{number}", rule.args), body)

    def _applicable(self, lifted: Lifted) -> None:
        """Rules for the bindings that satisfy the precondition."""
        simple: list[mf.Formula] = []
        rest: list[mf.Formula] = []
        for part in _parts(normal_form(lifted.precondition)):
            (simple if self._is_simple(part) else rest).append(part)
        literals = [literal for part in simple for literal in self._simple(part)]
        if None in literals:
            return
        known = [literal for literal in literals if literal is not None]
        body = self._typed(lifted.parameters, simple) + known
        self.program.bound += prod(max(1, len(self.members(p.types))) for p in lifted.parameters)
        head = _atom(lifted.predicate, lifted.parameters)
        if not rest:
            self._rule(head, body)
            return
        candidate = _atom(f"c{lifted.predicate}", lifted.parameters)
        self._rule(candidate, body)
        found = self._conjunction(mf.And(tuple(rest)), [candidate])
        if found is not None:
            self._rule(head, found)

    def _effects(self, block: Block, action: str, around: tuple[Parameter, ...]) -> None:
        for item in block.items:
            if isinstance(item.leaf, me.Set):
                context = [action, *self._typed(around + item.parameters, ())]
                body = context if item.guard is None else self._conjunction(item.guard, context)
                if body is not None:
                    head = f"{_LETTER[item.leaf.value]}{self.number[item.leaf.predicate]}"
                    self._rule(self._call(head, item.leaf.args), body)
        for chance in block.chances:
            for _, branch in chance.branches:
                self._effects(branch, action, around + chance.parameters)

    # --- conditions --------------------------------------------------------------------------

    def _conjunction(self, formula: mf.Formula, context: list[str]) -> list[str] | None:
        """The context with the literals of a condition; None if it can never be true."""
        body = list(context)
        for part in _parts(normal_form(formula)):
            literals = self._simple(part) if self._is_simple(part) else self._complex(part, body)
            for literal in literals:
                if literal is None:
                    return None
                body.append(literal)
        return body

    def _is_simple(self, part: mf.Formula) -> bool:
        """Whether the part becomes plain literals, without auxiliary predicates."""
        match part:
            case mf.Atom() | mf.Equal() | mf.Not(mf.Equal()):
                return True
            case mf.Not(mf.Atom(predicate)):
                return self.is_static(predicate) or predicate in self.derived
            case mf.Test(kind, atom):
                return (
                    kind == "unknown"
                    or atom.predicate in self.derived
                    or not self.can_be_unknown(atom.predicate)
                )
            case mf.Quantified("exists", _, inner):
                return all(self._is_simple(each) for each in _parts(inner))
            case _:
                return False

    def _simple(self, part: mf.Formula) -> Iterator[str | None]:
        match part:
            case mf.Atom(predicate, args):
                yield self._call(f"t{self.number[predicate]}", args)
            case mf.Equal(left, right):
                yield f"{self._term(left)}={self._term(right)}"
            case mf.Not(mf.Equal(left, right)):
                yield f"{self._term(left)}!={self._term(right)}"
            case mf.Not(mf.Atom(predicate, args)):
                if self.is_static(predicate):
                    yield "not " + self._call(f"t{self.number[predicate]}", args)
                    if self.can_be_unknown(predicate):
                        yield "not " + self._call(f"u{self.number[predicate]}", args)
            case mf.Test("unknown", atom):
                if self.can_be_unknown(atom.predicate):
                    yield self._call(f"u{self.number[atom.predicate]}", atom.args)
                else:
                    yield None
            case mf.Quantified():
                parameters, inner = self._opened(part)
                parts = list(_parts(inner))
                yield from self._typed(parameters, parts)
                for each in parts:
                    yield from self._simple(each)
            case _:
                return

    def _complex(self, part: mf.Formula, context: list[str]) -> Iterator[str | None]:
        match part:
            case mf.Not(mf.Atom(predicate, args)):
                yield self._can_be_false(predicate, args, context)
            case mf.Test(_, atom):
                yield self._any([atom, mf.Not(atom)], _free(part), context)
            case mf.Or(parts):
                yield self._any(parts, _free(part), context)
            case mf.Quantified("exists"):
                parameters, inner = self._opened(part)
                found = self._conjunction(inner, [*context, *self._typed(parameters, ())])
                if found is None:
                    yield None
                else:
                    yield from found[len(context) :]
            case mf.Quantified("forall"):
                yield from self._all(*self._opened(part), context)
            case _:
                raise AssertionError(part)

    def _opened(self, part: mf.Quantified) -> tuple[tuple[Parameter, ...], mf.Formula]:
        """Parameters and body of a quantifier under fresh names: a rule may hold several copies."""
        self._auxiliary += 1
        fresh = {p.name: f"{p.name}~{self._auxiliary}" for p in part.parameters}
        parameters = tuple(Parameter(fresh[p.name], p.types, p.span) for p in part.parameters)
        return parameters, mf.substitute(part.part, dict(fresh))

    def _can_be_false(self, predicate: str, args: tuple[mf.Term, ...], context: list[str]) -> str:
        number = self.number[predicate]
        self._asked.add(f"f{number}")
        literal = self._call(f"f{number}", args)
        self._rule(literal, [*context, "not " + self._call(f"n{number}", args)])
        return literal

    def _any(self, parts: Iterable[mf.Formula], free: list[str], context: list[str]) -> str:
        head = self._fresh(free)
        for part in parts:
            body = self._conjunction(part, context)
            if body is not None:
                self._rule(head, body)
        return head

    def _all(
        self, parameters: tuple[Parameter, ...], inner: mf.Formula, context: list[str]
    ) -> Iterator[str | None]:
        first, rest = parameters[0], parameters[1:]
        part = mf.Quantified("forall", rest, inner) if rest else inner
        members = self.members(first.types)
        if len(members) < _FIRST_CHAIN:
            for member in members:
                name = list(self.model.objects)[member]
                body = self._conjunction(mf.substitute(part, {first.name: name}), context)
                if body is None:
                    yield None
                    return
                yield from body[len(context) :]
            return
        # A chain: step n holds if the condition can hold for the first n objects.
        order = self._order(first.types)
        free = [name for name in _free(part) if name != first.name]
        name = self._fresh_name()
        variables = [_variable(each) for each in free]
        self._rule(_written(name, ["0", *variables]), context)
        step = f"N{name}"
        inside = [*context, _written(name, [step, *variables]), f"{order}({step},{_variable(first.name)})"]
        body = self._conjunction(part, inside)
        if body is not None:
            self._rule(_written(name, [f"{step}+1", *variables]), body)
        yield _written(name, [str(len(members)), *variables])

    # --- writing -----------------------------------------------------------------------------

    def _typed(self, parameters: Iterable[Parameter], parts: Iterable[mf.Formula]) -> list[str]:
        """Type literals of the parameters, but for those that a positive literal already binds to
        objects of their type."""
        bound = set()
        types = {parameter.name: parameter.types for parameter in parameters}
        for part in parts:
            if isinstance(part, mf.Atom):
                declared = self.model.predicates[part.predicate].parameters
                for position, arg in enumerate(part.args):
                    if (
                        arg in types
                        and (part.predicate, position) not in self._loose
                        and self.model.types.fits(declared[position].types, types[arg])
                    ):
                        bound.add(arg)
        return [
            f"{self._type(wanted)}({_variable(name)})" for name, wanted in types.items() if name not in bound
        ]

    def _type(self, types: tuple[str, ...]) -> str:
        key = tuple(sorted(types))
        if key not in self._types:
            name = self._types[key] = f"y{len(self._types)}"
            self.program.lines.extend(f"{name}({index})." for index in self.members(key))
            # A type without objects still needs a declaration, or clingo would warn.
            self.program.lines.append(f"#defined {name}/1.")
        return self._types[key]

    def _order(self, types: tuple[str, ...]) -> str:
        name = "o" + self._type(types)
        if name not in self._ordered:
            self._ordered.add(name)
            self.program.lines.extend(
                f"{name}({position},{index})." for position, index in enumerate(self.members(types))
            )
        return name

    def _fresh_name(self) -> str:
        self._auxiliary += 1
        return f"x{self._auxiliary}"

    def _fresh(self, free: list[str]) -> str:
        return _written(self._fresh_name(), [_variable(name) for name in free])

    def _call(self, name: str, args: Iterable[mf.Term]) -> str:
        return _written(name, [self._term(arg) for arg in args])

    def _term(self, term: mf.Term) -> str:
        return _variable(term) if mf.is_parameter(term) else str(self.object_index[term])

    def _rule(self, head: str, body: list[str]) -> None:
        self._rules.append(f"{head} :- {', '.join(body)}." if body else f"{head}.")


# --- helpers -----------------------------------------------------------------------------------


def normal_form(formula: mf.Formula, negative: bool = False) -> mf.Formula:
    """Negation normal form: negations stand at atoms and equalities only."""
    match formula:
        case mf.Atom() | mf.Equal():
            return mf.Not(formula) if negative else formula
        case mf.Test(kind, atom, span):
            other: Literal["unknown", "known"] = "known" if kind == "unknown" else "unknown"
            return mf.Test(other, atom, span) if negative else formula
        case mf.Not(part):
            return normal_form(part, not negative)
        case mf.And(parts, span):
            each = tuple(normal_form(part, negative) for part in parts)
            return mf.Or(each, span) if negative else mf.And(each, span)
        case mf.Or(parts, span):
            each = tuple(normal_form(part, negative) for part in parts)
            return mf.And(each, span) if negative else mf.Or(each, span)
        case mf.Quantified(kind, parameters, part, span):
            swapped: Literal["exists", "forall"] = "forall" if kind == "exists" else "exists"
            return mf.Quantified(swapped if negative else kind, parameters, normal_form(part, negative), span)
        case _:
            assert_never(formula)


def _parts(formula: mf.Formula) -> Iterator[mf.Formula]:
    if isinstance(formula, mf.And):
        for part in formula.parts:
            yield from _parts(part)
    else:
        yield formula


def _free(formula: mf.Formula) -> list[str]:
    """Free parameters, in order of appearance."""
    found: dict[str, None] = {}

    def walk(part: mf.Formula, bound: frozenset[str]) -> None:
        match part:
            case mf.Atom(_, args) | mf.Test(_, mf.Atom(_, args)):
                terms = args
            case mf.Equal(left, right):
                terms = (left, right)
            case mf.Not(inner):
                walk(inner, bound)
                return
            case mf.And(parts) | mf.Or(parts):
                for each in parts:
                    walk(each, bound)
                return
            case mf.Quantified(_, parameters, inner):
                walk(inner, bound | {p.name for p in parameters})
                return
            case _:
                assert_never(part)
        found.update((term, None) for term in terms if mf.is_parameter(term) and term not in bound)

    walk(formula, frozenset())
    return list(found)


def _items(block: Block | None) -> Iterator[Item]:
    return (item for item, _ in _items_with_scope(block, ()))


def _items_with_scope(
    block: Block | None, around: tuple[Parameter, ...]
) -> Iterator[tuple[Item, tuple[Parameter, ...]]]:
    if block is None:
        return
    for item in block.items:
        yield item, around + item.parameters
    for chance in block.chances:
        for _, branch in chance.branches:
            yield from _items_with_scope(branch, around + chance.parameters)


def _variable(name: str) -> str:
    # Parameter names hold any character; as hexadecimal they are letters and digits only.
    return "V" + name.encode().hex()


def _written(name: str, args: list[str]) -> str:
    return f"{name}({','.join(args)})" if args else name


def _atom(name: str, parameters: Iterable[Parameter]) -> str:
    return _written(name, [_variable(parameter.name) for parameter in parameters])


def _fact(name: str, row: Iterable[int]) -> str:
    return _written(name, [str(index) for index in row]) + "."
