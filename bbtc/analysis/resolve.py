"""From syntax trees to the model: every name bound once, all errors reported."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.analysis import bodies, exogenous, facts, formulas, po_pddl, replanner, truth_words
from bbtc.analysis.declare import GOAL_FLUENTS, declare, sections, weighted
from bbtc.analysis.durative import with_sequential
from bbtc.analysis.initial import initial
from bbtc.analysis.names import Names, Signature
from bbtc.analysis.timing import timed
from bbtc.diagnostics import Related, Report
from bbtc.kleene import Truth
from bbtc.markov import reachable
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.types import Parameter
from bbtc.source import Span
from bbtc.syntax import ast

_PROBLEM_ONLY = (
    ast.Init,
    ast.InitBelief,
    ast.Goal,
    ast.GoalNumber,
    ast.Metric,
    ast.DomainReference,
    ast.Hidden,
)
_LISTS = (ast.Requirements, ast.TypedSection, ast.Predicates, ast.Functions)
_SEVERAL = (
    *(ast.Action, ast.Exogenous, ast.Derived, ast.Sensor, ast.Template, ast.Hidden),
    *(ast.StateVariable, ast.AtomList, ast.ObservationModel),
)
"""What a definition has several of; of everything else one section is enough."""
_DOMAIN_ONLY = (
    *(ast.Predicates, ast.Functions, ast.Action, ast.Exogenous, ast.Derived, ast.Sensor, ast.Template),
    *(ast.StateVariable, ast.AtomList, ast.DefaultSensing, ast.Observables, ast.ObservationModel),
)


def resolve(
    domain: ast.Definition, problem: ast.Definition | None, report: Report, *, lenient: bool = False
) -> md.Model | None:
    """The model of a domain, with a problem or alone (to check it); ``lenient`` as in
    :class:`bbtc.source.Reading`.

    Errors go to ``report``, all of them; the result is None if it holds any. Probabilities whose
    sum differs from 1 by at most 1e-9 are taken as rounded and divided by their sum; a smaller sum
    gets an explicit no-change branch.
    """
    domain = with_sequential(domain, problem, report)
    definitions = (domain,) if problem is None else (domain, problem)
    names = Names(report, definitions=definitions, lenient=lenient)
    _check_sections(report, domain, problem)
    declare(names, domain, problem)
    variables = replanner.variables(names, domain)
    sensing = next(sections(domain, ast.DefaultSensing), None)
    told = po_pddl.of_domain(names, domain)
    shared = {} if sensing is None else _default_sensing(names, sensing)
    schemas: dict[str, md.Schema] = {}
    for signature, action in zip(names.actions.values(), sections(domain, ast.Action), strict=True):
        names.section = f"action {signature.name}"
        made = _schema(names, signature, action)
        made = replace(made, effect=replanner.one_value(variables, made.effect))
        if names.per_action:
            each = me.Add("cost", me.Constant(names.per_action), span=action.span)
            made = replace(made, effect=me.Together((made.effect, each)))
        if sensing is not None and action.observe is None:
            made = replace(made, observe=replanner.told(shared, sensing.span), observe_span=sensing.span)
        schemas[signature.name] = replace(made, told=(*made.told, *told))
    for event in exogenous.events(names, domain):
        schemas[event.name] = replace(event, effect=replanner.one_value(variables, event.effect))
    rules = tuple(rule for node in sections(domain, ast.Derived) for rule in _rules(names, node))
    if sensing is not None:
        rules = (*rules, *replanner.derived(names, shared, sensing.span))
    for sticky in replanner.sticky(names, domain):
        rules = (*rules, sticky.rule)
        for key, schema in schemas.items():
            schemas[key] = replace(schema, effect=me.Together((schema.effect, sticky.effect)))
    _check_stratified(names, rules)
    sensors = (
        *(_sensor(names, node) for node in sections(domain, ast.Sensor)),
        *replanner.always_told(names, domain),
    )
    templates: dict[str, md.Template] = {}
    for node in sections(domain, ast.Template):
        names.section = f"template {node.name.key}"
        templates.setdefault(node.name.key, bodies.template(names, node))
    bodies.check_templates(report, templates)
    requirements = {
        key.key: key.span for section in sections(domain, ast.Requirements) for key in section.keys
    }
    model = md.Model(
        domain=domain.name.key,
        problem=None,
        types=names.hierarchy,
        objects=names.objects,
        predicates=names.predicates,
        functions=names.functions,
        schemas=schemas,
        rules=rules,
        sensors=sensors,
        templates=templates,
        init=md.Init(),
        goal=None,
        counts_cost=_counts_cost(names, schemas),
        symbols=tuple(sorted(replanner.symbols(names, domain) | _observables(domain))),
        requirements=requirements,
        span=domain.name.span,
    )
    if problem is not None:
        model = _with_problem(names, model, domain, problem)
        model = replace(model, init=replanner.completed(names, variables, model.init))
    definitions = (domain,) if problem is None else (domain, problem)
    model = replace(model, may_fail=po_pddl.is_po_pddl(*definitions))
    names.finish()
    model = replace(
        model, types=names.hierarchy, predicates=_three_valued(model), thresholds=names.thresholds
    )
    return None if report.errors else model


_INSTEAD = dict.fromkeys(
    (":percepts", ":observe"),
    "DT-PDDL collects rewards; with a goal to reach, say what an action tells in the action: "
    "`:observe (probabilistic q (p))`",
)
"""By construct that is refused: what to write in its place."""


def _check_sections(report: Report, domain: ast.Definition, problem: ast.Definition | None) -> None:
    """Refuse constructs by name, sections in the wrong definition, and second goals."""
    for definition in (domain, problem) if problem is not None else (domain,):
        wrong = _PROBLEM_ONLY if definition.kind == "domain" else _DOMAIN_ONLY
        other = "problem" if definition.kind == "domain" else "domain"
        seen: dict[str, ast.Section] = {}
        for section in definition.sections:
            if isinstance(section, ast.Unsupported):
                hint = _INSTEAD.get(
                    section.construct, "actions take no time here, and numbers are costs and rewards"
                )
                report.error("BBT0212", f"`{section.construct}` is not supported", section.span, hint)
            elif isinstance(section, wrong) or (
                isinstance(section, ast.TypedSection) and section.kind == "types" and other == "domain"
            ):
                report.error("BBT0221", f"this section belongs in a {other}", section.span)
            elif not isinstance(section, _SEVERAL):
                kind = _section_name(section)
                first = seen.setdefault(kind, section)
                if first is not section:
                    _twice(report, kind, section, first)


def _section_name(section: ast.Section) -> str:
    if isinstance(section, (ast.GoalNumber, ast.TypedSection)):
        return section.kind
    return "domain" if isinstance(section, ast.DomainReference) else type(section).__name__.lower()


def _twice(report: Report, kind: str, section: ast.Section, first: ast.Section) -> None:
    """A second list adds to the first; of two goals or the like, neither is the one that is meant."""
    message, related = f"`:{kind}` is given twice", [Related("first given here", first.span)]
    if isinstance(section, _LISTS):
        hint = "what both of them list is read; one section would say so"
        report.warning("BBT0226", message, section.span, hint, related)
    else:
        report.error("BBT0208", message, section.span, related=related)


# --- the domain ------------------------------------------------------------------------------


def _scope(parameters: tuple[Parameter, ...]) -> dict[str, Parameter]:
    return {parameter.name: parameter for parameter in parameters}


def _schema(names: Names, signature: Signature, node: ast.Action) -> md.Schema:
    scope = _scope(signature.parameters)
    observe: mf.Formula | me.Choice | None = None
    told: tuple[md.Reading, ...] = ()
    match node.observe:
        case ast.SensingModel(word="observation"):
            told = po_pddl.of_action(names, node.observe, scope)
        case ast.SensingModel(effect, span):
            observe = replanner.told(replanner.sensing(names, effect, scope), span)
        case ast.Observation():
            observe = _observed(names, node.observe, scope)
        case None:
            pass
        case _:
            assert_never(node.observe)
    if node.repeats:
        _check_repeats(names, f"action `{signature.name}`", observe, node.name.span)
    precondition = (
        mf.ALWAYS if node.precondition is None else formulas.formula(names, node.precondition, scope)
    )
    during = None if node.during is None else formulas.formula(names, node.during, scope)
    if node.on_abort is not None and during is None:
        message = f"`:on-abort` of action `{signature.name}` says nothing: there is no `:while`"
        names.report.error("BBT0232", message, node.on_abort.span, "nothing ends the action before its end")
    schema = md.Schema(
        signature.name,
        signature.parameters,
        precondition if during is None else mf.And((precondition, during)),
        me.NOTHING if node.effect is None else formulas.effect(names, node.effect, scope),
        observe,
        None if node.observe is None else node.observe.span,
        node.repeats,
        told,
        node.uninterruptible,
        during,
        me.NOTHING if node.on_abort is None else formulas.effect(names, node.on_abort, scope),
        span=node.span,
    )
    return timed(names, schema, node.timing, scope)


def _observables(domain: ast.Definition) -> frozenset[str]:
    return frozenset(
        declared.name.key for node in sections(domain, ast.Observables) for declared in node.declarations
    )


def _observed(names: Names, node: ast.Observation, scope: dict[str, Parameter]) -> mf.Formula | me.Choice:
    if isinstance(node.content, ast.Probabilistic):
        return formulas.noisy_reading(names, node.content, scope)
    return formulas.formula(names, node.content, scope)


def _check_repeats(names: Names, whose: str, observed: mf.Formula | me.Choice | None, span: Span) -> None:
    if not isinstance(observed, me.Choice):
        message = f"`:repeats` of {whose} says nothing: no reading of it may be wrong"
        hint = "it is for noisy readings, written `(probabilistic q (p))`"
        names.report.warning("BBT0419", message, span, hint)


def _default_sensing(names: Names, node: ast.DefaultSensing) -> dict[tuple[str, tuple[str, ...]], mf.Formula]:
    names.section = "default-sensing-model"
    return replanner.sensing(names, node.effect, {})


def _rules(names: Names, node: ast.Derived) -> Iterator[md.Rule]:
    """The rules of a form, one for each atom that it derives."""
    for head in node.heads:
        yield _rule(names, replace(node, head=head, others=()))


def _rule(names: Names, node: ast.Derived) -> md.Rule:
    names.section = f"derived {node.head.predicate.key}"
    # The head's own types bind: parameters of the head are often written without any.
    predicate = names.predicate(node.head.predicate, node.head.args)
    declared = (
        {}
        if predicate is None
        else {
            arg.key: parameter.types
            for arg, parameter in zip(node.head.args, predicate.parameters, strict=False)
            if isinstance(arg, ast.Variable)
        }
    )
    parameters = names.parameters(node.parameters)
    known = {parameter.name for parameter in parameters}
    untyped = {name.key for group in node.parameters if not group.types for name in group.names}
    parameters = tuple(
        replace(p, types=declared.get(p.name, p.types)) if p.name in untyped else p for p in parameters
    ) + tuple(
        Parameter(arg.key, declared[arg.key], arg.span)
        for arg in dict.fromkeys(node.head.args)
        if isinstance(arg, ast.Variable) and arg.key not in known and arg.key in declared
    )
    scope = _scope(parameters)
    head = formulas.atom(names, node.head, scope)
    condition = formulas.formula(names, node.condition, scope)
    args = () if head is None else head.args
    return md.Rule(node.head.predicate.key, args, parameters, condition, node.span)


def _check_stratified(names: Names, rules: tuple[md.Rule, ...]) -> None:
    """A derived predicate may depend on itself, but not on its own negation (or a test of it)."""
    reads: dict[str, dict[str, bool]] = {}
    for rule in rules:
        for reading in mf.readings(rule.condition):
            below, predicate = reads.setdefault(rule.predicate, {}), reading.atom.predicate
            below[predicate] = below.get(predicate, False) or reading.value is not Truth.TRUE
    told: set[str] = set()
    for rule in rules:
        for predicate, negative in reads.get(rule.predicate, {}).items():
            if negative and rule.predicate not in told and rule.predicate in _below(predicate, reads):
                told.add(rule.predicate)
                names.report.error(
                    "BBT0222",
                    f"the derived predicate `{rule.predicate}` depends on its own negation",
                    rule.span,
                    f"the negative condition is on `{predicate}`",
                )


def _below(start: str, reads: dict[str, dict[str, bool]]) -> set[str]:
    return reachable([start], lambda predicate: reads.get(predicate, ()))


def _sensor(names: Names, node: ast.Sensor) -> md.Sensor:
    names.section = f"sensor {node.name.key}"
    parameters = names.parameters(node.parameters)
    scope = _scope(parameters)
    condition = mf.ALWAYS if node.condition is None else formulas.formula(names, node.condition, scope)
    sensed = _observed(names, node.sensed, scope)
    if node.repeats:
        _check_repeats(names, f"sensor `{node.name.key}`", sensed, node.name.span)
    return md.Sensor(node.name.key, parameters, condition, sensed, node.repeats, node.span)


def _counts_cost(names: Names, schemas: dict[str, md.Schema]) -> bool:
    if not (names.costs & names.counted).isdisjoint(names.functions):
        return True
    added = (leaf for schema in schemas.values() for leaf in me.leaves(schema.effects))
    return any(isinstance(leaf, me.Add) and leaf.to == "cost" for leaf in added)


def _three_valued(model: md.Model) -> dict[str, md.Predicate]:
    """Mark the predicates that something makes unknown, derived ones through what they read."""
    unknown: dict[str, None] = {}
    effects = [schema.effects for schema in model.schemas.values()] + list(model.init.choices)
    for effect in effects:
        for leaf in me.leaves(effect):
            if isinstance(leaf, me.Set) and leaf.value is Truth.UNKNOWN:
                unknown[leaf.predicate] = None
    unknown.update((fact.predicate, None) for fact in model.init.facts if fact.value is Truth.UNKNOWN)
    grown = True
    while grown:
        grown = False
        for rule in model.rules:
            if rule.predicate not in unknown and any(
                predicate in unknown for predicate in facts.plain(rule.condition)
            ):
                unknown[rule.predicate] = None
                grown = True
    return {
        key: replace(predicate, three_valued=key in unknown or predicate.declared_three_valued)
        for key, predicate in model.predicates.items()
    }


# --- the problem -----------------------------------------------------------------------------


def _with_problem(names: Names, model: md.Model, domain: ast.Definition, problem: ast.Definition) -> md.Model:
    report = names.report
    for reference in sections(problem, ast.DomainReference):
        if reference.name.key != domain.name.key:
            report.warning(
                "BBT0217",
                f"the problem is for domain `{reference.name.text}`, not `{domain.name.text}`",
                reference.name.span,
                related=[Related("the domain given with it", domain.name.span)],
            )
    names.section, names.in_problem = "init", True
    init = initial(names, list(sections(problem, ast.Init)))
    beliefs = list(sections(problem, ast.InitBelief))
    true_worlds = [tuple(_said(names, hidden.facts)) for hidden in sections(problem, ast.Hidden)]
    if beliefs:
        true_worlds += [init.facts] * bool(init.facts)
        init = po_pddl.believed(names, beliefs, init)
    goal, goal_span = _goal(names, model, problem)
    probability, reward = Fraction(1), Fraction(0)
    for number in sections(problem, ast.GoalNumber):
        value = number.value.value
        if number.kind == "goal-reward":
            reward = value
        elif not 0 < value <= 1:
            report.error(
                "BBT0214",
                f"the goal probability {number.value.text} is outside (0, 1]",
                number.value.span,
                formulas.percentage(value),
            )
        else:
            probability = value
    metric = next(sections(problem, ast.Metric), None)
    if metric is not None:
        _check_metric(names, metric)
    return replace(
        model,
        problem=problem.name.key,
        init=init,
        true_worlds=tuple(true_worlds),
        goal=goal,
        goal_span=goal_span,
        goal_probability=probability,
        goal_reward=reward,
        metric="cost" if metric is None or not _is_reward(names, metric) else "reward",
        problem_span=problem.name.span,
    )


def _said(names: Names, facts: Iterable[ast.Assign]) -> Iterator[md.InitialFact]:
    """What ``:hidden`` says of ground atoms."""
    for fact in facts:
        assigned = truth_words.assigned(names, fact)
        atom = None if assigned is None else formulas.atom(names, assigned.atom, {})
        if assigned is not None and atom is not None:
            yield md.InitialFact(atom.predicate, atom.args, assigned.value, fact.span)


def _goal(names: Names, model: md.Model, problem: ast.Definition) -> tuple[mf.Formula | None, Span | None]:
    names.section = "goal"
    goal = next(sections(problem, ast.Goal), None)
    if goal is not None:
        return _goal_formula(names, model, goal.formula), goal.formula.span
    if next(sections(problem, ast.Metric), None) is None and not any(
        isinstance(section, ast.Unsupported) for section in problem.sections
    ):
        names.report.error("BBT0213", f"problem `{problem.name.text}` has no `:goal`", problem.name.span)
    return None, None


def _goal_formula(names: Names, model: md.Model, node: ast.Formula) -> mf.Formula:
    """The goal; ``(action name args…)`` in it stands for the preconditions of that action."""
    if isinstance(node, ast.And):
        return mf.And(tuple(_goal_formula(names, model, part) for part in node.parts), node.span)
    if isinstance(node, ast.Atom) and node.predicate.key == "action" and "action" not in names.predicates:
        if not node.args:
            names.report.error("BBT0206", "`action` in a goal needs the name of an action", node.span)
            return mf.ALWAYS
        name, args = node.args[0], node.args[1:]
        signature = names.actions.get(name.key)
        if signature is None or name.key not in model.schemas:
            names.unknown("BBT0205", "action", name, names.actions)
            return mf.ALWAYS
        found = names.arguments("action", ast.Name(name.text, name.span), signature, args, {}, span=node.span)
        if found is None:
            return mf.ALWAYS
        binding = {p.name: arg for p, arg in zip(signature.parameters, found, strict=True)}
        return mf.substitute(model.schemas[name.key].precondition, binding)
    return formulas.formula(names, node, {})


def _is_reward(names: Names, metric: ast.Metric) -> bool:
    fluent = metric.expression
    return (
        metric.direction == "maximize"
        and isinstance(fluent, ast.FluentRef)
        and (fluent.name.key not in GOAL_FLUENTS or fluent.name.key in names.functions)
    )


_COUNTED = frozenset({"total-cost", "total-time"})


def _check_metric(names: Names, metric: ast.Metric) -> None:
    """Refuse a metric that is not what is counted."""
    expression, minimise = metric.expression, metric.direction == "minimize"
    hint = "a metric names one fluent: `(:metric minimize (total-cost))`, `(:metric maximize (reward))`"
    if isinstance(expression, ast.FluentRef) and not expression.args:
        key, declared = expression.name.key, expression.name.key in names.functions
        if not declared and (key == "total-time" if minimise else key in GOAL_FLUENTS):
            return
        if not declared and key in GOAL_FLUENTS:
            hint = "the goal's probability can only be maximised"
        elif not declared and key == "total-time":
            hint = "the number of actions can be minimised: `(:metric minimize (total-time))`"
        elif key in (names.costs if minimise else names.rewards):
            if not declared and key not in ("total-cost", "reward"):
                names.unknown("BBT0220", "function", expression.name, names.functions)
            return
    elif minimise and (terms := weighted(expression, names.rewards)) is not None:
        unknown = [key for key in terms if key not in names.functions and key not in _COUNTED]
        if not unknown:
            return
        hint = f"`{unknown[0]}` is no function; declared: {', '.join(names.functions) or 'none'}"
    names.report.error("BBT0212", "this metric is not supported", metric.span, hint)
