"""From what the grammar recognises to syntax nodes: one method per rule of ``grammar/bbtc.lark``.

A method's parameters are the children of its production, in order and with their types: terminals are tokens,
rules are what their methods return, and ``item*`` is a list. A test holds the types to the grammar.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, NamedTuple, TypeAlias

from bbtc.kleene import Truth
from bbtc.source import Span
from bbtc.syntax import ast, leaves
from bbtc.syntax.engine import Token
from bbtc.syntax.expressions import (
    DRAWN,
    Expressions,
    Operand,
    keyword,
    numeric,
    parameters_of,
    seconds,
    unsupported,
)
from bbtc.syntax.fields import (
    Before,
    Body,
    Condition,
    Distribution,
    Duration,
    DurativeCondition,
    DurativeDuration,
    DurativeEffect,
    During,
    Effect,
    Field,
    Fields,
    Implied,
    NumberRange,
    Observe,
    OnAbort,
    OnTimeout,
    Parameters,
    Per,
    Repeats,
    Sensed,
    Timeout,
    TimeoutProbability,
    Types,
    Uninterruptible,
    observed,
    timing_of,
)
from bbtc.syntax.leaves import Misuse

_Predicate: TypeAlias = ast.PredicateDeclaration
_Function: TypeAlias = ast.FunctionDeclaration
InitElements: TypeAlias = list[ast.InitElement | list[ast.InitElement]]
"""Elements of ``:init``; a list is a run of facts."""
_LISTS: Mapping[str, Literal["types", "constants", "objects"]]
_LISTS = {"TYPES": "types", "CONSTANTS": "constants", "OBJECTS": "objects"}
_GOALS: Mapping[str, Literal["goal-probability", "goal-reward"]]
_GOALS = {"GOAL_PROBABILITY": "goal-probability", "GOAL_REWARD": "goal-reward"}
_CONTROLS: Mapping[str, Literal["sequence", "fallback", "skipper"]]
_CONTROLS = {"SEQUENCE": "sequence", "FALLBACK": "fallback", "SKIPPER": "skipper"}


_HOW_LONG = "write `(= ?duration n)`; or use an `:action`, with `:duration (uniform a b)` for one that varies"


class DerivedHead(NamedTuple):
    """``(name params)`` of a derived fact."""

    name: Token
    parameters: ast.TypedList
    close: Token


class Builder(Expressions):
    """Callbacks of the parser, named as the rules and their aliases."""

    # --- files and definitions ---------------------------------------------------------------

    def document(self, definitions: list[ast.Definition]) -> tuple[ast.Definition, ...]:
        return tuple(definitions)

    def definition(
        self, head: Token, name: Token, _: Token, sections: list[ast.Section], close: Token
    ) -> ast.Definition:
        kind: Literal["domain", "problem"] = "domain" if head.kind == "DEFINE_DOMAIN" else "problem"
        return ast.Definition(kind, leaves.name(name), tuple(sections), head.to(close))

    # --- declarations ------------------------------------------------------------------------

    def requirements(self, head: Token, keys: list[Token], close: Token) -> ast.Requirements:
        return ast.Requirements(tuple(map(leaves.name, keys)), head.to(close))

    def typed_section(self, head: Token, entries: ast.TypedList, close: Token) -> ast.TypedSection:
        return ast.TypedSection(_LISTS[head.kind], entries, head.to(close))

    def typed_names(self, groups: list[ast.TypedGroup], *untyped: ast.TypedGroup) -> ast.TypedList:
        """Its fast form is :meth:`names_flat`, for variables :meth:`variables_flat`."""
        return (*groups, *untyped)

    typed_variables = typed_names

    def typed_group(self, runs: list[Token], types: Types) -> ast.TypedGroup:
        group = self.untyped_group(runs)
        span = Span(group.span.source, group.span.start, types.span.end)
        return replace(group, types=types.names, span=span)

    def untyped_group(self, runs: list[Token]) -> ast.TypedGroup:
        names = tuple(term for run in runs for term in leaves.terms(run.text, run.start, run.source))
        return ast.TypedGroup(names, (), runs[0].to(runs[-1]))

    def names_flat(self, token: Token) -> ast.TypedList:
        """The fast form of :meth:`typed_names`."""
        return leaves.groups(token.text, token.start, token.source, variables=False)

    def variable_list(self, _: Token, entries: ast.TypedList, _close: Token) -> ast.TypedList:
        """Its fast form is :meth:`variables_flat`."""
        return entries

    def variables_flat(self, token: Token) -> ast.TypedList:
        """The fast form of :meth:`variable_list`."""
        return leaves.groups(token.text[1:-1], token.start + 1, token.source, variables=True)

    def type(self, dash: Token, name: Token) -> Types:
        return Types((leaves.name(name),), dash.to(name))

    def type_either(self, dash: Token, _: Token, runs: list[Token], close: Token) -> Types:
        if not runs:
            raise Misuse("BBT0101", "`(either)` names no type", dash.to(close))
        return Types(tuple(name for run in runs for name in leaves.names(run)), dash.to(close))

    def predicates(self, head: Token, declarations: list[_Predicate], close: Token) -> ast.Predicates:
        return ast.Predicates(tuple(declarations), head.to(close))

    def predicate(self, head: Token, parameters: ast.TypedList, close: Token) -> _Predicate:
        """Its fast form is :meth:`predicate_flat`."""
        return _predicate(next(leaves.names(head)), parameters, head.to(close))

    def predicate_flat(self, token: Token) -> _Predicate:
        """The fast form of :meth:`predicate`."""
        name = next(leaves.names(token))
        end = name.span.end - token.start
        parameters = leaves.groups(token.text[end:-1], token.start + end, token.source, variables=True)
        return _predicate(name, parameters, token.span)

    def predicate_equal(self, head: Token, parameters: ast.TypedList, close: Token) -> _Predicate:
        name = ast.Name("=", Span(head.source, head.end - 1, head.end))
        if sum(len(group.names) for group in parameters) != 2:
            message, hint = "a predicate cannot be called `=`", "it is built in, of two terms"
            raise Misuse("BBT0228", message, name.span, hint)
        return _predicate(name, parameters, head.to(close))

    def predicate_unknown(
        self, unknown: Token, head: Token, parameters: ast.TypedList, _: Token, close: Token
    ) -> _Predicate:
        return _predicate(next(leaves.names(head)), parameters, unknown.to(close), unknown=True)

    def external(self, head: Token, predicate: _Predicate, close: Token) -> _Predicate:
        return replace(predicate, external=True, span=head.to(close))

    def observed(self, head: Token, predicate: _Predicate, close: Token) -> _Predicate:
        return replace(predicate, observed=True, span=head.to(close))

    def functions(self, head: Token, declarations: list[_Function], close: Token) -> ast.Functions:
        return ast.Functions(tuple(declarations), head.to(close))

    def function(
        self,
        head: Token,
        parameters: ast.TypedList,
        close: Token,
        types: Types | NumberRange | None = None,
    ) -> _Function:
        return _function(next(leaves.names(head)), parameters, head.to(close), types)

    def function_bare(self, name: Token, types: Types | NumberRange | None = None) -> _Function:
        return _function(leaves.name(name), (), name.span, types)

    def number_range(self, dash: Token, head: Token, low: Token, high: Token, *rest: Token) -> NumberRange:
        policy = leaves.name(rest[0]) if len(rest) > 1 else None
        span = head.to(rest[-1])
        given = ast.NumberRange(self.number(low), self.number(high), policy, span)
        return NumberRange(given, dash.to(rest[-1]))

    # --- actions and the like ----------------------------------------------------------------

    def action(self, head: Token, name: Token, given: list[Field[object]], close: Token) -> ast.Action:
        fields = Fields(given)
        return ast.Action(
            leaves.name(name),
            fields.parameters(close),
            fields.get(Condition),
            fields.get(Observe),
            fields.get(Effect),
            head.to(close),
            fields.get(Repeats) is True,
            fields.get(Uninterruptible) is True,
            fields.get(During),
            fields.get(OnAbort),
            timing_of(fields, head.to(close)),
        )

    def exogenous(self, head: Token, name: Token, given: list[Field[object]], close: Token) -> ast.Exogenous:
        fields = Fields(given)
        return ast.Exogenous(
            leaves.name(name),
            fields.parameters(close),
            fields.get(Condition),
            fields.need(Effect, ":effect", "the event", name),
            fields.get(Per),
            fields.get(Before),
            head.to(close),
        )

    def template(self, head: Token, name: Token, given: list[Field[object]], close: Token) -> ast.Template:
        fields = Fields(given)
        return ast.Template(
            leaves.declared("template", leaves.name(name)),
            fields.parameters(close),
            fields.get(Condition),
            fields.get(Effect),
            fields.need(Body, ":body", "the template", name),
            head.to(close),
        )

    def sensor(self, head: Token, name: Token, given: list[Field[object]], close: Token) -> ast.Sensor:
        fields = Fields(given)
        return ast.Sensor(
            leaves.name(name),
            fields.parameters(close),
            fields.get(Condition),
            fields.need(Sensed, ":sensed", "the sensor", name),
            head.to(close),
            fields.get(Repeats) is True,
        )

    def axiom(self, head: Token, given: list[Field[object]], close: Token) -> ast.Derived:
        fields = Fields(given)
        implied = fields.need(Implied, ":implies", "the axiom", head)
        parts = implied.parts if isinstance(implied, ast.And) else (implied,)
        heads = [part for part in parts if isinstance(part, ast.Atom)]
        if not heads or len(heads) < len(parts):
            message = "an axiom derives an atom `(p ?x)`, or an `and` of atoms"
            raise Misuse("BBT0101", message, implied.span)
        return ast.Derived(
            "axiom",
            fields.parameters(close),
            heads[0],
            fields.need(Condition, ":context", "the axiom", head),
            head.to(close),
            None,
            tuple(heads[1:]),
        )

    def axiom_named(self, head: Token, name: Token, given: list[Field[object]], close: Token) -> ast.Derived:
        return replace(self.axiom(head, given, close), label=leaves.name(name))

    parameters = axiom_parameters = Parameters
    precondition = sensor_condition = axiom_context = Condition
    effect = Effect
    template_body = Body
    axiom_head = Implied
    on_timeout = OnTimeout
    during = During
    on_abort = OnAbort

    def per(self, keyword: Token, name: Token) -> Per:
        return Per(keyword, leaves.name(name))

    def before(self, keyword: Token, names: Token) -> Before:
        return Before(keyword, tuple(leaves.names(names)))

    def repeats(self, keyword: Token) -> Repeats:
        return Repeats(keyword, True)

    def uninterruptible(self, keyword: Token) -> Uninterruptible:
        return Uninterruptible(keyword, True)

    def durative_action(
        self, head: Token, name: Token, given: list[Field[object]], close: Token
    ) -> ast.DurativeAction:
        fields = Fields(given)
        return ast.DurativeAction(
            leaves.name(name),
            fields.parameters(close),
            fields.need(DurativeDuration, ":duration", "the durative action", name),
            fields.get(DurativeCondition),
            fields.get(DurativeEffect),
            head.to(close),
        )

    durative_condition = DurativeCondition
    durative_effect = DurativeEffect

    def durative_duration(
        self, keyword: Token, _: Token, variable: Token, operand: Operand, _close: Token
    ) -> DurativeDuration:
        if variable.text.lower() != "?duration":
            raise Misuse("BBT0101", "a duration is given as `(= ?duration n)`", variable.span)
        return DurativeDuration(keyword, seconds(keyword, operand))

    def duration_open(self, _: Token, empty: Token) -> DurativeDuration:
        raise Misuse("BBT0449", "an action that takes any time is not supported", empty.span, _HOW_LONG)

    def duration_bounded(self, _: Token, head: Token, _forms: list[None], close: Token) -> DurativeDuration:
        raise Misuse(
            "BBT0449", "a duration that the planner chooses is not supported", head.to(close), _HOW_LONG
        )

    def duration(self, keyword: Token, operand: Operand) -> Duration:
        expression = seconds(keyword, operand)
        return Duration(keyword, ast.Duration("number", (expression,), (), expression.span))

    def duration_drawn(self, field: Token, head: Token, operands: list[Operand], close: Token) -> Duration:
        word = keyword(head)
        kind, wanted = DRAWN[word]
        if len(operands) != len(wanted):
            message = f"`{word}` takes {len(wanted)} numbers: `({word} {' '.join(wanted)})`"
            raise Misuse("BBT0443", message, head.to(close))
        amounts = tuple(seconds(head, operand) for operand in operands)
        return Duration(field, ast.Duration(kind, amounts, (), head.to(close)))

    def duration_empirical(
        self,
        keyword: Token,
        head: Token,
        points: list[tuple[ast.NumericExpression, ast.Number]],
        close: Token,
    ) -> Duration:
        amounts, weights = tuple(each for each, _ in points), tuple(weight for _, weight in points)
        return Duration(keyword, ast.Duration("empirical", amounts, weights, head.to(close)))

    def duration_point(
        self, head: Token, operand: Operand, number: Token, _: Token
    ) -> tuple[ast.NumericExpression, ast.Number]:
        return seconds(head, operand), self.number(number)

    def timeout(self, keyword: Token, operand: Operand) -> Timeout:
        return Timeout(keyword, seconds(keyword, operand))

    def timeout_probability(self, keyword: Token, number: Token) -> TimeoutProbability:
        return TimeoutProbability(keyword, self.number(number))

    def observe(self, keyword: Token, formulas: list[ast.Formula]) -> Observe:
        return Observe(keyword, observed(formulas))

    def sensed(self, keyword: Token, formulas: list[ast.Formula]) -> Sensed:
        return Sensed(keyword, observed(formulas))

    def sensed_noisy(self, keyword: Token, content: ast.Probabilistic) -> Sensed:
        return Sensed(keyword, ast.Observation(content, content.span))

    def observe_noisy(self, keyword: Token, content: ast.Probabilistic) -> Observe:
        return Observe(keyword, ast.Observation(content, content.span))

    def observe_agent(self, keyword: Token, _agent: Token, _formula: ast.Formula) -> Observe:
        message = "`:observe-agent`, an observation by one of several agents, is not supported"
        raise Misuse("BBT0212", message, keyword.span)

    def sensing_model(self, keyword: Token, effect: ast.Effect) -> Observe:
        word: Literal["sensing-model", "observation"]
        word = "observation" if keyword.kind == "OBSERVATION" else "sensing-model"
        return Observe(keyword, ast.SensingModel(effect, effect.span, word))

    derived_head = DerivedHead

    def derived(self, form: Token, head: DerivedHead, condition: ast.Formula, close: Token) -> ast.Derived:
        parameters = parameters_of(head.parameters, close)
        args = tuple(name for group in parameters for name in group.names)
        name = leaves.declared("predicate", next(leaves.names(head.name)))
        atom = ast.Atom(name, args, head.name.to(head.close))
        return ast.Derived("derived", parameters, atom, condition, form.to(close))

    # --- forms of K-replanner ----------------------------------------------------------------

    def state_variable(
        self, head: Token, name: Token, values: list[ast.Formula], close: Token
    ) -> ast.StateVariable:
        return _state_variable(head, leaves.name(name), None, values, close)

    def state_variables(
        self, head: Token, named: DerivedHead, values: list[ast.Formula], close: Token
    ) -> ast.StateVariable:
        name = next(leaves.names(named.name))
        return _state_variable(head, name, parameters_of(named.parameters, close), values, close)

    def told_always(self, head: Token, values: list[ast.Formula], close: Token) -> ast.AtomList:
        kind: Literal["observable", "sticky"] = "observable" if head.kind == "OBSERVABLE" else "sticky"
        return ast.AtomList(kind, _values(values), head.to(close))

    def default_sensing(self, head: Token, effect: ast.Effect, close: Token) -> ast.DefaultSensing:
        return ast.DefaultSensing(effect, head.to(close))

    # --- forms of PO-PDDL, and of the competition of 2011 ------------------------------------

    def observables(self, head: Token, declarations: list[_Predicate], close: Token) -> ast.Observables:
        kind: Literal["observables", "observations"]
        kind = "observables" if keyword(head) == ":observables" else "observations"
        return ast.Observables(kind, tuple(declarations), head.to(close))

    distribution = Distribution

    def branches(self, keyword: Token, _formula: ast.Formula) -> Distribution:
        message = "`:branches`, in which a translation lists what may be observed, is not supported"
        raise Misuse("BBT0212", message, keyword.span, "give the file that was translated")

    def observation(
        self, head: Token, name: Token, given: list[Field[object]], close: Token
    ) -> ast.ObservationModel:
        fields = Fields(given)
        return ast.ObservationModel(
            leaves.name(name),
            fields.parameters(close),
            fields.get(Condition),
            fields.need(Distribution, ":distribution", "the observation", name),
            head.to(close),
        )

    def init_belief(
        self, head: Token, elements: list[ast.FactBelief | ast.JointBelief], close: Token
    ) -> ast.InitBelief:
        return ast.InitBelief(tuple(elements), head.to(close))

    def fact_belief(self, head: Token, atom: ast.Atom, number: Token, close: Token) -> ast.FactBelief:
        return ast.FactBelief(atom, self.number(number), head.to(close))

    def joint_belief(
        self, head: Token, number: Token, condition: ast.Formula, close: Token
    ) -> ast.JointBelief:
        return ast.JointBelief(self.number(number), condition, head.to(close))

    # --- problems ----------------------------------------------------------------------------

    def domain_reference(self, head: Token, name: Token, close: Token) -> ast.DomainReference:
        return ast.DomainReference(leaves.name(name), head.to(close))

    facts = staticmethod(leaves.facts)

    def init(self, head: Token, elements: InitElements, close: Token) -> ast.Init:
        return ast.Init(_spliced(elements), head.to(close))

    def hidden(self, head: Token, elements: InitElements, close: Token) -> ast.Hidden:
        facts: list[ast.Assign] = []
        for fact in _spliced(elements):
            if not isinstance(fact, ast.Assign):
                hint = "each is `(p a)` or `(not (p a))`; numbers and what is uncertain stand in `:init`"
                raise Misuse("BBT0101", "`:hidden` holds facts only", fact.span, hint)
            facts.append(fact)
        return ast.Hidden(tuple(facts), head.to(close))

    def goal(self, head: Token, formula: ast.Formula, close: Token) -> ast.Goal:
        return ast.Goal(formula, head.to(close))

    def goal_empty(self, head: Token, close: Token) -> ast.Goal:
        return self.goal(head, ast.Empty(head.to(close)), close)

    def goal_number(self, head: Token, number: Token, close: Token) -> ast.GoalNumber:
        return ast.GoalNumber(_GOALS[head.kind], self.number(number), head.to(close))

    def metric(self, head: Token, direction: Token, operand: Operand, close: Token) -> ast.Metric:
        expression = numeric(operand)
        if expression is None:
            raise Misuse("BBT0101", "the metric is no numeric expression", head.to(close))
        least = direction.text.lower() == "minimize"
        return ast.Metric("minimize" if least else "maximize", expression, head.to(close))

    def fluent_value(
        self, head: Token, left: Operand, right: Operand, close: Token
    ) -> ast.FluentValue | ast.Unsupported:
        """Its fast form is part of :meth:`facts`."""
        fluent = numeric(left)
        if isinstance(fluent, ast.FluentRef) and isinstance(right, ast.Number):
            return ast.FluentValue(fluent, right, head.to(close))
        return unsupported("object fluent", head, close)

    def init_and(self, head: Token, elements: InitElements, close: Token) -> ast.InitAnd:
        return ast.InitAnd(_spliced(elements), head.to(close))

    def init_or(self, head: Token, parts: list[ast.Formula], close: Token) -> ast.InitClause:
        return ast.InitClause(self.disjunction(head, parts, close), head.to(close))

    def init_imply(self, head: Token, left: ast.Formula, right: ast.Formula, close: Token) -> ast.InitClause:
        return ast.InitClause(self.implication(head, left, right, close), head.to(close))

    def init_not(self, head: Token, part: ast.Formula, close: Token) -> ast.InitClause | ast.Assign:
        if isinstance(part, ast.Atom):
            return leaves.assign(part, Truth.FALSE, head.to(close))
        return ast.InitClause(self.negation(head, part, close), head.to(close))

    def invariant(self, head: Token, parts: list[ast.Formula], close: Token) -> ast.Invariant:
        word: Literal["invariant", "at-least-one"]
        word = "invariant" if keyword(head) == "invariant" else "at-least-one"
        return ast.Invariant(tuple(parts), head.to(close), word)

    def timed_literal(self, head: Token, _forms: list[None], close: Token) -> ast.Unsupported:
        return unsupported("timed initial literal", head, close)

    # --- bodies ------------------------------------------------------------------------------

    def body_control(self, head: Token, children: list[ast.Body], close: Token) -> ast.BodyControl:
        return ast.BodyControl(_CONTROLS[head.kind], tuple(children), head.to(close))

    def body_retry(self, head: Token, number: Token, child: ast.Body, close: Token) -> ast.BodyRetry:
        return ast.BodyRetry(self.number(number), child, head.to(close))

    def body_timeout(self, head: Token, _number: Token, _child: ast.Body, close: Token) -> ast.Body:
        message = "a time limit on a part of a body is not supported"
        hint = "give the action one: `:timeout`, which every tree keeps"
        raise Misuse("BBT0450", message, head.to(close), hint)

    def body_condition(self, head: Token, formula: ast.Formula, close: Token) -> ast.BodyCondition:
        return ast.BodyCondition(formula, head.to(close))

    def body_foreach(
        self, head: Token, parameters: ast.TypedList, child: ast.Body, close: Token
    ) -> ast.BodyForeach:
        return ast.BodyForeach(parameters_of(parameters, close), child, head.to(close))

    def body_action(self, head: Token, name: Token, args: list[Token], close: Token) -> ast.BodyCall:
        return ast.BodyCall("action", leaves.name(name), tuple(map(self.term, args)), head.to(close))

    def body_call(self, token: Token) -> ast.BodyCall:
        atom = leaves.flat(token)
        return ast.BodyCall(None, atom.predicate, atom.args, atom.span)

    # --- what is refused by name -------------------------------------------------------------

    def unsupported_section(self, head: Token, _forms: list[None], close: Token) -> ast.Unsupported:
        return unsupported(keyword(head), head, close)


def _state_variable(
    head: Token, name: ast.Name, parameters: ast.TypedList | None, values: list[ast.Formula], close: Token
) -> ast.StateVariable:
    kind: Literal["variable", "obs-variable"]
    kind = "variable" if keyword(head) == ":variable" else "obs-variable"
    return ast.StateVariable(kind, name, parameters, _values(values), head.to(close))


def _values(values: list[ast.Formula]) -> tuple[ast.Formula, ...]:
    for value in values:
        inner = value
        while isinstance(inner, ast.Quantified) and inner.kind == "forall":
            inner = inner.part
        if not isinstance(inner, ast.Atom):
            message = "each is an atom `(p a)`, or `(forall (?x - t) (p ?x))`"
            raise Misuse("BBT0101", message, value.span)
    return tuple(values)


def _predicate(name: ast.Name, parameters: ast.TypedList, span: Span, unknown: bool = False) -> _Predicate:
    return ast.PredicateDeclaration(leaves.declared("predicate", name), parameters, unknown, span)


def _function(
    name: ast.Name, parameters: ast.TypedList, span: Span, types: Types | NumberRange | None
) -> _Function:
    declared = leaves.declared("function", name)
    if types is None:
        return ast.FunctionDeclaration(declared, parameters, (), span)
    whole = Span(span.source, span.start, types.span.end)
    if isinstance(types, NumberRange):
        return ast.FunctionDeclaration(declared, parameters, (), whole, types.range)
    return ast.FunctionDeclaration(declared, parameters, types.names, whole)


def _spliced(elements: InitElements) -> tuple[ast.InitElement, ...]:
    """Elements in one tuple, runs of facts laid open."""
    found: list[ast.InitElement] = []
    for element in elements:
        found.extend(element if isinstance(element, list) else [element])
    return tuple(found)
