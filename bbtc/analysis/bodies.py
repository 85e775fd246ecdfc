"""Templates: bodies resolved, and the two rules they obey."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from typing_extensions import assert_never

from bbtc.analysis.formulas import effect, formula, inner_scope
from bbtc.analysis.names import Names, Scope
from bbtc.diagnostics import Related, Report
from bbtc.markov import components, reachable
from bbtc.model import domain as md
from bbtc.model import formula as mf
from bbtc.syntax import ast

_MOST_ATTEMPTS = 1000


def template(names: Names, node: ast.Template) -> md.Template:
    """A template; parts with errors, which are reported, count as true conditions."""
    signature = names.templates[node.name.key]
    scope = {parameter.name: parameter for parameter in signature.parameters}
    for lonely in _lonely(node.body):
        names.report.error(
            "BBT0224",
            "`foreach` becomes children of the node around it, and there is none",
            lonely.span,
            "put it into a `sequence`, a `fallback` or a `skipper`",
        )
    return md.Template(
        node.name.key,
        signature.parameters,
        mf.ALWAYS if node.precondition is None else formula(names, node.precondition, scope),
        None if node.effect is None else effect(names, node.effect, scope),
        _body(names, node.body, scope),
        node.span,
    )


def _lonely(body: ast.Body, alone: bool = True) -> Iterator[ast.BodyForeach]:
    """Every `foreach` with no control node around it that may have several children."""
    match body:
        case ast.BodyForeach() if alone:
            yield body
        case ast.BodyForeach(_, child) | ast.BodyRetry(_, child):
            yield from _lonely(child, alone or isinstance(body, ast.BodyRetry))
        case ast.BodyControl(_, children):
            for child in children:
                yield from _lonely(child, False)
        case _:
            pass


def _body(names: Names, node: ast.Body, scope: Scope) -> md.Body:
    match node:
        case ast.BodyControl(kind, children, span):
            return md.BodyControl(kind, tuple(_body(names, child, scope) for child in children), span)
        case ast.BodyRetry(number, child, span):
            return md.BodyRetry(_attempts(names, number), _body(names, child, scope), span)
        case ast.BodyCondition(condition, span):
            return md.BodyCondition(formula(names, condition, scope), span)
        case ast.BodyCall():
            return _call(names, node, scope)
        case ast.BodyForeach(groups, child, span):
            parameters, inside = inner_scope(names, groups, scope)
            return md.BodyForeach(parameters, _body(names, child, inside), span)
        case _:
            assert_never(node)


def _attempts(names: Names, number: ast.Number) -> int:
    """How often a `retry` tries."""
    if number.value.denominator > 1 or not 1 <= number.value <= _MOST_ATTEMPTS:
        message = f"`retry` tries {number.text} times"
        hint = f"a whole number from 1 to {_MOST_ATTEMPTS} says how often"
        names.report.error("BBT0613", message, number.span, hint)
        return 1
    return int(number.value)


def _call(names: Names, node: ast.BodyCall, scope: Scope) -> md.Body:
    key = node.name.key
    action, called = names.actions.get(key), names.templates.get(key)
    found = action if action is not None or node.kind == "action" else called
    failed = md.BodyCondition(mf.ALWAYS, node.span)
    if found is None:
        kind = "action" if node.kind == "action" else "action or template"
        known = names.actions if node.kind == "action" else {**names.actions, **names.templates}
        names.unknown("BBT0205", kind, node.name, known)
        for arg in node.args:
            names.term(arg, scope)
        return failed
    word = "action" if found is action else "template"
    args = names.arguments(word, node.name, found, node.args, scope, span=node.span)
    if args is None:
        return failed
    return md.BodyCall("action" if found is action else "template", key, args, node.span)


# --- rules -----------------------------------------------------------------------------------


def check_templates(report: Report, templates: Mapping[str, md.Template]) -> None:
    """No template may call itself, however far down; in a Skipper only the last child may
    contain actions (with more, our simulator and the execution engines part ways)."""
    called = {
        name: [call for call in md.calls(each.body) if call.kind == "template" and call.name in templates]
        for name, each in templates.items()
    }
    round_about = _circles(called)
    acting = _acting(templates)
    for name, each in templates.items():
        for call in called[name]:
            if call.name == name or round_about[call.name] == round_about[name]:
                way = "itself" if call.name == name else f"itself through `{call.name}`"
                report.error(
                    "BBT0215",
                    f"template `{name}` calls {way}",
                    call.span,
                    "a template is expanded into a finite tree",
                    [Related(f"`{name}` is declared here", each.span)],
                )
        _check_skippers(report, each.body, acting)


def _circles(called: Mapping[str, list[md.BodyCall]]) -> dict[str, int]:
    """A number for each template, the same for those that call one another in a circle."""
    names = list(called)
    number = {name: position for position, name in enumerate(names)}
    successors = [[number[call.name] for call in called[name]] for name in names]
    return {
        names[each]: position for position, circle in enumerate(components(successors)) for each in circle
    }


def _acting(templates: Mapping[str, md.Template]) -> set[str]:
    """Names of the templates that contain an action, through others as well."""
    callers: dict[str, list[str]] = {}
    themselves: list[str] = []
    for name, each in templates.items():
        for call in md.calls(each.body):
            if call.kind == "action":
                themselves.append(name)
            else:
                callers.setdefault(call.name, []).append(name)
    return reachable(themselves, lambda name: callers.get(name, ()))


def _acts(body: md.Body, acting: set[str]) -> bool:
    return any(call.kind == "action" or call.name in acting for call in md.calls(body))


def _check_skippers(report: Report, body: md.Body, acting: set[str]) -> None:
    for part in md.walk(body):
        if not isinstance(part, md.BodyControl) or part.kind != "skipper":
            continue
        for position, child in enumerate(part.children):
            # A foreach with actions becomes several children, so it may not be the last either.
            several = isinstance(child, md.BodyForeach)
            if (several or position < len(part.children) - 1) and _acts(child, acting):
                report.error(
                    "BBT0216",
                    "in a skipper only the last child may contain actions",
                    child.span,
                    "put the attempts into one last child: (skipper c (sequence (fallback attempt…) c))",
                )
