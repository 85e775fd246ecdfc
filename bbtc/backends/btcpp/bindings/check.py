"""Bindings held against the models of the nodes that they name."""

from __future__ import annotations

from collections.abc import Iterator

from bbtc.artefacts.cursor import clip, nearest
from bbtc.backends.btcpp.bindings.entries import (
    Argument,
    Binding,
    Bindings,
    Entry,
    Given,
    NodeBinding,
    NodeModel,
    PortModel,
    Text,
)
from bbtc.backends.btcpp.bindings.fits import misfit
from bbtc.diagnostics import Diagnostic


def model_faults(bindings: Bindings) -> Iterator[Diagnostic]:
    """What does not fit the models: nodes that have none or are of another kind, ports that a node lacks or
    needs, values that they do not take."""
    for binding in bindings.bindings:
        if binding.node is not None:
            yield from _node_faults(binding, binding.node, bindings)


def _node_faults(binding: Binding, node: NodeBinding, bindings: Bindings) -> Iterator[Diagnostic]:
    model = bindings.models.get(node.node)
    kind = "Action" if binding.kind == "action" else "Condition"
    if model is None:
        known = tuple(name for name, each in bindings.models.items() if each.kind == kind)
        message = f"no model has the node '{clip(node.node)}'"
        yield Diagnostic("BBT0710", message, node.span, hint=nearest(node.node, known))
        return
    if model.kind != kind:
        message = f"'{node.node}' is a node of the kind {model.kind}; here it must be {_a(kind)}"
        yield Diagnostic("BBT0710", message, node.span)
        return
    for given in node.ports:
        port = model.ports.get(given.name)
        if port is None:
            message = f"the node '{node.node}' has no port '{clip(given.name)}'"
            yield Diagnostic("BBT0711", message, given.span, hint=nearest(given.name, tuple(model.ports)))
        else:
            yield from _value_faults(node, port, given)
    yield from _missing(node, model)


def _missing(node: NodeBinding, model: NodeModel) -> Iterator[Diagnostic]:
    given = {each.name for each in node.ports}
    for port in model.ports.values():
        needed = port.direction == "input" and port.default is None
        if needed and port.name not in given and port.name not in node.omit:
            message = f"the node '{node.node}' is not given '{clip(port.name)}', a port without default"
            hint = f"give it, or say `omit: [{clip(port.name)}]` where the node does without"
            yield Diagnostic("BBT0711", message, node.span, hint=hint)


def _value_faults(node: NodeBinding, port: PortModel, given: Given) -> Iterator[Diagnostic]:
    value = given.value
    if port.direction == "output" and not isinstance(value, Entry):
        message = f"'{port.name}' of '{node.node}' is an output: it goes to an entry of the blackboard"
        yield Diagnostic("BBT0711", message, given.span, hint=f'such as "{{{port.name}}}"')
        return
    match value:
        case Text(text):
            yield from _misfit(node, port, text, given)
        case Argument(table=table, part=None) if table is not None:
            for name, row in table.rows.items():
                wanted = misfit(row.text, port.type)
                if wanted is not None:
                    message = (
                        f"'{clip(row.text)}' for '{clip(name)}' does not fit port '{port.name}' of "
                        f"'{node.node}', which takes {wanted}"
                    )
                    yield Diagnostic("BBT0712", message, table.spans.get(name) or table.span)
        case Argument(table=table) if table is not None:
            for name in table.rows:
                part = value.looked_up(name)
                if part is not None:
                    yield from _misfit(node, port, part.text, given)
        case Argument() | Entry():
            pass  # the name of an object, and what the blackboard has, are known where the tree runs


def _misfit(node: NodeBinding, port: PortModel, text: str, given: Given) -> Iterator[Diagnostic]:
    wanted = misfit(text, port.type)
    if wanted is not None:
        message = f"'{clip(text)}' does not fit port '{port.name}' of '{node.node}', which takes {wanted}"
        yield Diagnostic("BBT0712", message, given.span)


def _a(kind: str) -> str:
    return "an Action" if kind == "Action" else "a Condition"
