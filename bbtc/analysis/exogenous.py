"""Events (``:exogenous``): what happens by itself, besides the actions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from bbtc.analysis import formulas
from bbtc.analysis.declare import sections
from bbtc.analysis.names import Names
from bbtc.markov import reachable
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.syntax import ast


def events(names: Names, domain: ast.Definition) -> Iterator[md.Schema]:
    """The events of a domain, in source order, with every event that one is ``:before`` named."""
    nodes = {node.name.key: node for node in reversed(list(sections(domain, ast.Exogenous)))}
    before = {name: _before(names, node) for name, node in nodes.items()}
    told: set[str] = set()
    for name, node in reversed(nodes.items()):
        names.section = f"event {name}"
        signature = names.events[name]
        scope = {parameter.name: parameter for parameter in signature.parameters}
        _check_order(names, node, before, told)
        effect, per = formulas.effect(names, node.effect, scope), _per(names, node)
        if per == "second":
            _check_single(names, node, effect)
        yield md.Schema(
            name,
            signature.parameters,
            mf.ALWAYS if node.precondition is None else formulas.formula(names, node.precondition, scope),
            effect,
            exogenous=md.Exogenous(per, tuple(before[name])),
            span=node.span,
        )


def _check_single(names: Names, node: ast.Exogenous, effect: me.Effect) -> None:
    """Report a draw by time of more than one thing: which of them comes first would be another draw."""
    for choice in (part for part in me.walk(effect) if isinstance(part, me.Choice)):
        happens = [branch.effect for branch in choice.branches if branch.effect != me.NOTHING]
        nested = any(isinstance(part, me.Choice) for each in happens for part in me.walk(each))
        if len(happens) > 1 or choice.oneof or nested:
            message = f"event `{node.name.text}` draws one of several effects each second"
            hint = "write `(probabilistic p e)`, with one effect, and an event for each of the others"
            names.report.error("BBT0231", message, choice.span or node.effect.span, hint)
            return


def _before(names: Names, node: ast.Exogenous) -> dict[str, None]:
    names.section = f"event {node.name.key}"
    found: dict[str, None] = {}
    for other in node.before or ():
        if other.key in names.events:
            found[other.key] = None
        else:
            names.unknown("BBT0231", "event", other, names.events)
    return found


def _check_order(
    names: Names, node: ast.Exogenous, before: Mapping[str, Mapping[str, None]], told: set[str]
) -> None:
    """Report a circle of events, of which one is this, unless that was ``told``."""

    def later(name: str) -> Iterable[str]:
        return before.get(name, ())

    own = node.name.key
    after = reachable(before[own], later)
    if own not in after or own in told:
        return
    circle = [name for name in before if name in after and own in reachable(before[name], later)]
    told.update(circle)
    others = ", ".join(f"`{name}`" for name in reversed(circle) if name != own)
    message = f"event `{own}` would happen before itself"
    hint = f"it is `:before` {others}, directly or through others, and so the other way round"
    names.report.error("BBT0231", message, (node.before or (node.name,))[0].span, hint if others else None)


def _per(names: Names, node: ast.Exogenous) -> md.Rate:
    if node.per is not None and node.per.key == "second":
        return "second"
    if node.per is not None and node.per.key != "action":
        hint = "`action` draws it once an action, `second` as often as time passes"
        names.report.error("BBT0231", f"an event is not drawn per `{node.per.text}`", node.per.span, hint)
    return "action"
