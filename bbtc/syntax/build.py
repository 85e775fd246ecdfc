"""From what the grammar recognises to syntax nodes: one function per rule of ``grammar/bbtc.lark``.

The functions keep no state. Spans need to know the source: the parser sets it for the time of one
parse (:data:`SOURCE`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextvars import ContextVar
from typing import Any, NamedTuple

from lark import Token

from bbtc.kleene import Truth
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast

SOURCE: ContextVar[SourceFile] = ContextVar("SOURCE")

_WORD = re.compile(r"\??[^\s()?]+")
_NUMBER_LENGTH = 200
_EXPONENT = re.compile(r"e[-+]?0*([0-9]+)$", re.IGNORECASE)
_EXPONENT_LIMIT = 300
_ZERO_DENOMINATOR = re.compile(r"/0+$")
_SPACE = re.compile(r"\s+")
_INNER_SPACE = re.compile(r"(?<=\() | (?=\))")


class Misuse(Exception):
    """A form that fits the grammar's rules one by one but not together; reported like a syntax error."""

    def __init__(
        self, code: str, message: str, span: Span, hint: str | None = None, first: Span | None = None
    ):
        super().__init__(message)
        self.code, self.message, self.span, self.hint, self.first = code, message, span, hint, first


class Field(NamedTuple):
    """One field of an action, a template, a sensor or an axiom: ``keyword value``."""

    kind: str
    keyword: Token
    value: Any


def _between(first: Token, last: Token) -> Span:
    return Span(SOURCE.get(), first.start_pos or 0, last.end_pos or 0)


def _of(token: Token) -> Span:
    return Span(SOURCE.get(), token.start_pos or 0, token.end_pos or 0)


def _covering(nodes: Sequence[Any]) -> Span:
    first, last = nodes[0].span, nodes[-1].span
    return Span(first.source, first.start, last.end)


def _name(token: Token) -> ast.Name:
    return ast.Name(str(token), _of(token))


def _terms(text: str, offset: int) -> tuple[ast.Term, ...]:
    """The words of a text that starts at an offset of the source, as names and variables."""
    source = SOURCE.get()
    found: list[ast.Term] = []
    for match in _WORD.finditer(text):
        word = match.group()
        span = Span(source, offset + match.start(), offset + match.end())
        found.append(ast.Variable(word, span) if word[0] == "?" else ast.Name(word, span))
    return tuple(found)


def _flat(text: str, offset: int) -> ast.Atom:
    """The atom written as ``text``, parentheses and all."""
    predicate, *args = _terms(text, offset)
    assert isinstance(predicate, ast.Name)
    return ast.Atom(predicate, tuple(args), Span(SOURCE.get(), offset, offset + len(text)))


def _atom(token: Token) -> ast.Atom:
    if token.type == "FLAT":
        return _flat(str(token), token.start_pos or 0)
    return ast.Atom(_name(token), (), _of(token))


def _fluent(token: Token) -> ast.FluentRef:
    atom = _atom(token)
    return ast.FluentRef(atom.predicate, atom.args, atom.span)


def _number(text: str, span: Span) -> ast.Number:
    """A number, refused if its exact value cannot be formed in a small space."""
    if _ZERO_DENOMINATOR.search(text):
        raise Misuse("BBT0112", f"`{text[:40]}` divides by zero", span)
    exponent = _EXPONENT.search(text)
    huge = exponent is not None and (len(exponent[1]) > 4 or int(exponent[1]) > _EXPONENT_LIMIT)
    if huge or len(text) > _NUMBER_LENGTH:
        raise Misuse("BBT0113", f"number `{text[:40]}` has too many digits", span)
    return ast.Number(text, span)


def _text(first: Token, last: Token) -> str:
    """The source between two tokens on one line, without comments."""
    source = SOURCE.get()
    raw = re.sub(r";[^\r\n]*", "", source.text[first.start_pos : last.end_pos])
    return _INNER_SPACE.sub("", _SPACE.sub(" ", raw))


def _unsupported(construct: str, first: Token, last: Token) -> ast.Unsupported:
    return ast.Unsupported(construct, _text(first, last), _between(first, last))


def _keyword(token: Token) -> str:
    """The keyword in a terminal that opens a form."""
    return str(token).lstrip("(").strip().lower()


def _fields(fields: Iterable[Field]) -> dict[str, Field]:
    """Fields by kind; each may be given once."""
    found: dict[str, Field] = {}
    for field in fields:
        before = found.setdefault(field.kind, field)
        if before is not field:
            raise Misuse(
                "BBT0110",
                f"`{str(field.keyword).lower()}` is given twice",
                _of(field.keyword),
                None,
                _of(before.keyword),
            )
    return found


def _value(fields: dict[str, Field], kind: str) -> Any:
    return fields[kind].value if kind in fields else None


def _required(fields: dict[str, Field], kind: str, keyword: str, what: str, name: Token) -> Any:
    if kind not in fields:
        raise Misuse("BBT0111", f"{what} lacks `{keyword}`", _of(name))
    return fields[kind].value


def _parameters(entries: ast.TypedList, last: Token) -> ast.TypedList:
    """Parameters of a form. Some files write ``?b-block`` for ``?b - block``: read it so where the form
    uses ``?b`` and never ``?b-block``."""
    if not any("-" in name.text for group in entries for name in group.names):
        return entries
    end = entries[-1].span.end
    used = {word.lower() for word in _WORD.findall(SOURCE.get().text[end : last.start_pos])}
    groups: list[ast.TypedGroup] = []
    for group in entries:
        names: list[ast.Term] = []
        for name in group.names:
            short, _, kind = name.text.partition("-")
            if not kind or name.key in used or short.lower() not in used:
                names.append(name)
                continue
            source, start, stop = name.span
            middle = start + len(short)
            names.append(ast.Variable(short, Span(source, start, middle)))
            type_name = ast.Name(kind, Span(source, middle + 1, stop))
            groups.append(ast.TypedGroup(tuple(names), (type_name,), Span(source, names[0].span.start, stop)))
            names = []
        if names:
            groups.append(
                ast.TypedGroup(
                    tuple(names), group.types, Span(group.span.source, names[0].span.start, group.span.end)
                )
            )
    return tuple(groups)


class Builder:
    """Callbacks of the parser, named as the rules and their aliases. Each takes the list of children:
    tokens as they are, rules as built."""

    # --- files and definitions ---------------------------------------------------------------

    def document(self, children: list[Any]) -> tuple[ast.Definition, ...]:
        return tuple(children)

    def domain(self, children: list[Any]) -> ast.Definition:
        head, name, _, *sections, close = children
        return ast.Definition("domain", _name(name), tuple(sections), _between(head, close))

    def problem(self, children: list[Any]) -> ast.Definition:
        head, name, _, *sections, close = children
        return ast.Definition("problem", _name(name), tuple(sections), _between(head, close))

    # --- declarations ------------------------------------------------------------------------

    def requirements(self, children: list[Any]) -> ast.Requirements:
        return ast.Requirements(tuple(map(_name, children[1:-1])), _between(children[0], children[-1]))

    def types(self, children: list[Any]) -> ast.TypedSection:
        return ast.TypedSection("types", children[1], _between(children[0], children[-1]))

    def constants(self, children: list[Any]) -> ast.TypedSection:
        return ast.TypedSection("constants", children[1], _between(children[0], children[-1]))

    def objects(self, children: list[Any]) -> ast.TypedSection:
        return ast.TypedSection("objects", children[1], _between(children[0], children[-1]))

    def typed_names(self, children: list[Any]) -> ast.TypedList:
        groups: list[ast.TypedGroup] = []
        names: tuple[ast.Term, ...] = ()
        for child in children:
            if isinstance(child, Token):
                names += _terms(child, child.start_pos or 0)
            else:
                types, span = child
                groups.append(ast.TypedGroup(names, types, Span(span.source, names[0].span.start, span.end)))
                names = ()
        if names:
            groups.append(ast.TypedGroup(names, (), _covering(names)))
        return tuple(groups)

    typed_variables = typed_names

    def type(self, children: list[Any]) -> tuple[tuple[ast.Name, ...], Span]:
        return (_name(children[1]),), _between(children[0], children[1])

    def type_either(self, children: list[Any]) -> tuple[tuple[ast.Term, ...], Span]:
        dash, _, *runs, close = children
        return tuple(t for run in runs for t in _terms(run, run.start_pos)), _between(dash, close)

    def predicates(self, children: list[Any]) -> ast.Predicates:
        return ast.Predicates(tuple(children[1:-1]), _between(children[0], children[-1]))

    def predicate(self, children: list[Any]) -> ast.PredicateDeclaration:
        head, parameters, close = children
        return ast.PredicateDeclaration(_head_name(head), parameters, False, _between(head, close))

    def predicate_unknown(self, children: list[Any]) -> ast.PredicateDeclaration:
        unknown, head, parameters, _, close = children
        return ast.PredicateDeclaration(_head_name(head), parameters, True, _between(unknown, close))

    def functions(self, children: list[Any]) -> ast.Functions:
        return ast.Functions(tuple(children[1:-1]), _between(children[0], children[-1]))

    def function(self, children: list[Any]) -> ast.FunctionDeclaration:
        head, parameters, close, *types = children
        span = _between(head, close)
        if types:
            span = Span(span.source, span.start, types[0][1].end)
        return ast.FunctionDeclaration(_head_name(head), parameters, types[0][0] if types else (), span)

    def function_bare(self, children: list[Any]) -> ast.FunctionDeclaration:
        name, *types = children
        span = _of(name) if not types else Span(SOURCE.get(), name.start_pos, types[0][1].end)
        return ast.FunctionDeclaration(_name(name), (), types[0][0] if types else (), span)

    # --- actions and the like ----------------------------------------------------------------

    def action(self, children: list[Any]) -> ast.Action:
        head, name, *given, close = children
        fields = _fields(given)
        return ast.Action(
            _name(name),
            _parameters(_value(fields, "parameters") or (), close),
            _value(fields, "precondition"),
            _value(fields, "observe"),
            _value(fields, "effect"),
            _between(head, close),
        )

    def template(self, children: list[Any]) -> ast.Template:
        head, name, *given, close = children
        fields = _fields(given)
        return ast.Template(
            _name(name),
            _parameters(_value(fields, "parameters") or (), close),
            _value(fields, "precondition"),
            _value(fields, "effect"),
            _required(fields, "body", ":body", "the template", name),
            _between(head, close),
        )

    def sensor(self, children: list[Any]) -> ast.Sensor:
        head, name, *given, close = children
        fields = _fields(given)
        return ast.Sensor(
            _name(name),
            _parameters(_value(fields, "parameters") or (), close),
            _value(fields, "condition"),
            _required(fields, "sensed", ":sensed", "the sensor", name),
            _between(head, close),
        )

    def parameters(self, children: list[Any]) -> Field:
        return Field("parameters", children[0], children[2])

    def precondition(self, children: list[Any]) -> Field:
        return Field("precondition", *children)

    def effect(self, children: list[Any]) -> Field:
        return Field("effect", *children)

    def template_body(self, children: list[Any]) -> Field:
        return Field("body", *children)

    def sensor_condition(self, children: list[Any]) -> Field:
        return Field("condition", *children)

    def sensed(self, children: list[Any]) -> Field:
        return Field("sensed", *children)

    def observe(self, children: list[Any]) -> Field:
        keyword, *parts = children
        span = _covering(parts)
        content = parts[0] if len(parts) == 1 else ast.And(tuple(parts), span)
        return Field("observe", keyword, ast.Observation(content, span))

    def derived(self, children: list[Any]) -> ast.Derived:
        form, head, parameters, close, condition, end = children
        parameters = _parameters(parameters, end)
        args = tuple(name for group in parameters for name in group.names)
        atom = ast.Atom(_head_name(head), args, _between(head, close))
        kind: Any = "axiom" if form.type == "AXIOM" else "derived"
        return ast.Derived(
            "derived" if kind == "axiom" else kind, parameters, atom, condition, _between(form, end)
        )

    def axiom(self, children: list[Any]) -> ast.Derived:
        head, *given, close = children
        fields = _fields(given)
        return ast.Derived(
            "axiom",
            _parameters(_value(fields, "parameters") or (), close),
            _required(fields, "head", ":implies", "the axiom", head),
            _required(fields, "context", ":context", "the axiom", head),
            _between(head, close),
        )

    def axiom_parameters(self, children: list[Any]) -> Field:
        return Field("parameters", children[0], children[2])

    def axiom_context(self, children: list[Any]) -> Field:
        return Field("context", *children)

    def axiom_head(self, children: list[Any]) -> Field:
        return Field("head", *children)

    # --- problems ----------------------------------------------------------------------------

    def domain_reference(self, children: list[Any]) -> ast.DomainReference:
        head, name, close = children
        return ast.DomainReference(_name(name), _between(head, close))

    def init(self, children: list[Any]) -> ast.Init:
        return ast.Init(_spliced(children[1:-1]), _between(children[0], children[-1]))

    def hidden(self, children: list[Any]) -> ast.Hidden:
        return ast.Hidden(_spliced(children[1:-1]), _between(children[0], children[-1]))

    def goal(self, children: list[Any]) -> ast.Goal:
        head, *formula, close = children
        whole = _between(head, close)
        return ast.Goal(formula[0] if formula else ast.Empty(whole), whole)

    def goal_number(self, children: list[Any]) -> ast.GoalNumber:
        head, number, close = children
        kind: Any = head.type.lower().replace("_", "-")
        return ast.GoalNumber(kind, _number(str(number), _of(number)), _between(head, close))

    def metric(self, children: list[Any]) -> ast.Metric:
        head, direction, expression, close = children
        way: Any = direction.lower()
        return ast.Metric(way, expression, _between(head, close))

    def facts(self, children: list[Any]) -> list[ast.InitElement]:
        return list(_facts(children[0]))

    def fluent_value(self, children: list[Any]) -> ast.FluentValue:
        head, fluent, number, close = children
        return ast.FluentValue(fluent, _number(str(number), _of(number)), _between(head, close))

    def init_and(self, children: list[Any]) -> ast.InitAnd:
        return ast.InitAnd(_spliced(children[1:-1]), _between(children[0], children[-1]))

    def init_or(self, children: list[Any]) -> ast.InitClause:
        clause = self.disjunction(children)
        return ast.InitClause(clause, clause.span)

    def invariant(self, children: list[Any]) -> ast.Invariant:
        return ast.Invariant(tuple(children[1:-1]), _between(children[0], children[-1]))

    def timed_literal(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported("timed initial literal", children[0], children[-1])

    # --- formulas ----------------------------------------------------------------------------

    def flat(self, children: list[Any]) -> ast.Atom:
        return _flat(children[0], children[0].start_pos)

    def bare(self, children: list[Any]) -> ast.Atom:
        return _atom(children[0])

    atom = bare

    def negated(self, children: list[Any]) -> ast.Not:
        return ast.Not(_inner(children[0]), _of(children[0]))

    def empty(self, children: list[Any]) -> ast.Empty:
        return ast.Empty(_of(children[0]))

    def negation(self, children: list[Any]) -> ast.Not:
        head, part, close = children
        return ast.Not(part, _between(head, close))

    def conjunction(self, children: list[Any]) -> ast.And:
        return ast.And(tuple(children[1:-1]), _between(children[0], children[-1]))

    def disjunction(self, children: list[Any]) -> ast.Or:
        return ast.Or(tuple(children[1:-1]), _between(children[0], children[-1]))

    def implication(self, children: list[Any]) -> ast.Imply:
        head, premise, conclusion, close = children
        return ast.Imply(premise, conclusion, _between(head, close))

    def quantified(self, children: list[Any]) -> ast.Quantified:
        head, _, parameters, _, part, close = children
        kind: Any = _keyword(head)
        return ast.Quantified(kind, _parameters(parameters, close), part, _between(head, close))

    def test(self, children: list[Any]) -> ast.Test:
        head, atom, close = children
        kind: Any = _keyword(head)
        return ast.Test(kind, atom, _between(head, close))

    def comparison(self, children: list[Any]) -> ast.Equality | ast.Unsupported:
        head, left, right, close = children
        if head.type == "EQUAL":
            sides = [ast.Name(s.text, s.span) if isinstance(s, ast.Number) else s for s in (left, right)]
            numbers = isinstance(left, ast.Number) and isinstance(right, ast.Number)
            if not numbers and all(isinstance(s, ast.Name | ast.Variable) for s in sides):
                return ast.Equality(sides[0], sides[1], _between(head, close))
        return _unsupported("numeric comparison", head, close)

    def preference(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported("preference", children[0], children[-1])

    def trajectory(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported("trajectory constraint", children[0], children[-1])

    def term(self, children: list[Any]) -> ast.Term:
        token = children[0]
        return ast.Variable(str(token), _of(token)) if token.type == "VARIABLE" else _name(token)

    # --- effects -----------------------------------------------------------------------------

    def assign_flat(self, children: list[Any]) -> ast.Assign:
        atom = _flat(children[0], children[0].start_pos)
        return ast.Assign(atom, Truth.TRUE, atom.span)

    def assign_bare(self, children: list[Any]) -> ast.Assign:
        atom = _atom(children[0])
        return ast.Assign(atom, Truth.TRUE, atom.span)

    def assign_negated(self, children: list[Any]) -> ast.Assign:
        return ast.Assign(_inner(children[0]), Truth.FALSE, _of(children[0]))

    def assign_not(self, children: list[Any]) -> ast.Assign:
        head, atom, close = children
        return ast.Assign(_atom(atom), Truth.FALSE, _between(head, close))

    def assign_unknown(self, children: list[Any]) -> ast.Assign:
        head, atom, close = children
        return ast.Assign(atom, Truth.UNKNOWN, _between(head, close))

    def effect_and(self, children: list[Any]) -> ast.EffectAnd:
        return ast.EffectAnd(tuple(children[1:-1]), _between(children[0], children[-1]))

    def when(self, children: list[Any]) -> ast.When:
        head, condition, effect, close = children
        return ast.When(condition, effect, _between(head, close))

    def effect_forall(self, children: list[Any]) -> ast.EffectForall:
        head, _, parameters, _, effect, close = children
        return ast.EffectForall(_parameters(parameters, close), effect, _between(head, close))

    def probabilistic(self, children: list[Any]) -> ast.Probabilistic:
        return ast.Probabilistic(tuple(children[1:-1]), _between(children[0], children[-1]))

    def branch(self, children: list[Any]) -> ast.Branch:
        number, effect = children
        probability = _number(str(number), _of(number))
        return ast.Branch(probability, effect, Span(SOURCE.get(), number.start_pos, effect.span.end))

    def one_of(self, children: list[Any]) -> ast.OneOf:
        return ast.OneOf(tuple(children[1:-1]), _between(children[0], children[-1]))

    def fluent_effect(self, children: list[Any]) -> ast.FluentEffect:
        head, fluent, amount, close = children
        return ast.FluentEffect(_keyword(head), fluent, amount, _between(head, close))

    # --- numbers -----------------------------------------------------------------------------

    def number(self, children: list[Any]) -> ast.Number:
        return _number(str(children[0]), _of(children[0]))

    def fluent(self, children: list[Any]) -> ast.FluentRef:
        return _fluent(children[0])

    def arithmetic(self, children: list[Any]) -> ast.Arithmetic:
        head, *operands, close = children
        return ast.Arithmetic(_keyword(head), tuple(operands), _between(head, close))

    # --- bodies ------------------------------------------------------------------------------

    def body_control(self, children: list[Any]) -> ast.BodyControl:
        kind: Any = _keyword(children[0])
        return ast.BodyControl(kind, tuple(children[1:-1]), _between(children[0], children[-1]))

    def body_condition(self, children: list[Any]) -> ast.BodyCondition:
        head, formula, close = children
        return ast.BodyCondition(formula, _between(head, close))

    def body_foreach(self, children: list[Any]) -> ast.BodyForeach:
        head, _, parameters, _, child, close = children
        return ast.BodyForeach(_parameters(parameters, close), child, _between(head, close))

    def body_action(self, children: list[Any]) -> ast.BodyCall:
        head, name, *args, close = children
        terms = tuple(self.term([arg]) for arg in args)
        return ast.BodyCall("action", _name(name), terms, _between(head, close))

    def body_call(self, children: list[Any]) -> ast.BodyCall:
        atom = _flat(children[0], children[0].start_pos)
        return ast.BodyCall(None, atom.predicate, atom.args, atom.span)

    # --- what is refused by name -------------------------------------------------------------

    def unsupported_section(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported(_keyword(children[0]), children[0], children[-1])


def _head_name(head: Token) -> ast.Name:
    """The name in a ``(name`` terminal."""
    return ast.Name(
        str(head)[1:].strip(),
        Span(SOURCE.get(), (head.end_pos or 0) - len(str(head)[1:].strip()), head.end_pos or 0),
    )


def _inner(negated: Token) -> ast.Atom:
    """The atom within ``(not (p …))``."""
    start = negated.index("(", 1)
    end = negated.index(")") + 1
    return _flat(negated[start:end], (negated.start_pos or 0) + start)


def _spliced(children: Iterable[Any]) -> tuple[Any, ...]:
    """Children in one tuple, runs of facts laid open."""
    found: list[Any] = []
    for child in children:
        if isinstance(child, list):
            found.extend(child)
        else:
            found.append(child)
    return tuple(found)


_FACT = re.compile(r"\(\s*(=\s*)?(\([^()]*\)\s*)?([^()]*)\)")


def _facts(run: Token) -> Iterable[ast.InitElement]:
    """The elements of a run of flat facts and values of fluents."""
    source = SOURCE.get()
    base = run.start_pos or 0
    for match in _FACT.finditer(run):
        start = base + match.start()
        span = Span(source, start, base + match.end())
        if match[1]:
            inner = match[2].rstrip()
            atom = _flat(inner, base + match.start(2))
            number = match[3].strip()
            at = base + match.start(3)
            yield ast.FluentValue(
                ast.FluentRef(atom.predicate, atom.args, atom.span),
                _number(number, Span(source, at, at + len(number))),
                span,
            )
        else:
            yield ast.Assign(_flat(match.group(), start), Truth.TRUE, span)
