"""From what the grammar recognises to syntax nodes: one function per rule of ``grammar/bbtc.lark``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from bbtc.kleene import Truth
from bbtc.source import Span
from bbtc.syntax import ast, leaves
from bbtc.syntax.engine import Token
from bbtc.syntax.hints import CONNECTIVES, NOT_IN_EFFECT, nearest
from bbtc.syntax.leaves import SOURCE, Misuse, between, of

_WORD = re.compile(r"\??[^\s()?]+")


class Field(NamedTuple):
    """One field of an action, a template, a sensor or an axiom: ``keyword value``."""

    kind: str
    keyword: Token
    value: Any


def _covering(nodes: Sequence[Any]) -> Span:
    first, last = nodes[0].span, nodes[-1].span
    return Span(first.source, first.start, last.end)


def _number(token: Token) -> ast.Number:
    return leaves.number(token.text, of(token))


def _unsupported(construct: str, first: Token, last: Token) -> ast.Unsupported:
    return ast.Unsupported(construct, leaves.plain_text(first, last), between(first, last))


def _keyword(token: Token) -> str:
    """The keyword in a terminal that opens a form."""
    return token.text.lstrip("(").strip().lower()


def _fields(fields: Iterable[Field]) -> dict[str, Field]:
    """Fields by kind; each may be given once."""
    found: dict[str, Field] = {}
    for field in fields:
        before = found.setdefault(field.kind, field)
        if before is not field:
            raise Misuse(
                "BBT0110",
                f"`{field.keyword.text.lower()}` is given twice",
                of(field.keyword),
                None,
                of(before.keyword),
            )
    return found


def _value(fields: dict[str, Field], kind: str) -> Any:
    return fields[kind].value if kind in fields else None


def _required(fields: dict[str, Field], kind: str, keyword: str, what: str, name: Token) -> Any:
    if kind not in fields:
        raise Misuse("BBT0111", f"{what} lacks `{keyword}`", of(name))
    return fields[kind].value


def _parameters(entries: ast.TypedList, last: Token) -> ast.TypedList:
    """Parameters of a form. Some files write ``?b-block`` for ``?b - block``: read it so where the form
    uses ``?b`` and never ``?b-block``."""
    if not any("-" in name.text for group in entries for name in group.names):
        return entries
    end = entries[-1].span.end
    used = {word.lower() for word in _WORD.findall(SOURCE.get().text[end : last.start])}
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
            groups.append(
                ast.TypedGroup(
                    tuple(names), group.types, Span(group.span.source, names[0].span.start, group.span.end)
                )
            )
    return tuple(groups)


def _expression(operand: Any) -> ast.NumericExpression | None:
    """An operand as a numeric expression, if it is one."""
    match operand:
        case ast.Number() | ast.FluentRef() | ast.Arithmetic():
            return operand
        case ast.Name():
            leaves.refuse_head(operand.text, operand.span, "a number or a numeric fluent")
            return ast.FluentRef(operand, (), operand.span)
        case _:
            return None


class Builder:
    """Callbacks of the parser, named as the rules and their aliases. Each takes the list of children:
    tokens as they are, rules as built."""

    # --- files and definitions ---------------------------------------------------------------

    def document(self, children: list[Any]) -> tuple[ast.Definition, ...]:
        return tuple(children)

    def domain(self, children: list[Any]) -> ast.Definition:
        head, name, _, *sections, close = children
        return ast.Definition("domain", leaves.name(name), tuple(sections), between(head, close))

    def problem(self, children: list[Any]) -> ast.Definition:
        head, name, _, *sections, close = children
        return ast.Definition("problem", leaves.name(name), tuple(sections), between(head, close))

    # --- declarations ------------------------------------------------------------------------

    def requirements(self, children: list[Any]) -> ast.Requirements:
        return ast.Requirements(tuple(map(leaves.name, children[1:-1])), between(children[0], children[-1]))

    def types(self, children: list[Any]) -> ast.TypedSection:
        return ast.TypedSection("types", children[1], between(children[0], children[-1]))

    def constants(self, children: list[Any]) -> ast.TypedSection:
        return ast.TypedSection("constants", children[1], between(children[0], children[-1]))

    def objects(self, children: list[Any]) -> ast.TypedSection:
        return ast.TypedSection("objects", children[1], between(children[0], children[-1]))

    def typed_names(self, children: list[Any]) -> ast.TypedList:
        groups: list[ast.TypedGroup] = []
        names: tuple[ast.Term, ...] = ()
        for child in children:
            if not isinstance(child, Token):
                types, span = child
                groups.append(ast.TypedGroup(names, types, Span(span.source, names[0].span.start, span.end)))
                names = ()
            else:
                names += tuple(leaves.terms(child.text, child.start, SOURCE.get()))
        if names:
            groups.append(ast.TypedGroup(names, (), _covering(names)))
        return tuple(groups)

    typed_variables = typed_names

    def names_flat(self, children: list[Any]) -> ast.TypedList:
        return leaves.groups(children[0].text, children[0].start, variables=False)

    def variable_list(self, children: list[Any]) -> ast.TypedList:
        return children[1]  # type: ignore[no-any-return]

    def variables_flat(self, children: list[Any]) -> ast.TypedList:
        token = children[0]
        return leaves.groups(token.text[1:-1], token.start + 1, variables=True)

    def type(self, children: list[Any]) -> tuple[tuple[ast.Name, ...], Span]:
        return (leaves.name(children[1]),), between(children[0], children[1])

    def type_either(self, children: list[Any]) -> tuple[tuple[ast.Term, ...], Span]:
        dash, _, *runs, close = children
        if not runs:
            raise Misuse("BBT0101", "`(either)` names no type", between(dash, close))
        return tuple(t for run in runs for t in leaves.terms(run.text, run.start, SOURCE.get())), between(
            dash, close
        )

    def predicates(self, children: list[Any]) -> ast.Predicates:
        return ast.Predicates(tuple(children[1:-1]), between(children[0], children[-1]))

    def predicate(self, children: list[Any]) -> ast.PredicateDeclaration:
        head, parameters, close = children
        name = leaves.declared("predicate", leaves.head_name(head))
        return ast.PredicateDeclaration(name, parameters, False, between(head, close))

    def predicate_equal(self, children: list[Any]) -> ast.PredicateDeclaration:
        head, parameters, close = children
        name = ast.Name("=", Span(SOURCE.get(), head.end - 1, head.end))
        if sum(len(group.names) for group in parameters) != 2:
            raise Misuse(
                "BBT0228", "a predicate cannot be called `=`", name.span, "it is built in, of two terms"
            )
        return ast.PredicateDeclaration(name, parameters, False, between(head, close))

    def predicate_flat(self, children: list[Any]) -> ast.PredicateDeclaration:
        token = children[0]
        found = _WORD.search(token.text, 1)
        assert found is not None
        start = token.start + found.start()
        word = ast.Name(found.group(), Span(SOURCE.get(), start, start + len(found.group())))
        name = leaves.declared("predicate", word)
        entries = leaves.groups(token.text[found.end() : -1], token.start + found.end(), variables=True)
        return ast.PredicateDeclaration(name, entries, False, of(token))

    def predicate_unknown(self, children: list[Any]) -> ast.PredicateDeclaration:
        unknown, head, parameters, _, close = children
        name = leaves.declared("predicate", leaves.head_name(head))
        return ast.PredicateDeclaration(name, parameters, True, between(unknown, close))

    def external(self, children: list[Any]) -> ast.PredicateDeclaration:
        predicate: ast.PredicateDeclaration = children[1]
        return replace(predicate, external=True, span=between(children[0], children[2]))

    def functions(self, children: list[Any]) -> ast.Functions:
        return ast.Functions(tuple(children[1:-1]), between(children[0], children[-1]))

    def function(self, children: list[Any]) -> ast.FunctionDeclaration:
        head, parameters, close, *types = children
        span = between(head, close)
        if types:
            span = Span(span.source, span.start, types[0][1].end)
        name = leaves.declared("function", leaves.head_name(head))
        return ast.FunctionDeclaration(name, parameters, types[0][0] if types else (), span)

    def function_bare(self, children: list[Any]) -> ast.FunctionDeclaration:
        name, *types = children
        span = of(name) if not types else Span(SOURCE.get(), name.start, types[0][1].end)
        declared = leaves.declared("function", leaves.name(name))
        return ast.FunctionDeclaration(declared, (), types[0][0] if types else (), span)

    # --- actions and the like ----------------------------------------------------------------

    def action(self, children: list[Any]) -> ast.Action:
        head, name, *given, close = children
        fields = _fields(given)
        return ast.Action(
            leaves.name(name),
            _parameters(_value(fields, "parameters") or (), close),
            _value(fields, "precondition"),
            _value(fields, "observe"),
            _value(fields, "effect"),
            between(head, close),
        )

    def template(self, children: list[Any]) -> ast.Template:
        head, name, *given, close = children
        fields = _fields(given)
        return ast.Template(
            leaves.declared("template", leaves.name(name)),
            _parameters(_value(fields, "parameters") or (), close),
            _value(fields, "precondition"),
            _value(fields, "effect"),
            _required(fields, "body", ":body", "the template", name),
            between(head, close),
        )

    def sensor(self, children: list[Any]) -> ast.Sensor:
        head, name, *given, close = children
        fields = _fields(given)
        return ast.Sensor(
            leaves.name(name),
            _parameters(_value(fields, "parameters") or (), close),
            _value(fields, "condition"),
            _required(fields, "sensed", ":sensed", "the sensor", name),
            between(head, close),
        )

    def parameters(self, children: list[Any]) -> Field:
        return Field("parameters", *children)

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

    def observe_agent(self, children: list[Any]) -> Field:
        message = "`:observe-agent`, an observation by one of several agents, is not supported"
        raise Misuse("BBT0212", message, of(children[0]))

    def derived(self, children: list[Any]) -> ast.Derived:
        form, head, parameters, close, condition, end = children
        parameters = _parameters(parameters, end)
        args = tuple(name for group in parameters for name in group.names)
        atom = ast.Atom(leaves.declared("predicate", leaves.head_name(head)), args, between(head, close))
        kind: Any = "axiom" if form.kind == "AXIOM" else "derived"
        return ast.Derived(
            "derived" if kind == "axiom" else kind, parameters, atom, condition, between(form, end)
        )

    def axiom(self, children: list[Any]) -> ast.Derived:
        head, *given, close = children
        fields = _fields(given)
        return ast.Derived(
            "axiom",
            _parameters(_value(fields, "parameters") or (), close),
            _required(fields, "head", ":implies", "the axiom", head),
            _required(fields, "context", ":context", "the axiom", head),
            between(head, close),
        )

    def axiom_parameters(self, children: list[Any]) -> Field:
        return Field("parameters", *children)

    def axiom_context(self, children: list[Any]) -> Field:
        return Field("context", *children)

    def axiom_head(self, children: list[Any]) -> Field:
        return Field("head", *children)

    # --- problems ----------------------------------------------------------------------------

    def domain_reference(self, children: list[Any]) -> ast.DomainReference:
        head, name, close = children
        return ast.DomainReference(leaves.name(name), between(head, close))

    def init(self, children: list[Any]) -> ast.Init:
        return ast.Init(_spliced(children[1:-1]), between(children[0], children[-1]))

    def hidden(self, children: list[Any]) -> ast.Hidden:
        facts = _spliced(children[1:-1])
        for fact in facts:
            if not isinstance(fact, ast.Assign):
                raise Misuse(
                    "BBT0101",
                    "`:hidden` holds facts only",
                    fact.span,
                    "each is `(p a)` or `(not (p a))`; numbers and what is uncertain stand in `:init`",
                )
        return ast.Hidden(facts, between(children[0], children[-1]))

    def goal(self, children: list[Any]) -> ast.Goal:
        head, *formula, close = children
        whole = between(head, close)
        return ast.Goal(formula[0] if formula else ast.Empty(whole), whole)

    def goal_number(self, children: list[Any]) -> ast.GoalNumber:
        head, number, close = children
        kind: Any = head.kind.lower().replace("_", "-")
        return ast.GoalNumber(kind, _number(number), between(head, close))

    def metric(self, children: list[Any]) -> ast.Metric:
        head, direction, operand, close = children
        way: Any = direction.text.lower()
        expression = _expression(operand)
        if expression is None:
            raise Misuse("BBT0101", "the metric is no numeric expression", between(head, close))
        return ast.Metric(way, expression, between(head, close))

    def facts(self, children: list[Any]) -> list[ast.InitElement]:
        return leaves.facts(children[0])

    def fluent_value(self, children: list[Any]) -> ast.FluentValue | ast.Unsupported:
        head, left, right, close = children
        fluent = _expression(left)
        if isinstance(fluent, ast.FluentRef) and isinstance(right, ast.Number):
            return ast.FluentValue(fluent, right, between(head, close))
        return _unsupported("object fluent", head, close)

    def init_and(self, children: list[Any]) -> ast.InitAnd:
        return ast.InitAnd(_spliced(children[1:-1]), between(children[0], children[-1]))

    def init_or(self, children: list[Any]) -> ast.InitClause:
        clause = self.disjunction(children)
        return ast.InitClause(clause, clause.span)

    def init_imply(self, children: list[Any]) -> ast.InitClause:
        clause = self.implication(children)
        return ast.InitClause(clause, clause.span)

    def init_not(self, children: list[Any]) -> ast.InitClause | ast.Assign:
        clause = self.negation(children)
        if isinstance(clause.part, ast.Atom):
            return leaves.assign(clause.part, Truth.FALSE, clause.span)
        return ast.InitClause(clause, clause.span)

    def invariant(self, children: list[Any]) -> ast.Invariant:
        return ast.Invariant(tuple(children[1:-1]), between(children[0], children[-1]))

    def timed_literal(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported("timed initial literal", children[0], children[-1])

    # --- formulas ----------------------------------------------------------------------------

    def flat(self, children: list[Any]) -> ast.Atom:
        return leaves.flat(children[0])

    def bare(self, children: list[Any]) -> ast.Atom:
        return leaves.atom(children[0])

    atom = bare

    def negated(self, children: list[Any]) -> ast.Not:
        return ast.Not(leaves.negated(children[0]), of(children[0]))

    def empty(self, children: list[Any]) -> ast.Empty:
        return ast.Empty(of(children[0]))

    def negation(self, children: list[Any]) -> ast.Not:
        head, part, close = children
        return ast.Not(part, between(head, close))

    def conjunction(self, children: list[Any]) -> ast.And:
        return ast.And(tuple(children[1:-1]), between(children[0], children[-1]))

    def literals(self, children: list[Any]) -> ast.And:
        return ast.And(tuple(leaves.literals(children[0])), of(children[0]))

    def equation(self, children: list[Any]) -> ast.Equality:
        token: Token = children[0]
        return leaves.equation(token.text, token.start)

    def unequal(self, children: list[Any]) -> ast.Not:
        token = children[0]
        start = token.text.index("(", 1)
        inner = token.text[start : token.text.index(")") + 1]
        return ast.Not(leaves.equation(inner, token.start + start), of(token))

    def disjunction(self, children: list[Any]) -> ast.Or:
        return ast.Or(tuple(children[1:-1]), between(children[0], children[-1]))

    def implication(self, children: list[Any]) -> ast.Imply:
        head, premise, conclusion, close = children
        return ast.Imply(premise, conclusion, between(head, close))

    def quantified(self, children: list[Any]) -> ast.Quantified:
        head, parameters, part, close = children
        kind: Any = _keyword(head)
        return ast.Quantified(kind, _parameters(parameters, close), part, between(head, close))

    def test(self, children: list[Any]) -> ast.Test:
        head, atom, close = children
        kind: Any = _keyword(head)
        return ast.Test(kind, atom, between(head, close))

    def comparison(self, children: list[Any]) -> ast.Equality | ast.Unsupported:
        head, left, right, close = children
        if head.kind == "EQUAL":
            numbers = isinstance(left, ast.Number) and isinstance(right, ast.Number)
            sides = [ast.Name(s.text, s.span) if isinstance(s, ast.Number) else s for s in (left, right)]
            terms = [isinstance(side, ast.Name | ast.Variable) for side in sides]
            if all(terms) and not numbers:
                return ast.Equality(sides[0], sides[1], between(head, close))
            if any(isinstance(side, ast.Name | ast.Variable | ast.Unsupported) for side in (left, right)):
                return _unsupported("object fluent", head, close)
        return _unsupported("numeric comparison", head, close)

    def preference(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported("preference", children[0], children[-1])

    def trajectory(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported("trajectory constraint", children[0], children[-1])

    def term(self, children: list[Any]) -> ast.Term:
        token = children[0]
        return ast.Variable(token.text, of(token)) if token.kind == "VARIABLE" else leaves.name(token)

    # --- effects -----------------------------------------------------------------------------

    def assign_flat(self, children: list[Any]) -> ast.Assign:
        atom = leaves.flat(children[0])
        return leaves.assign(atom, Truth.TRUE, atom.span)

    def assign_bare(self, children: list[Any]) -> ast.Assign:
        atom = leaves.atom(children[0])
        return leaves.assign(atom, Truth.TRUE, atom.span)

    def assign_negated(self, children: list[Any]) -> ast.Assign:
        return leaves.assign(leaves.negated(children[0]), Truth.FALSE, of(children[0]))

    def assign_not(self, children: list[Any]) -> ast.Assign:
        head, atom, close = children
        return leaves.assign(leaves.atom(atom), Truth.FALSE, between(head, close))

    def assign_unknown(self, children: list[Any]) -> ast.Assign:
        head, atom, close = children
        return leaves.assign(atom, Truth.UNKNOWN, between(head, close))

    def effect_and(self, children: list[Any]) -> ast.EffectAnd:
        return ast.EffectAnd(tuple(children[1:-1]), between(children[0], children[-1]))

    def effect_literals(self, children: list[Any]) -> ast.EffectAnd:
        parts: list[ast.Effect] = []
        for literal in leaves.literals(children[0]):
            match literal:
                case ast.Atom():
                    parts.append(leaves.assign(literal, Truth.TRUE, literal.span))
                case ast.Not(ast.Atom() as atom):
                    parts.append(leaves.assign(atom, Truth.FALSE, literal.span))
                case _:
                    raise Misuse("BBT0101", "an effect cannot say `=`", literal.span, NOT_IN_EFFECT["="])
        return ast.EffectAnd(tuple(parts), of(children[0]))

    def when(self, children: list[Any]) -> ast.When:
        head, condition, effect, close = children
        return ast.When(condition, effect, between(head, close))

    def effect_forall(self, children: list[Any]) -> ast.EffectForall:
        head, parameters, effect, close = children
        return ast.EffectForall(_parameters(parameters, close), effect, between(head, close))

    def probabilistic(self, children: list[Any]) -> ast.Probabilistic:
        return ast.Probabilistic(tuple(children[1:-1]), between(children[0], children[-1]))

    def branch(self, children: list[Any]) -> ast.Branch:
        number, effect = children
        probability = _number(number)
        return ast.Branch(probability, effect, Span(SOURCE.get(), number.start, effect.span.end))

    def one_of(self, children: list[Any]) -> ast.OneOf:
        return ast.OneOf(tuple(children[1:-1]), between(children[0], children[-1]))

    def fluent_effect(self, children: list[Any]) -> ast.FluentEffect | ast.Unsupported:
        head, target, amount, close = children
        fluent, expression = _expression(target), _expression(amount)
        if isinstance(fluent, ast.FluentRef) and expression is not None:
            return ast.FluentEffect(_keyword(head), fluent, expression, between(head, close))
        return _unsupported("object fluent", head, close)

    # --- terms and numbers -------------------------------------------------------------------

    def number(self, children: list[Any]) -> ast.Number:
        return _number(children[0])

    def fluent(self, children: list[Any]) -> ast.FluentRef:
        return leaves.fluent(children[0])

    def arithmetic(self, children: list[Any]) -> ast.Arithmetic | ast.Unsupported:
        head, *operands, close = children
        parts = [_expression(operand) for operand in operands]
        if None in parts:
            return _unsupported("arithmetic on objects", head, close)
        return ast.Arithmetic(_keyword(head), tuple(p for p in parts if p), between(head, close))

    def nested(self, children: list[Any]) -> ast.Unsupported:
        """An atom whose arguments are no plain terms: an object fluent, or a misspelt keyword."""
        word = _keyword(children[0])
        near = nearest(word, CONNECTIVES)
        if near is not None:
            raise Misuse("BBT0101", f"`{word}` is no keyword", of(children[0]), f"did you mean `{near}`?")
        return _unsupported("object fluent", children[0], children[-1])

    # --- bodies ------------------------------------------------------------------------------

    def body_control(self, children: list[Any]) -> ast.BodyControl:
        kind: Any = _keyword(children[0])
        return ast.BodyControl(kind, tuple(children[1:-1]), between(children[0], children[-1]))

    def body_condition(self, children: list[Any]) -> ast.BodyCondition:
        head, formula, close = children
        return ast.BodyCondition(formula, between(head, close))

    def body_foreach(self, children: list[Any]) -> ast.BodyForeach:
        head, parameters, child, close = children
        return ast.BodyForeach(_parameters(parameters, close), child, between(head, close))

    def body_action(self, children: list[Any]) -> ast.BodyCall:
        head, name, *args, close = children
        terms = tuple(self.term([arg]) for arg in args)
        return ast.BodyCall("action", leaves.name(name), terms, between(head, close))

    def body_call(self, children: list[Any]) -> ast.BodyCall:
        atom = leaves.flat(children[0])
        return ast.BodyCall(None, atom.predicate, atom.args, atom.span)

    # --- what is refused by name -------------------------------------------------------------

    def sexpr(self, children: list[Any]) -> None:
        """Nothing: what is refused keeps its text only."""

    def unsupported_section(self, children: list[Any]) -> ast.Unsupported:
        return _unsupported(_keyword(children[0]), children[0], children[-1])


def _spliced(children: Iterable[Any]) -> tuple[Any, ...]:
    """Children in one tuple, runs of facts laid open."""
    found: list[Any] = []
    for child in children:
        found.extend(child if isinstance(child, list) else [child])
    return tuple(found)
