"""The relaxed reachability of a model as a Datalog program.

Every value of a ground atom is a fact of its own: ``t3(1,2)`` says that predicate 3 can be true of
objects 1 and 2, ``f3`` that it can be false, ``u3`` unknown; ``a5(1,2)`` that action 5 can apply.
Nothing is ever taken back (delete relaxation), and each branch of a chance can happen. ``e5(1,2)``
says that action 5 can apply and do something: where that is not plain to see, it is what is read.

Conditions are in negation normal form. Disjunctions and universal quantifiers become auxiliary
predicates, asked for only for the objects that a context allows: where these are few, what the rest
of the conjunction says of just these objects; else a disjunction of plain literals becomes a rule for
each alternative, and what remains is asked for where all else holds. "Can be false" starts from the
closed world in the same way: only for atoms that something asks about (``n3`` are those not false at
the start).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from typing_extensions import assert_never

from bbtc.ground.normal import Block, Group, conjuncts, disjuncts, groups, normal_form
from bbtc.ground.reachability.usage import Usage, called
from bbtc.ground.universe import Universe
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.types import Parameter

LETTER = {Truth.TRUE: "t", Truth.FALSE: "f", Truth.UNKNOWN: "u"}
FIRST_CHAIN = 9
"""A universal quantifier over fewer objects is written out; over more it becomes a chain."""
FEW_BINDINGS = 20_000
"""Up to so many bindings, a condition is asked for wherever its own objects allow it."""
MOST_ALTERNATIVES = 16
"""So many rules at most take the place of one with disjunctions."""
_LONGEST_BODY = 64
"""A rule with more literals becomes a chain of rules."""
_VARIABLES = re.compile(r"\b[VN]\w+")


@dataclass(slots=True)
class Program:
    """The rules; the predicates to read from what they derive, with their arity; those of actions
    and templates; a bound on the number of facts that the rules can derive."""

    lines: list[str] = field(default_factory=list)
    outputs: dict[str, int] = field(default_factory=dict)
    actions: list[str] = field(default_factory=list)
    templates: list[str] = field(default_factory=list)
    bound: int = 0


class ProgramBuilder:
    """Writes the program of one model."""

    def __init__(self, usage: Usage, universe: Universe) -> None:
        self.usage = usage
        self.model = usage.model
        self.universe = universe
        self.program = Program()
        self.number = {name: index for index, name in enumerate(self.model.predicates)}
        self._types: dict[tuple[str, ...], str] = {}
        self._ordered: set[str] = set()
        self._asked: set[str] = set()
        self._auxiliary = 0
        self._rules: list[str] = []
        self._called = called(self.model)
        self._waits = any(schema.exogenous is not None for schema in self.model.schemas.values())
        """May an action be there to wait for what happens by itself?"""

    def build(self) -> Program:
        """All rules and facts."""
        program = self.program
        for rule in self.model.rules:
            self._derive(rule)
        for name in sorted(self.usage.doubted):
            # What a hidden fact makes true may be unknown before it is told.
            parameters = self.model.predicates[name].parameters
            number = self.number[name]
            self._rule(_atom(f"u{number}", parameters), [_atom(f"t{number}", parameters)])
        for index, schema in enumerate(self.model.schemas.values()):
            self._action(index, schema)
        for index, template in enumerate(self.model.templates.values()):
            program.templates.append(f"m{index}")
            precondition = conjuncts(normal_form(template.precondition))
            self._applicable(f"m{index}", template.parameters, precondition)
        self._facts()
        program.lines.extend(self._rules)
        return program

    def _facts(self) -> None:
        lines, outputs, start = self.program.lines, self.program.outputs, self.usage.start
        for name, predicate in self.model.predicates.items():
            number, arity = self.number[name], len(predicate.parameters)
            lines.extend(_fact(f"t{number}", row) for row in start.true.get(name, ()))
            lines.extend(_fact(f"u{number}", row) for row in start.unknown.get(name, ()))
            if name in self._asked:
                lines.extend(_fact(f"n{number}", row) for row in start.never_false.get(name, ()))
            if not self.usage.is_static(name) or name in self.usage.derived:
                outputs.update({f"{letter}{number}": arity for letter in LETTER.values()})
        for name, schema in zip(self.program.actions, self.model.schemas.values(), strict=True):
            outputs[name] = len(schema.parameters)
        for index, template in enumerate(self.model.templates.values()):
            outputs[f"m{index}"] = len(template.parameters)

    def _count(self, parameters: Iterable[Parameter]) -> int:
        count = 1
        for parameter in parameters:
            count *= max(1, len(self.universe.members(parameter.types)))
        return count

    def _bound(self, block: Block, count: int) -> None:
        self.program.bound += count + sum(count * self._count(item.parameters) for item in block.items)
        for chance in block.chances:
            for _, branch in chance.branches:
                self._bound(branch, count * self._count(chance.parameters))

    # --- rules -------------------------------------------------------------------------------

    def _derive(self, rule: md.Rule) -> None:
        number = self.number[rule.predicate]
        parts = conjuncts(normal_form(rule.condition))
        for body in self._bodies(parts, rule.parameters, rule.parameters):
            self._rule(self._call(f"t{number}", rule.args), body)
        if self.usage.can_be_unknown(rule.predicate):
            # Where the rule reads something unknown is not traced further: any atom may be.
            self._rule(self._call(f"u{number}", rule.args), self._typed(rule.parameters, ()))

    def _applicable(self, name: str, parameters: tuple[Parameter, ...], parts: Iterable[mf.Formula]) -> None:
        """Rules for the bindings that satisfy all parts of a precondition."""
        self.program.bound += self._count(parameters)
        for body in self._bodies(parts, parameters, parameters):
            self._rule(_atom(name, parameters), body)

    def _action(self, index: int, schema: md.Schema) -> None:
        """Where an action can apply, what it may set, and where it may set anything. What a template
        calls is kept even where it does nothing, so that the call can succeed, and so is what observes."""
        parameters, block = schema.parameters, self.usage.blocks[schema.name]
        self._bound(block, self._count(parameters))
        precondition = list(conjuncts(normal_form(schema.precondition)))
        found = list(all_groups(block))
        kept = schema.name in self._called or schema.tells or schema.counts
        kept = kept or (self._waits and schema.exogenous is None)
        if not kept and len(found) == 1 and not found[0].parameters:
            # Nothing happens where the only guard is false: it may as well be a precondition.
            precondition += found[0].guard
            found = [Group((), (), found[0].leaves)]
        self._applicable(f"a{index}", parameters, precondition)
        action, shown = _atom(f"a{index}", parameters), _atom(f"e{index}", parameters)
        always = kept or any(
            not group.parameters and not group.guard and any(map(_shows, group.leaves)) for group in found
        )
        self.program.actions.append(f"{'a' if always else 'e'}{index}")
        for group in found:
            scope = parameters + group.parameters
            for body in self._bodies(group.guard, group.parameters, scope, (action,)):
                if not always:
                    self._shown(shown, group, body)
                self._settings(group, scope, body)

    def _shown(self, head: str, group: Group, body: list[str]) -> None:
        """Making false does something only where the atom may be something else."""
        if any(map(_shows, group.leaves)):
            self._rule(head, body)
            return
        for leaf in group.sets:
            letters = "tu" if self.usage.can_be_unknown(leaf.predicate) else "t"
            for letter in letters:
                self._rule(head, [*body, self._call(f"{letter}{self.number[leaf.predicate]}", leaf.args)])

    def _settings(self, group: Group, scope: tuple[Parameter, ...], body: list[str]) -> None:
        """What is set by leaves of one guard. Several start from what they mention."""
        if len(group.sets) > 1:
            terms = dict.fromkeys(term for leaf in group.sets for term in leaf.args if mf.is_parameter(term))
            if len(body) > 1 or len(terms) < len(scope):
                body = self._named(body, terms)
        for leaf in group.sets:
            letters = "utf" if self.usage.hides and leaf.value is Truth.UNKNOWN else LETTER[leaf.value]
            for letter in letters:
                self._rule(self._call(f"{letter}{self.number[leaf.predicate]}", leaf.args), body)

    # --- rule bodies -------------------------------------------------------------------------

    def _bodies(
        self,
        formulas: Iterable[mf.Formula],
        parameters: tuple[Parameter, ...],
        scope: tuple[Parameter, ...],
        base: tuple[str, ...] = (),
        most: int | None = None,
    ) -> Iterator[list[str]]:
        """Bodies of rules that together say where all the formulas, in normal form, can hold: ``base``
        binds what is in ``scope`` besides ``parameters``."""
        most = MOST_ALTERNATIVES if most is None else most
        parts = list(formulas)
        simple = [part for part in parts if self._is_simple(part)]
        complex_ = [part for part in parts if not self._is_simple(part)]
        near: list[mf.Formula] = []
        far: list[mf.Formula] = []
        for part in complex_:
            (near if self._count(_read(part, scope)) <= FEW_BINDINGS else far).append(part)
        for part in far:
            alternatives = list(disjuncts(part))
            if 1 < len(alternatives) <= most:
                others = [other for other in parts if other is not part]
                for each in alternatives:
                    chosen = [*others, *conjuncts(each)]
                    yield from self._bodies(chosen, parameters, scope, base, most // len(alternatives))
                return
        body = self._conjunction(simple, [*base, *self._typed(parameters, simple)])
        contexts: dict[tuple[Parameter, ...], list[str]] = {}
        for part in near:
            read = _read(part, scope)
            if read not in contexts:
                contexts[read] = self._near(read, simple)
            body = self._with(part, body, contexts[read])
        if far and body is not None:
            candidate = _atom(self._fresh(), scope)
            self._rule(candidate, body)
            body = [candidate]
            for part in far:
                body = self._with(part, body, self._named([candidate], mf.free(part)))
        if body is not None:
            yield body

    def _near(self, parameters: tuple[Parameter, ...], simple: list[mf.Formula]) -> list[str]:
        """A context for parts that read some parameters: these, and the atoms that hold of nothing else."""
        names = {parameter.name for parameter in parameters}
        atoms = [each for each in simple if isinstance(each, mf.Atom) and names.issuperset(mf.free(each))]
        context = self._conjunction(atoms, self._typed(parameters, atoms))
        assert context is not None
        return self._named(context, names) if len(context) > 1 else context

    def _named(self, body: list[str], terms: Iterable[mf.Term]) -> list[str]:
        """A predicate of its own for what a body says of some parameters."""
        head = _written(self._fresh(), map(_variable, sorted(terms)))
        self._rule(head, body)
        return [head]

    def _with(self, part: mf.Formula, body: list[str] | None, context: list[str]) -> list[str] | None:
        """The body, to which the literals of a complex part are added; None if they can never be true."""
        if body is None:
            return None
        literals = list(self._complex(part, context))
        body += [literal for literal in literals if literal is not None]
        return None if None in literals else body

    # --- conditions --------------------------------------------------------------------------

    def _conjunction(self, parts: Iterable[mf.Formula], context: list[str]) -> list[str] | None:
        """The context with the literals of some parts; None if they can never be true."""
        body: list[str] | None = list(context)
        # What is simple binds parameters that other parts are asked for.
        for part in sorted(parts, key=lambda part: not self._is_simple(part)):
            if body is None:
                return None
            if self._is_simple(part):
                for literal in self._simple(part):
                    if literal is None:
                        return None
                    body.append(literal)
            else:
                body = self._with(part, body, body)
        return body

    def _is_simple(self, part: mf.Formula) -> bool:
        """Whether the part becomes plain literals, without auxiliary predicates."""
        match part:
            case mf.Atom() | mf.Equal() | mf.Not(mf.Equal()) | mf.Compare():
                return True  # what numbers can be is not traced: a comparison may hold
            case mf.Not(mf.Atom(predicate)):
                return self.usage.is_static(predicate) or predicate in self.usage.derived
            case mf.Test(kind, atom):
                derived = atom.predicate in self.usage.derived
                return kind == "unknown" or derived or not self.usage.can_be_unknown(atom.predicate)
            case mf.Quantified("exists", _, inner):
                return all(self._is_simple(each) for each in conjuncts(inner))
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
                # Whether a changing derived atom can be false is not traced: it may be.
                if not self.usage.is_static(predicate):
                    return
                if predicate in self.usage.uncertain:
                    yield self._false_at_first(predicate, args)
                else:
                    yield "not " + self._call(f"t{self.number[predicate]}", args)
            case mf.Test("unknown", atom):
                if self.usage.can_be_unknown(atom.predicate):
                    yield self._call(f"u{self.number[atom.predicate]}", atom.args)
                else:
                    yield None
            case mf.Quantified():
                parameter, inner = self._opened(part)
                parts = list(conjuncts(inner))
                yield from self._typed((parameter,), parts)
                for each in parts:
                    yield from self._simple(each)
            case _:
                return

    def _complex(self, part: mf.Formula, context: list[str]) -> Iterator[str | None]:
        match part:
            case mf.Not(mf.Atom(predicate, args)):
                yield self._can_be_false(predicate, args, context)
            case mf.Test(_, atom):
                yield self._any([atom, mf.Not(atom)], part, context)
            case mf.Or():
                yield self._any(disjuncts(part), part, context)
            case mf.Quantified("exists"):
                parameter, inner = self._opened(part)
                parts = list(conjuncts(inner))
                found = self._conjunction(parts, [*context, *self._typed((parameter,), parts)])
                if found is None:
                    yield None
                else:
                    yield from found[len(context) :]
            case mf.Quantified():
                parameter, inner = self._opened(part)
                yield from self._all(parameter, inner, context)
            case _:
                raise AssertionError(part)

    def _opened(self, part: mf.Quantified) -> tuple[Parameter, mf.Formula]:
        """Parameter and body of a quantifier under a fresh name: a rule may hold several copies."""
        self._auxiliary += 1
        (parameter,) = part.parameters
        name = f"{parameter.name}~{self._auxiliary}"
        fresh = Parameter(name, parameter.types, parameter.span)
        return fresh, mf.substitute(part.part, {parameter.name: name})

    def _can_be_false(self, predicate: str, args: tuple[mf.Term, ...], context: list[str]) -> str:
        literal = self._call(f"f{self.number[predicate]}", args)
        self._rule(literal, [*context, self._false_at_first(predicate, args)])
        return literal

    def _false_at_first(self, predicate: str, args: tuple[mf.Term, ...]) -> str:
        """That the atom is false in some initial state."""
        self._asked.add(predicate)
        return "not " + self._call(f"n{self.number[predicate]}", args)

    def _any(self, parts: Iterable[mf.Formula], whole: mf.Formula, context: list[str]) -> str:
        head = _written(self._fresh(), map(_variable, mf.free(whole)))
        for part in parts:
            body = self._conjunction(conjuncts(part), context)
            if body is not None:
                self._rule(head, body)
        return head

    def _all(self, parameter: Parameter, part: mf.Formula, context: list[str]) -> Iterator[str | None]:
        members = self.universe.members(parameter.types)
        if len(members) < FIRST_CHAIN:
            body: list[str] | None = context
            for member in members:
                instance = mf.substitute(part, {parameter.name: self.universe.names[member]})
                body = None if body is None else self._conjunction(conjuncts(instance), body)
            if body is None:
                yield None
            else:
                yield from body[len(context) :]
            return
        # A chain: step n holds if the condition can hold for the first n objects.
        order, name = self._order(parameter.types), self._fresh()
        variables = [_variable(each) for each in mf.free(part) if each != parameter.name]
        self._rule(_written(name, ["0", *variables]), context)
        step = f"N{name}"
        inside = [*context, _written(name, [step, *variables])]
        inside.append(f"{order}({step},{_variable(parameter.name)})")
        found = self._conjunction(conjuncts(part), inside)
        if found is not None:
            self._rule(_written(name, [f"{step}+1", *variables]), found)
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
                        and (part.predicate, position) not in self.usage.loose
                        and self.model.types.fits(declared[position].types, types[arg])
                    ):
                        bound.add(arg)
        return [f"{self._type(types[name])}({_variable(name)})" for name in types if name not in bound]

    def _type(self, types: tuple[str, ...]) -> str:
        key = tuple(sorted(types))
        if key not in self._types:
            name = self._types[key] = f"y{len(self._types)}"
            self.program.lines.extend(f"{name}({index})." for index in self.universe.members(key))
        return self._types[key]

    def _order(self, types: tuple[str, ...]) -> str:
        name = "o" + self._type(types)
        if name not in self._ordered:
            self._ordered.add(name)
            members = enumerate(self.universe.members(types))
            self.program.lines.extend(f"{name}({position},{index})." for position, index in members)
        return name

    def _fresh(self) -> str:
        self._auxiliary += 1
        return f"x{self._auxiliary}"

    def _call(self, name: str, args: Iterable[mf.Term]) -> str:
        return _written(name, map(self._term, args))

    def _term(self, term: mf.Term) -> str:
        return _variable(term) if mf.is_parameter(term) else str(self.universe.index[term])

    def _rule(self, head: str, body: list[str]) -> None:
        body = list(dict.fromkeys(body))
        if len(body) > _LONGEST_BODY:
            body = self._chained(head, body)
        self._rules.append(f"{head} :- {', '.join(body)}." if body else f"{head}.")

    def _chained(self, head: str, body: list[str]) -> list[str]:
        """A short body in place of a long one, which takes the grounder quadratic time: what holds of the
        first literals has a predicate of its own, that of these and the next ones another, and so on."""
        # What only compares or denies what others bind comes after them; an equality may bind, too.
        last = [each for each in body if "=" in each and "!=" not in each]
        tests = [each for each in body if "!=" in each or each.startswith("not ")]
        binding = [each for each in body if "=" not in each and not each.startswith("not ")]
        bound: dict[str, None] = {}
        for literal in binding:
            bound.update(dict.fromkeys(_VARIABLES.findall(literal)))
        ordered = [*binding, *(each for each in tests if bound.keys() >= set(_VARIABLES.findall(each)))]
        last += [each for each in tests if not bound.keys() >= set(_VARIABLES.findall(each))]
        needed = {*_VARIABLES.findall(head), *(name for each in last for name in _VARIABLES.findall(each))}
        until = {name: place for place, each in enumerate(ordered) for name in _VARIABLES.findall(each)}
        found: dict[str, None] = {}
        before: list[str] = []
        for start in range(0, len(ordered), _LONGEST_BODY):
            part = ordered[start : start + _LONGEST_BODY]
            found.update((name, None) for each in part for name in _VARIABLES.findall(each))
            end = start + len(part)
            name = _written(self._fresh(), [each for each in found if each in needed or until[each] >= end])
            self._rules.append(f"{name} :- {', '.join([*before, *part])}.")
            before = [name]
        return [*before, *last]


def all_groups(
    block: Block, around: tuple[Parameter, ...] = (), guard: tuple[mf.Formula, ...] = ()
) -> Iterator[Group]:
    """The groups of a block and of all branches of its chances, each with what stands around it."""
    for group in groups(block):
        yield Group(around + group.parameters, guard + group.guard, group.leaves)
    for chance in block.chances:
        for _, branch in chance.branches:
            yield from all_groups(branch, around + chance.parameters, guard + chance.guard)


def _shows(leaf: me.Leaf) -> bool:
    """Whether it can matter that the leaf happens, whatever holds: costs alone do not."""
    match leaf:
        case me.Add(to):
            return to == "reward"
        case me.Set(_, _, value):
            return value is not Truth.FALSE
        case me.Change():
            return True
        case _:
            assert_never(leaf)


def _read(part: mf.Formula, scope: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    """The parameters that a part reads."""
    names = mf.free(part)
    return tuple(parameter for parameter in scope if parameter.name in names)


def _variable(name: str) -> str:
    # Parameter names hold any character; as hexadecimal they are letters and digits only.
    return "V" + name.encode().hex()


def _written(name: str, args: Iterable[str]) -> str:
    listed = ",".join(args)
    return f"{name}({listed})" if listed else name


def _atom(name: str, parameters: Iterable[Parameter]) -> str:
    return _written(name, [_variable(parameter.name) for parameter in parameters])


def _fact(name: str, row: Iterable[int]) -> str:
    return _written(name, map(str, row)) + "."
