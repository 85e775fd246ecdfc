"""First pass of name resolution: everything that sections declare."""

from __future__ import annotations

from collections.abc import Container, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import TypeVar

from bbtc.analysis.names import Declared, Names, Signature
from bbtc.diagnostics import Related, Report
from bbtc.model.domain import Function, NumberRange, Predicate
from bbtc.model.types import OBJECT, Object, Type, TypeHierarchy
from bbtc.source import Span
from bbtc.syntax import ast

S = TypeVar("S", bound=ast.Section)


def sections(definition: ast.Definition, kind: type[S]) -> Iterator[S]:
    """The sections of one kind, in source order."""
    return (section for section in definition.sections if isinstance(section, kind))


GOAL_FLUENTS = frozenset({"goal-probability", "goal-achieved"})
"""What a metric may maximise besides a reward: every plan is made for it anyway."""


def declare(names: Names, domain: ast.Definition, problem: ast.Definition | None) -> None:
    """Fill ``names`` with the declarations of both definitions."""
    names.hierarchy = _types(names, domain)
    names.derived = frozenset(
        head.predicate.key for rule in sections(domain, ast.Derived) for head in rule.heads
    )
    for definition in (domain, problem) if problem is not None else (domain,):
        for section in sections(definition, ast.TypedSection):
            if section.kind != "types":
                _objects(names, section)
    _predicates(names, domain)
    _functions(names, domain)
    _fluents(names, problem)
    _actions(names, list(sections(domain, ast.Action)))
    _events(names, domain)
    for template in sections(domain, ast.Template):
        names.section = f"template {template.name.key}"
        signature = _signature(names, template)
        before = names.templates.setdefault(template.name.key, signature)
        if before is not signature:
            twice(names.report, "template", template.name, before)
        first = names.actions.get(template.name.key)
        if first is not None:
            twice(
                names.report, "template", template.name, names.actions[template.name.key], other="an action"
            )


def twice(
    report: Report,
    kind: str,
    name: ast.Term,
    first: Declared,
    *,
    other: str = "",
    hint: str | None = None,
    harmless: bool = False,
) -> None:
    """Report a name declared before; only a warning where that does no harm."""
    clash = f"{kind} `{name.text}` " + (f"has the name of {other}" if other else "is declared twice")
    add = report.warning if harmless else report.error
    add("BBT0208", clash, name.span, hint, [Related("first declared here", first.span)])


# --- types -----------------------------------------------------------------------------------


def _types(names: Names, domain: ast.Definition) -> TypeHierarchy:
    found: dict[str, Type] = {}
    parents: dict[str, dict[str, ast.Name]] = {}
    lists = [section for section in sections(domain, ast.TypedSection) if section.kind == "types"]
    known = {OBJECT, *(kind.key for section in lists for group in section.entries for kind in group.types)}
    for section in lists:
        for group in _with_spaces(section.entries, known):
            for name in group.names:
                found.setdefault(name.key, Type(name.key, (), name.span))
                above = parents.setdefault(name.key, {})
                for parent in group.types:
                    if parent.key != name.key:
                        above[parent.key] = parent
                    elif name.key != OBJECT:
                        _refuse_own_parent(names, group, name)
    # A supertype need not be declared itself: `car - vehicle` is read as declaring both.
    for above in list(parents.values()):
        for key, parent in above.items():
            found.setdefault(key, Type(key, (), parent.span))
    found[OBJECT] = Type(OBJECT, (), found[OBJECT].span if OBJECT in found else None)
    parents[OBJECT] = {}
    _refuse_cycles(names, parents, found)
    return TypeHierarchy(
        {key: Type(key, tuple(parents.get(key, ())), type_.span) for key, type_ in found.items()}
    )


def _refuse_own_parent(names: Names, group: ast.TypedGroup, name: ast.Term) -> None:
    others = ", ".join(f"`{each.text}`" for each in group.names if each is not name)
    names.report.error(
        "BBT0209",
        f"type `{name.text}` is its own supertype: {name.text} - {name.text}",
        name.span,
        "every name before the `-` gets the type after it"
        + (f": if only {others} should, put `{name.text}` behind them" if others else ""),
    )


def _refuse_cycles(names: Names, parents: dict[str, dict[str, ast.Name]], found: dict[str, Type]) -> None:
    """Report each cycle of supertypes once and cut it."""
    done: set[str] = set()
    for start in list(parents):
        path: dict[str, Iterator[str]] = {}
        todo = [] if start in done else [start]
        while todo:
            key = todo[-1]
            if key not in path:
                path[key] = iter(list(parents.get(key, ())))
            step = next(path[key], None)
            if step is None:
                done.add(key)
                del path[key]
                todo.pop()
            elif step in path:
                round_trip = [*list(path)[list(path).index(step) :], step]
                names.report.error(
                    "BBT0209",
                    f"type `{step}` is its own supertype: {' - '.join(round_trip)}",
                    parents[key][step].span,
                    related=[Related(f"`{step}` is declared here", found[step].span)],
                )
                del parents[key][step]
            elif step not in done:
                todo.append(step)


# --- objects, predicates, functions -----------------------------------------------------------


def _with_spaces(entries: ast.TypedList, types: Container[str]) -> Iterator[ast.TypedGroup]:
    """The groups of a list of names in which a hyphen may lack a space: `a -room` and `a- room`, where
    ``room`` is a type, are `a - room`. Elsewhere a hyphen is a letter as any other."""
    for group in entries:
        if not any(name.text[0] == "-" or name.text[-1] == "-" for name in group.names):
            yield group
            continue
        pending: list[ast.Term] = []
        left = list(reversed(group.names))
        while left:
            name = left.pop()
            if name.text[0] == "-" and pending and name.key[1:] in types:
                kind = _part(name, 1, None)
            elif name.text[-1] == "-" and left and left[-1].key in types and len(name.text) > 1:
                pending.append(_part(name, 0, -1))
                kind = _part(left.pop(), 0, None)
            else:
                pending.append(name)
                continue
            yield ast.TypedGroup(tuple(pending), (kind,), group.span)
            pending = []
        if pending:
            yield ast.TypedGroup(tuple(pending), group.types, group.span)


def _part(name: ast.Term, first: int, last: int | None) -> ast.Name:
    source, start, _ = name.span
    text = name.text[first:last]
    return ast.Name(text, Span(source, start + first, start + first + len(text)))


def _objects(names: Names, section: ast.TypedSection) -> None:
    names.section = "objects"
    kind = "constant" if section.kind == "constants" else "object"
    objects = names.objects
    for group in _with_spaces(section.entries, names.hierarchy.types):
        types = names.types(group.types)
        for name in group.names:
            key = name.key
            before = objects.get(key)
            if before is None:
                objects[key] = Object(key, types, name.span)
            else:
                # Some problems list an object again with a further type: it is of both.
                twice(names.report, kind, name, before, harmless=True)
                objects[key] = Object(key, tuple(dict.fromkeys((*before.types, *types))), before.span)


def _predicates(names: Names, domain: ast.Definition) -> None:
    names.section = "predicates"
    lists = (ast.Predicates, ast.Observables)
    for section in (each for each in domain.sections if isinstance(each, lists)):
        for node in section.declarations:
            key = node.name.key
            if key == "=":
                # Some files declare equality; it is built in.
                continue
            predicate = Predicate(
                key,
                names.parameters(node.parameters),
                declared_three_valued=node.three_valued,
                derived=key in names.derived,
                external=node.external,
                observed=node.observed,
                span=node.name.span,
            )
            if predicate.external and predicate.derived:
                names.report.error(
                    "BBT0229",
                    f"the derived predicate `{node.name.text}` cannot be external",
                    node.span,
                    "its rules say when it holds: declare what they read as external",
                )
            before = names.predicates.setdefault(key, predicate)
            if before is not predicate:
                same = [p.types for p in before.parameters] == [p.types for p in predicate.parameters]
                twice(names.report, "predicate", node.name, before, harmless=same)


def _functions(names: Names, domain: ast.Definition) -> None:
    names.section = "functions"
    for section in sections(domain, ast.Functions):
        for node in section.declarations:
            if node.types and node.types[0].key != "number":
                names.report.error(
                    "BBT0212",
                    f"the function `{node.name.text}` with values of type `{node.types[0].text}` "
                    "is not supported",
                    node.span,
                    "functions have numbers as values; use a predicate for objects",
                )
            function = Function(
                node.name.key,
                names.parameters(node.parameters),
                node.name.span,
                None if node.range is None else _range(names, node.name, node.range),
            )
            before = names.functions.setdefault(node.name.key, function)
            if before is not function:
                same = [p.types for p in before.parameters] == [p.types for p in function.parameters]
                twice(names.report, "function", node.name, before, harmless=same)


MOST_VALUES = 2**31
"""So many values a number may have, and so large may they be."""


def _range(names: Names, name: ast.Name, node: ast.NumberRange) -> NumberRange | None:
    """A declared range; None after an error."""
    for bound in (node.low, node.high):
        if bound.value.denominator != 1:
            message = f"the range of `{name.text}` goes from one whole number to another, not to {bound.text}"
            names.report.error("BBT0437", message, bound.span)
            return None
        if abs(bound.value) > MOST_VALUES:
            message = f"the bound {bound.text} of `{name.text}` is too large"
            names.report.error("BBT0437", message, bound.span, "numbers stay within 2^31")
            return None
    low, high = int(node.low.value), int(node.high.value)
    if low > high:
        message = f"the range of `{name.text}` is empty: {low} is above {high}"
        names.report.error("BBT0437", message, node.span, f"write `(int {high} {low})`")
        return None
    policy = None if node.policy is None else node.policy.key
    if policy not in (None, ":block", ":saturate"):
        assert node.policy is not None
        message = f"`{node.policy.text}` does not say what happens at the bounds of `{name.text}`"
        hint = "`:saturate`, the default, stays at the bound; with `:block` the action does not start"
        names.report.error("BBT0437", message, node.policy.span, hint)
        return None
    return NumberRange(low, high, policy == ":block", span=node.span)


def _fluents(names: Names, problem: ast.Definition | None) -> None:
    """The fluents that count cost and reward: ``total-cost`` and ``reward``, and the one a metric
    minimises or maximises, which then counts in their place. Where it minimises ``total-time``, which is the
    number of actions if no domain declares it (PDDL 2.1, 3.1), nothing counts in the place of 1 an action."""
    costs, rewards, counted = set(names.costs), set(names.rewards), set(names.counted)
    for metric in sections(problem, ast.Metric) if problem is not None else ():
        if isinstance(metric.expression, ast.FluentRef) and not metric.expression.args:
            key = metric.expression.name.key
            if metric.direction == "minimize" and key == "total-time" and key not in names.functions:
                counted = counted - costs
            elif key in GOAL_FLUENTS and key not in names.functions:
                continue
            elif metric.direction == "minimize" and key not in rewards:
                counted = (counted - costs) | {key}
                costs.add(key)
            elif metric.direction == "maximize" and key not in costs:
                counted = (counted - rewards) | {key}
                rewards.add(key)
        elif metric.direction == "minimize" and (terms := weighted(metric.expression, rewards)) is not None:
            if "total-time" not in names.functions:
                names.per_action = terms.pop("total-time", Fraction(0))
            costs |= terms.keys()
            counted = (counted - costs) | {key for key, weight in terms.items() if weight}
            names.weights = terms
    names.costs, names.rewards, names.counted = frozenset(costs), frozenset(rewards), frozenset(counted)


def weighted(
    expression: ast.NumericExpression, others: Container[str] = frozenset()
) -> dict[str, Fraction] | None:
    """A sum of fluents without arguments, none of them among ``others``, each with its weight, which is not
    below 0; None for what is no such sum."""
    found: dict[str, Fraction] = {}
    match expression:
        case ast.FluentRef(name, ()) if name.key not in others and name.key not in GOAL_FLUENTS:
            return {name.key: Fraction(1)}
        case ast.Arithmetic("+", operands):
            for operand in operands:
                terms = weighted(operand, others)
                if terms is None:
                    return None
                for key, weight in terms.items():
                    found[key] = found.get(key, Fraction(0)) + weight
            return found
        case ast.Arithmetic("*", (ast.Number() as number, other) | (other, ast.Number() as number)):
            terms = weighted(other, others)
            if terms is None or number.value < 0:
                return None
            return {key: number.value * weight for key, weight in terms.items()}
        case _:
            return None


def _actions(names: Names, nodes: list[ast.Action]) -> None:
    """Every action, in source order. Some public domains give several the same name: the later
    ones get a number."""
    taken = {node.name.key for node in nodes}
    for node in nodes:
        key = node.name.key
        names.section = f"action {key}"
        signature = _signature(names, node)
        before = names.actions.get(key)
        if before is not None:
            number = 2
            while f"{key}-{number}" in taken:
                number += 1
            signature = replace(signature, name=f"{key}-{number}")
            taken.add(signature.name)
            hint = f"this one is called `{signature.name}` from here on"
            twice(names.report, "action", node.name, before, hint=hint, harmless=True)
        names.actions[signature.name] = signature


def _events(names: Names, domain: ast.Definition) -> None:
    """Every event; their names are those of no action, since reports and exports name both."""
    for node in sections(domain, ast.Exogenous):
        names.section = f"event {node.name.key}"
        signature = _signature(names, node)
        before = names.events.setdefault(signature.name, signature)
        if before is not signature:
            twice(names.report, "event", node.name, before)
        elif signature.name in names.actions:
            twice(names.report, "event", node.name, names.actions[signature.name], other="an action")


def _signature(names: Names, node: ast.Action | ast.Exogenous | ast.Template) -> Signature:
    return Signature(node.name.key, names.parameters(node.parameters), node.name.span)
