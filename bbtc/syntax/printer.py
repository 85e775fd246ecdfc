"""The canonical layout of a document: parsing what is printed gives an equal tree."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

from typing_extensions import assert_never

from bbtc.kleene import Truth
from bbtc.source import Span
from bbtc.syntax import ast
from bbtc.syntax.layout import Doc, Setter, has_empty_lines
from bbtc.syntax.scan import without_comments

_TOKEN = re.compile(r"[()]|[^\s()]+")
_Schema: TypeAlias = ast.Action | ast.Exogenous | ast.Template | ast.Sensor | ast.ObservationModel


def print_document(document: ast.Document) -> str:
    """The text of a document, comments in place."""
    docs = _Docs(without_comments(document.source.text))
    whole = Span(document.source, 0, len(document.source.text) + 1)
    definitions = tuple(docs.definition(definition) for definition in document.definitions)
    return Setter(document.comments).run(Doc("", definitions, span=whole, broken=True, airy=True))


class _Docs:
    """Makes the forms of nodes. ``text`` is the source without comments; it is empty for nodes that
    come from nowhere, whose words then have no places."""

    def __init__(self, text: str) -> None:
        self._text = text

    # --- places ------------------------------------------------------------------------------

    def _word(self, word: str, after: int, span: Span) -> Span | None:
        """Where a keyword stands that the tree does not keep: the first one after an offset."""
        whole = r"(?![\w-])" if word.startswith(":") else ""
        match = re.compile(re.escape(word) + whole, re.IGNORECASE).search(self._text, after, span.end)
        return Span(span.source, match.start(), match.end()) if match else None

    def _parentheses(self, after: int, last: int, span: Span) -> Span | None:
        """The parentheses around something that ends at ``last``; they open after an offset."""
        start = self._text.find("(", after, span.end)
        end = self._text.find(")", max(last, start), span.end)
        return Span(span.source, start, end + 1) if start >= 0 and end >= 0 else None

    def _inside(self, span: Span | None) -> Span | None:
        """The only form within a form."""
        if span is None:
            return None
        start = self._text.find("(", span.start + 1, span.end)
        end = self._text.rfind(")", start, span.end - 1)
        return Span(span.source, start, end + 1) if start >= 0 and end >= 0 else None

    # --- files and sections ------------------------------------------------------------------

    def definition(self, node: ast.Definition) -> Doc:
        name = _leaf(node.name)
        head_span = self._parentheses(node.span.start + 1, node.name.span.end, node.span)
        head = Doc(f"({node.kind}", (name,), ")", head_span, glued=1)
        sections = tuple(self.section(section) for section in node.sections)
        return Doc("(define", (head, *sections), ")", node.span, 1, broken=True, spaced=True, airy=True)

    def section(self, node: ast.Section) -> Doc:
        match node:
            case ast.Requirements():
                keys = tuple(map(_leaf, node.keys))
                return Doc("(:requirements", keys, ")", node.span, filled=True, hanging=True)
            case ast.TypedSection():
                return self.listed(f"(:{node.kind}", self.groups(node.entries), node, apart=True)
            case ast.Predicates():
                return self.listed("(:predicates", map(self.predicate, node.declarations), node, apart=True)
            case ast.Functions():
                return self.listed("(:functions", map(self.function, node.declarations), node)
            case ast.Action() | ast.Exogenous() | ast.Template() | ast.Sensor() | ast.ObservationModel():
                return self.schema(node)
            case ast.Derived():
                return self.derived(node)
            case (
                ast.StateVariable()
                | ast.AtomList()
                | ast.DefaultSensing()
                | ast.Observables()
                | ast.InitBelief()
                | ast.DurativeAction()
            ):
                return self.of_dialect(node)
            case ast.DomainReference():
                return Doc("(:domain", (_leaf(node.name),), ")", node.span, glued=1)
            case ast.Init():
                return self.listed("(:init", map(self.initial, node.elements), node)
            case ast.Hidden():
                return self.listed("(:hidden", map(self.initial, node.facts), node)
            case ast.Goal():
                return Doc("(:goal", (self.formula(node.formula),), ")", node.span, glued=1)
            case ast.GoalNumber():
                return Doc(f"(:{node.kind}", (_number(node.value),), ")", node.span, glued=1)
            case ast.Metric():
                expression = self.expression(node.expression)
                return Doc(f"(:metric {node.direction}", (expression,), ")", node.span, glued=1)
            case ast.Unsupported():
                return self.unsupported(node)
            case _:
                assert_never(node)

    def observed(self, content: ast.Formula | ast.Probabilistic) -> Doc:
        return self.effect(content) if isinstance(content, ast.Probabilistic) else self.formula(content)

    def listed(self, head: str, items: Iterable[Doc], node: ast.Section, *, apart: bool = False) -> Doc:
        """A section that is a list. Declarations stand ``apart``, each on its line; facts on one line if
        they fit and no empty line groups them, or else as the author arranged them in rows."""
        parts = tuple(items)
        broken = len(parts) > 1 and (apart or has_empty_lines(parts))
        return Doc(head, parts, ")", node.span, broken=broken, airy=True, rows=not apart)

    def schema(self, node: _Schema) -> Doc:
        """An action, a template or a sensor: name, parameters, and the fields that are given."""
        after, span = node.name.span.end, node.span
        fields: list[Doc] = []
        if node.parameters or self._word(":parameters", after, span):
            fields.append(self.parameters(node.parameters, after, span, ":parameters"))
        for names, value in _fields(node):
            word = self._spelt(names.split(), after, span)
            match value:
                case None | False:
                    continue
                case True:
                    fields.append(Doc(word, (), "", self._word(word, after, span)))
                    continue
                case ast.Observation():
                    doc = self.observed(value.content)
                case ast.SensingModel():
                    doc = self.effect(value.effect)
                case ast.Duration():
                    doc = self.duration(value)
                case _ if word in {":timeout", ":timeout-probability"}:
                    doc = self.expression(value)
                case ast.Name():
                    doc = _leaf(value)
                case tuple():
                    doc = self._names(value)
                case _ if word in {":effect", ":distribution", ":on-abort", ":on-timeout"}:
                    doc = self.effect(value)
                case _ if word == ":body":
                    doc = self.body(value)
                case _:
                    doc = self.formula(value)
            fields.append(self.field(word, doc, after, span))
        head = f"(:{type(node).__name__.lower().removesuffix('model')}"
        return Doc(
            head, (_leaf(node.name), *_in_source_order(fields)), ")", span, 1, broken=True, spaced=True
        )

    def durative(self, node: ast.DurativeAction) -> Doc:
        after, span = node.name.span.end, node.span
        fields: list[Doc] = []
        if node.parameters or self._word(":parameters", after, span):
            fields.append(self.parameters(node.parameters, after, span, ":parameters"))
        takes = Doc("(= ?duration", (self.expression(node.duration),), ")", node.duration.span, glued=1)
        fields.append(self.field(":duration", takes, after, span))
        for word, value in ((":condition", node.condition), (":effect", node.effect)):
            if value is not None:
                fields.append(self.field(word, self.timed(value), after, span))
        parts = (_leaf(node.name), *_in_source_order(fields))
        return Doc("(:durative-action", parts, ")", span, 1, broken=True, spaced=True)

    def timed(self, node: ast.Timed) -> Doc:
        """``(at start f)`` and the like."""
        match node:
            case ast.TimedFormula():
                return Doc(f"({node.when}", (self.formula(node.formula),), ")", node.span, glued=1)
            case ast.TimedChange():
                return Doc(f"({node.when}", (self.effect(node.effect),), ")", node.span, glued=1)
            case ast.TimedAll():
                return Doc("(and", tuple(map(self.timed, node.parts)), ")", node.span)
            case ast.TimedForall():
                typed = self.parameters(node.parameters, node.span.start + 1, node.span)
                return Doc("(forall", (typed, self.timed(node.part)), ")", node.span, glued=1)
            case ast.TimedWhen():
                parts = (self.timed(node.condition), self.timed(node.effect))
                return Doc("(when", parts, ")", node.span, glued=1)
            case _:
                assert_never(node)

    def duration(self, node: ast.Duration) -> Doc:
        """``12``, ``(uniform 8 20)``, ``(empirical (8 0.5) (20 0.5))``."""
        amounts = tuple(map(self.expression, node.amounts))
        if node.kind == "number":
            return amounts[0]
        if node.kind == "empirical":
            amounts = tuple(
                Doc("(", (amount, _number(weight)), ")", amount.span, glued=1, filled=True)
                for amount, weight in zip(amounts, node.weights, strict=True)
            )
        return Doc(f"({node.kind}", amounts, ")", node.span, filled=True)

    def _names(self, names: tuple[ast.Name, ...]) -> Doc:
        """Names of events: one alone, or several in parentheses."""
        if len(names) == 1:
            return _leaf(names[0])
        span = Span(names[0].span.source, names[0].span.start, names[-1].span.end)
        return Doc("(", tuple(map(_leaf, names)), ")", span, glued=1)

    def _spelt(self, words: Sequence[str], after: int, span: Span) -> str:
        """Of words that mean the same, the one that stands in a form; the first where none does."""
        return next((word for word in words if self._word(word, after, span)), words[0])

    def field(self, word: str, value: Doc, after: int, span: Span) -> Doc:
        """``:word value``."""
        place = self._word(word, after, span)
        whole = Span(span.source, place.start, value.span.end) if place and value.span else value.span
        return Doc(word, (value,), "", whole, glued=1)

    def parameters(self, entries: ast.TypedList, after: int, span: Span, word: str = "") -> Doc:
        """``(?x ?y - t)``, after a keyword or not."""
        place = self._word(word, after, span) if word else None
        if word and place is None:
            # Not written: it goes before what follows, and after the comments before that.
            rest = re.compile(r"\s*").match(self._text, after)
            start = rest.end() if rest else after
            here = span._replace(start=start, end=start)
            return Doc(f"{word} (", self.groups(entries), ")", here, glued=1, filled=True, hanging=True)
        start = place.end if place else after
        last = entries[-1].span.end if entries else start
        around = self._parentheses(start, last, span)
        whole = Span(span.source, place.start, around.end) if place and around else around
        opening = f"{word} (" if word else "("
        return Doc(opening, self.groups(entries), ")", whole, glued=1, filled=True, hanging=True)

    def derived(self, node: ast.Derived) -> Doc:
        condition = self.formula(node.condition)
        if node.kind == "derived":
            head = Doc(
                f"({node.head.predicate.text}", self.groups(node.parameters), ")", node.head.span, filled=True
            )
            return Doc("(:derived", (head, condition), ")", node.span, glued=1, spaced=True)
        start, span = node.span.start, node.span
        word = self._spelt((":vars", ":parameters"), start, span)
        fields = [
            self.parameters(node.parameters, start, span, word) if node.parameters else None,
            self.field(self._spelt((":context", ":body"), start, span), condition, start, span),
            self.field(self._spelt((":implies", ":head"), start, span), self.implied(node), start, span),
        ]
        parts = _in_source_order([part for part in fields if part])
        label = () if node.label is None else (_leaf(node.label),)
        return Doc("(:axiom", (*label, *parts), ")", span, len(label), broken=True, spaced=True)

    def implied(self, node: ast.Derived) -> Doc:
        heads = tuple(map(self.atom, node.heads))
        if not node.others:
            return heads[0]
        around = self._parentheses(node.head.span.start, node.others[-1].span.end, node.span)
        return Doc("(and", heads, ")", around)

    def belief(self, node: ast.FactBelief | ast.JointBelief) -> Doc:
        """``(prob p 0.3)``, ``(joint 0.5 f)``."""
        if isinstance(node, ast.FactBelief):
            return Doc("(prob", (self.atom(node.atom), _number(node.probability)), ")", node.span, glued=1)
        parts = (_number(node.probability), self.formula(node.condition))
        return Doc("(joint", parts, ")", node.span, glued=1)

    def of_dialect(
        self,
        node: ast.StateVariable
        | ast.AtomList
        | ast.DefaultSensing
        | ast.Observables
        | ast.InitBelief
        | ast.DurativeAction,
    ) -> Doc:
        """The forms of other planners, such as ``(:variable (name ?x - t) value…)``."""
        if isinstance(node, ast.DurativeAction):
            return self.durative(node)
        if isinstance(node, ast.Observables):
            return self.listed(f"(:{node.kind}", map(self.predicate, node.declarations), node, apart=True)
        if isinstance(node, ast.InitBelief):
            return self.listed("(:init-belief", map(self.belief, node.elements), node)
        if isinstance(node, ast.AtomList):
            return self.listed(f"(:{node.kind}", map(self.formula, node.values), node)
        if isinstance(node, ast.DefaultSensing):
            return Doc("(:default-sensing-model", (self.effect(node.effect),), ")", node.span)
        name = _leaf(node.name)
        if node.parameters is not None:
            last = node.parameters[-1].span.end if node.parameters else node.name.span.end
            around = self._parentheses(node.span.start + 1, last, node.span)
            name = Doc(f"({node.name.text}", self.groups(node.parameters), ")", around, filled=True)
        values = tuple(map(self.formula, node.values))
        return Doc(f"(:{node.kind}", (name, *values), ")", node.span, glued=1)

    # --- declarations ------------------------------------------------------------------------

    def groups(self, entries: ast.TypedList) -> tuple[Doc, ...]:
        return tuple(map(self.group, entries))

    def group(self, node: ast.TypedGroup) -> Doc:
        names = tuple(map(_leaf, node.names))
        if not node.types:
            return Doc("", names, "", node.span, filled=True)
        typed = self.types(node.types, node.names[-1].span.end, node.span)
        return Doc("", (*names, typed), "", node.span, filled=True)

    def types(self, types: tuple[ast.Name, ...], after: int, span: Span) -> Doc:
        """``- t`` or ``- (either t u)``."""
        dash = self._word("-", after, span) or types[0].span
        kind = _leaf(types[0])
        if len(types) > 1:
            around = self._parentheses(dash.end, types[-1].span.end, span)
            kind = Doc("(either", tuple(map(_leaf, types)), ")", around, filled=True)
        end = kind.span.end if kind.span else span.end
        return Doc("-", (kind,), "", Span(span.source, dash.start, end), glued=1)

    def predicate(self, node: ast.PredicateDeclaration) -> Doc:
        marks = [
            word
            for word, given in (
                ("external", node.external),
                ("observed", node.observed),
                ("unknown", node.three_valued),
            )
            if given
        ]
        spans: list[Span | None] = [node.span]
        for _ in marks:
            spans.append(self._inside(spans[-1]))
        doc = Doc(f"({node.name.text}", self.groups(node.parameters), ")", spans.pop(), filled=True)
        for word in reversed(marks):
            doc = Doc(f"({word}", (doc,), ")", spans.pop(), glued=1)
        return doc

    def function(self, node: ast.FunctionDeclaration) -> Doc:
        last = node.parameters[-1].span.end if node.parameters else node.name.span.end
        # A bare name has no parentheses in the source.
        around = self._parentheses(node.span.start, last, node.span) or node.name.span
        head = Doc(f"({node.name.text}", self.groups(node.parameters), ")", around, filled=True)
        if node.range is not None:
            return Doc("", (head, self.range(node.range, around.end, node.span)), "", node.span, filled=True)
        if not node.types:
            return head
        return Doc("", (head, self.types(node.types, around.end, node.span)), "", node.span, filled=True)

    def range(self, node: ast.NumberRange, after: int, span: Span) -> Doc:
        """``- (int low high)``."""
        dash = self._word("-", after, span) or node.span
        policy = () if node.policy is None else (_leaf(node.policy),)
        kind = Doc("(int", (_number(node.low), _number(node.high), *policy), ")", node.span, glued=3)
        return Doc("-", (kind,), "", Span(span.source, dash.start, node.span.end), glued=1)

    # --- problems ----------------------------------------------------------------------------

    def initial(self, node: ast.InitElement) -> Doc:
        match node:
            case ast.InitAnd():
                return Doc("(and", tuple(map(self.initial, node.parts)), ")", node.span)
            case ast.FluentValue():
                return Doc("(=", (self.fluent(node.fluent), _number(node.value)), ")", node.span, glued=2)
            case ast.InitClause():
                return self.formula(node.formula)
            case ast.Invariant():
                return Doc(f"({node.word}", tuple(map(self.formula, node.parts)), ")", node.span)
            case ast.OneOf(parts) if all(isinstance(part, ast.Assign) for part in parts):
                # Files list hundreds of these: where something is.
                return Doc("(oneof", tuple(map(self.effect, parts)), ")", node.span, rows=True)
            case (
                ast.Assign()
                | ast.EffectForall()
                | ast.Probabilistic()
                | ast.OneOf()
                | ast.Unsupported()
                | ast.Empty()
            ):
                return self.effect(node)
            case _:
                assert_never(node)

    # --- formulas ----------------------------------------------------------------------------

    def formula(self, node: ast.Formula) -> Doc:
        match node:
            case ast.Atom():
                return self.atom(node)
            case ast.Empty():
                return Doc("(", (), ")", node.span)
            case ast.Equality():
                return Doc("(=", (_leaf(node.left), _leaf(node.right)), ")", node.span, glued=2)
            case ast.Comparison():
                numbers = (self.expression(node.left), self.expression(node.right))
                return Doc(f"({node.operator}", numbers, ")", node.span, glued=2)
            case ast.Not():
                return Doc("(not", (self.formula(node.part),), ")", node.span, glued=1)
            case ast.And():
                return Doc("(and", tuple(map(self.formula, node.parts)), ")", node.span)
            case ast.Or():
                return Doc("(or", tuple(map(self.formula, node.parts)), ")", node.span)
            case ast.Imply():
                sides = (self.formula(node.premise), self.formula(node.conclusion))
                return Doc("(imply", sides, ")", node.span, glued=1)
            case ast.Quantified():
                typed = self.parameters(node.parameters, node.span.start + 1, node.span)
                return Doc(f"({node.kind}", (typed, self.formula(node.part)), ")", node.span, glued=1)
            case ast.Test():
                return Doc(f"({node.kind}", (self.formula(node.atom),), ")", node.span, glued=1)
            case ast.Believed():
                parts = (self.formula(node.part), _number(node.at_least))
                return Doc("(believed", parts, ")", node.span, glued=1)
            case ast.Unsupported():
                return self.unsupported(node)
            case _:
                assert_never(node)

    def atom(self, node: ast.Atom) -> Doc:
        """``(p a ?x)``."""
        return Doc(f"({node.predicate.text}", tuple(map(_leaf, node.args)), ")", node.span, filled=True)

    # --- effects -----------------------------------------------------------------------------

    def effect(self, node: ast.Effect) -> Doc:
        match node:
            case ast.Empty():
                return Doc("(", (), ")", node.span)
            case ast.Assign():
                return self.assign(node)
            case ast.EffectAnd():
                return Doc("(and", tuple(map(self.effect, node.parts)), ")", node.span)
            case ast.When():
                return Doc(
                    "(when", (self.formula(node.condition), self.effect(node.effect)), ")", node.span, glued=1
                )
            case ast.EffectForall():
                typed = self.parameters(node.parameters, node.span.start + 1, node.span)
                return Doc("(forall", (typed, self.effect(node.effect)), ")", node.span, glued=1)
            case ast.Probabilistic():
                branches = tuple(map(self.branch, node.branches))
                return Doc("(probabilistic", branches, ")", node.span, broken=len(branches) > 1)
            case ast.OneOf():
                parts = tuple(map(self.effect, node.parts))
                return Doc("(oneof", parts, ")", node.span, broken=len(parts) > 1)
            case ast.FluentEffect():
                parts = (self.fluent(node.fluent), self.expression(node.amount))
                return Doc(f"({node.operator}", parts, ")", node.span, glued=1)
            case ast.Unsupported():
                return self.unsupported(node)
            case _:
                assert_never(node)

    def assign(self, node: ast.Assign) -> Doc:
        atom = self.atom(node.atom)
        match node.value:
            case Truth.TRUE:
                return atom
            case Truth.FALSE:
                return Doc("(not", (atom,), ")", node.span, glued=1)
            case Truth.UNKNOWN:
                return Doc("(unknown", (atom,), ")", node.span, glued=1)
            case _:
                assert_never(node.value)

    def branch(self, node: ast.Branch) -> Doc:
        """``0.5 effect``."""
        return Doc(node.probability.text, (self.effect(node.effect),), "", node.span, glued=1)

    # --- numbers -----------------------------------------------------------------------------

    def fluent(self, node: ast.FluentRef) -> Doc:
        return Doc(f"({node.name.text}", tuple(map(_leaf, node.args)), ")", node.span, filled=True)

    def expression(self, node: ast.NumericExpression) -> Doc:
        match node:
            case ast.Number():
                return _number(node)
            case ast.FluentRef():
                return self.fluent(node)
            case ast.Arithmetic():
                operands = tuple(map(self.expression, node.operands))
                return Doc(f"({node.operator}", operands, ")", node.span, filled=True)
            case _:
                assert_never(node)

    # --- bodies ------------------------------------------------------------------------------

    def body(self, node: ast.Body) -> Doc:
        match node:
            case ast.BodyControl():
                return Doc(f"({node.kind}", tuple(map(self.body, node.children)), ")", node.span)
            case ast.BodyRetry():
                parts = (_number(node.attempts), self.body(node.child))
                return Doc("(retry", parts, ")", node.span, glued=1)
            case ast.BodyCondition():
                return Doc("(condition", (self.formula(node.formula),), ")", node.span, glued=1)
            case ast.BodyCall():
                words = (node.name, *node.args)
                if node.kind is None:
                    return Doc(
                        f"({node.name.text}", tuple(map(_leaf, node.args)), ")", node.span, filled=True
                    )
                return Doc(f"({node.kind}", tuple(map(_leaf, words)), ")", node.span, filled=True)
            case ast.BodyForeach():
                typed = self.parameters(node.parameters, node.span.start + 1, node.span)
                return Doc("(foreach", (typed, self.body(node.child)), ")", node.span, glued=1)
            case _:
                assert_never(node)

    # --- what is refused by name -------------------------------------------------------------

    def unsupported(self, node: ast.Unsupported) -> Doc:
        """The form as it stands in the source, or as the node's text has it."""
        _, start, end = node.span
        text = self._text
        if not text[start:end].strip():
            text, start, end = node.text, 0, len(node.text)
        stack: list[tuple[int, str, list[Doc]]] = []
        opening = -1
        for match in _TOKEN.finditer(text, start, end):
            at, mark = match.start(), match.group()
            if opening >= 0:
                # The first word of a form stands with its parenthesis.
                word = "" if mark in {"(", ")"} else mark
                stack.append((opening, f"({word}", []))
                opening = -1
                if word:
                    continue
            if mark == "(":
                opening = at
                continue
            doc = Doc(mark, span=Span(node.span.source, at, match.end()))
            if mark == ")":
                first, head, items = stack.pop()
                doc = Doc(head, tuple(items), ")", Span(node.span.source, first, match.end()), filled=True)
                if not stack:
                    return doc
            stack[-1][2].append(doc)
        return Doc(node.text, span=node.span)


def _fields(node: _Schema) -> list[tuple[str, Any]]:
    match node:
        case ast.Action():
            tells = f":{node.observe.word}" if isinstance(node.observe, ast.SensingModel) else ":observe"
            observed = (tells, node.observe)
            repeats = (":repeats", node.repeats)
            whole = (":uninterruptible", node.uninterruptible)
            timing = node.timing
            timed = (
                []
                if timing is None
                else [
                    (":duration", timing.duration),
                    (":timeout", timing.timeout),
                    (":timeout-probability", timing.timeout_probability),
                    (":on-timeout", timing.on_timeout),
                ]
            )
            during = [(":while", node.during), (":on-abort", node.on_abort)]
            return [
                (":precondition", node.precondition),
                observed,
                repeats,
                whole,
                (":effect", node.effect),
                *during,
                *timed,
            ]
        case ast.Exogenous():
            when = [(":precondition", node.precondition), (":per", node.per), (":before", node.before)]
            return [*when, (":effect", node.effect)]
        case ast.Template():
            return [(":precondition", node.precondition), (":effect", node.effect), (":body", node.body)]
        case ast.ObservationModel():
            return [(":condition", node.condition), (":distribution", node.distribution)]
        case ast.Sensor():
            return [
                (":condition", node.condition),
                (":sensed :sense", node.sensed),
                (":repeats", node.repeats),
            ]
        case _:
            assert_never(node)


def _in_source_order(fields: list[Doc]) -> tuple[Doc, ...]:
    """The fields as the author ordered them: a comment may refer to what stands before it."""
    return tuple(sorted(fields, key=lambda field: field.span.start if field.span else 0))


def _leaf(node: ast.Term) -> Doc:
    return Doc(node.text, span=node.span)


def _number(node: ast.Number) -> Doc:
    return Doc(node.text, span=node.span)
