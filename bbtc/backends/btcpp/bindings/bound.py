"""Bindings held against the tree that is written, and the elements that they make of its leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element, SubElement

from typing_extensions import assert_never

from bbtc.artefacts.cursor import clip, nearest
from bbtc.backends.btcpp.bindings.entries import (
    Argument,
    Binding,
    Bindings,
    Entry,
    Kind,
    NodeBinding,
    NodeModel,
    Text,
)
from bbtc.backends.btcpp.bindings.read import files_of, read_bindings
from bbtc.backends.exporter import Option, OptionValue
from bbtc.backends.interface import Interface, Leaf, action_symbol, variable_symbol, variables_read
from bbtc.backends.names import Symbol
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.ground.task import Signature, Task
from bbtc.tree.nodes import Tree, actions_of

BINDINGS = Option(
    "bindings",
    "",
    "file that binds actions and conditions to nodes, actions, services and topics that others have",
    reads=files_of,
)
NEGATION = "Inverter"

Uses = Mapping[Symbol, Mapping[tuple[str, ...], None]]
"""The arguments with which a tree uses each of its leaves."""


def bindings_of(options: Mapping[str, OptionValue]) -> Bindings:
    """The bindings that the option names; none where it is empty. Raises :class:`BbtcError`."""
    path = str(options.get("bindings", ""))
    return read_bindings(path) if path else Bindings()


@dataclass(frozen=True, slots=True)
class BoundLeaf:
    """A leaf of a tree with what stands for it; ``names`` are its parameters as the domain has them."""

    leaf: Leaf
    binding: Binding
    names: tuple[str, ...]

    def position(self, argument: Argument) -> int:
        """Which parameter of the leaf it is."""
        return self.names.index(argument.parameter)


@dataclass(frozen=True, slots=True)
class BoundNodes:
    """The leaves of a tree that are written as nodes of others."""

    leaves: Mapping[Symbol, BoundLeaf] = field(default_factory=dict)
    models: Mapping[str, NodeModel] = field(default_factory=dict)

    def refuse_held(self, symbols: Iterable[Symbol]) -> None:
        """Raise :class:`BbtcError` (BBT0713) for a condition of these that is a node of others: our control
        nodes know what a running action holds by our own leaves."""
        for bound in (self.leaves[symbol] for symbol in symbols if symbol in self.leaves):
            message = (
                f"'{clip(bound.binding.name)}' is bound, and a running action may set it: "
                "our control nodes (nodes=bbtc) hold leaves of ours only"
            )
            hint = "export with -O nodes=stock, or leave it unbound"
            raise BbtcError.single("BBT0713", message, bound.binding.span, hint)

    def element(self, symbol: Symbol, args: tuple[str, ...], value: Callable[[str], str]) -> Element | None:
        """The node that stands for a leaf; None where it is one of ours. ``value`` gives the text for an
        object that is passed as it is."""
        if symbol not in self.leaves:
            return None
        bound = self.leaves[symbol]
        node = bound.binding.node
        assert node is not None
        element = Element(node.node)
        for given in node.ports:
            element.set(given.name, _text(bound, given.value, args, value))
        if not node.negated:
            return element
        outer = Element(NEGATION)
        outer.append(element)
        return outer

    def describe(self, model: Element) -> None:
        """Add the nodes to a ``TreeNodesModel``: as their package describes them, or as far as the bindings
        tell."""
        nodes = {bound.binding.node.node: bound for bound in self.leaves.values() if bound.binding.node}
        for name in sorted(nodes):
            if name in self.models:
                known = self.models[name]
                entry = SubElement(model, known.kind, ID=name)
                for port in known.ports.values():
                    element = SubElement(entry, f"{port.direction}_port", name=port.name)
                    if port.type:
                        element.set("type", port.type)
                    if port.default is not None:
                        element.set("default", port.default)
                continue
            kind = "Action" if nodes[name].binding.kind == "action" else "Condition"
            entry = SubElement(model, kind, ID=name)
            bound = [each.binding.node for each in self.leaves.values() if each.binding.node]
            ports = {given.name: None for node in bound if node.node == name for given in node.ports}
            for port_name in ports:
                SubElement(entry, "inout_port", name=port_name)


def _text(
    bound: BoundLeaf, given: Text | Entry | Argument, args: tuple[str, ...], value: Callable[[str], str]
) -> str:
    match given:
        case Text(text):
            return text
        case Entry(name):
            return f"{{@{name}}}"  # of the root blackboard: a SubTree has its own
        case Argument(table=None):
            return value(args[bound.position(given)])
        case Argument():
            row = given.looked_up(args[bound.position(given)])
            assert row is not None
            return row.text
        case _:
            assert_never(given)


# --- what fits the tree ----------------------------------------------------------------------


def bound_leaves(tree: Tree, interface: Interface, bindings: Bindings) -> dict[Symbol, BoundLeaf]:
    """The leaves of a tree that are bound. Raises :class:`BbtcError` (BBT0708) for actions, conditions and
    parameters that the domain does not have, and for objects that a table does not have."""
    faults = [*_unknown(tree.task, bindings)]
    found: dict[Symbol, BoundLeaf] = {}
    uses = _uses(tree)
    for leaf in (*interface.conditions, *interface.actions):
        binding = None if leaf.counts else bindings.find(_kind(leaf), leaf.symbol.name)
        if binding is None:
            continue
        bound = BoundLeaf(leaf, binding, parameter_names(tree.task, leaf.symbol, leaf.parameters))
        wrong = list(_argument_faults(bound, uses.get(leaf.symbol, {})))
        if wrong:
            faults += [fault for fault in wrong if fault not in faults]
        else:
            found[leaf.symbol] = bound
    if faults:
        raise BbtcError(faults)
    return found


def _kind(leaf: Leaf) -> Kind:
    return "action" if leaf.symbol.kind == "action" else "predicate"


def bound_nodes(tree: Tree, interface: Interface, bindings: Bindings) -> BoundNodes:
    """Those that a tree in XML has as nodes. Raises :class:`BbtcError`, also (BBT0713) for a condition that
    can be unknown, where the binding does not say that the node returns RUNNING then."""
    leaves = {
        symbol: bound
        for symbol, bound in bound_leaves(tree, interface, bindings).items()
        if bound.binding.node is not None
    }
    faults = [
        _unknowable(bound, bound.binding.node)
        for bound in leaves.values()
        if bound.binding.node is not None and bound.leaf.three_valued and not bound.binding.node.running
    ]
    if faults:
        raise BbtcError(faults)
    return BoundNodes(leaves, bindings.models)


def _unknowable(bound: BoundLeaf, node: NodeBinding) -> Diagnostic:
    message = f"'{clip(bound.binding.name)}' can be unknown, and '{node.node}' does not tell when it is"
    hint = "say `unknown: running` where the node returns RUNNING then; others answer true or false only"
    return Diagnostic("BBT0713", message, node.span, hint=hint)


def _uses(tree: Tree) -> Uses:
    task = tree.task
    uses: dict[Symbol, dict[tuple[str, ...], None]] = {}
    for node in actions_of(tree.root):
        action = task.action_by_name[node.action]
        uses.setdefault(action_symbol(action), {})[action.args] = None
    read = variables_read(tree)
    if tree.monitor is not None:
        read.update(dict.fromkeys(sorted(tree.monitor.seen)))
    for index in read:
        variable = task.variables[index]
        uses.setdefault(variable_symbol(variable), {})[variable.args] = None
    return uses


def _unknown(task: Task, bindings: Bindings) -> Iterator[Diagnostic]:
    """Bindings of what the domain does not have, where the task tells what that has."""
    if not task.signatures:
        return
    for binding in bindings.bindings:
        known = tuple(each.symbol for each in task.signatures if each.kind == binding.kind)
        if binding.name not in known:
            what = "action" if binding.kind == "action" else "predicate"
            message = f"the domain '{clip(task.domain)}' has no {what} '{clip(binding.name)}'"
            hint = nearest(binding.name, known)
            if any(each.symbol == binding.name for each in task.signatures if each.kind == "function"):
                hint = "it is a number, and these are not bound"
            yield Diagnostic("BBT0708", message, binding.span, hint=hint)
            continue
        signatures = [s for s in task.signatures if (s.kind, s.symbol) == (binding.kind, binding.name)]
        yield from _unknown_parameters(binding, signatures)


def _unknown_parameters(binding: Binding, signatures: list[Signature]) -> Iterator[Diagnostic]:
    for value, span in binding.values():
        if isinstance(value, Argument) and not all(value.parameter in s.parameters for s in signatures):
            listed = ", ".join(map(clip, signatures[0].parameters)) or "none"
            message = f"'{clip(binding.name)}' has no parameter '{clip(value.parameter)}'"
            hint = nearest(value.parameter, signatures[0].parameters) or f"it has {listed}"
            yield Diagnostic("BBT0708", message, span, hint=hint)


def parameter_names(task: Task, symbol: Symbol, own: tuple[str, ...]) -> tuple[str, ...]:
    """The parameters of a leaf as the domain has them; where that is not known, its ``own``."""
    for each in task.signatures:
        if (each.kind, each.symbol, len(each.parameters)) == (symbol.kind, symbol.name, symbol.arity):
            return each.parameters
    return own


def _argument_faults(bound: BoundLeaf, uses: Mapping[tuple[str, ...], None]) -> Iterator[Diagnostic]:
    for value, span in bound.binding.values():
        if not isinstance(value, Argument):
            continue
        if value.parameter not in bound.names:
            if bound.names is bound.leaf.parameters:  # what the domain calls it was not known before
                message = f"'{clip(bound.binding.name)}' has no parameter '{clip(value.parameter)}'"
                listed = ", ".join(map(clip, bound.names)) or "none"
                yield Diagnostic("BBT0708", message, span, hint=f"it has {listed}")
            continue
        if value.table is None:
            continue
        for name in dict.fromkeys(args[bound.position(value)] for args in uses):
            if value.looked_up(name) is None:
                part = "" if value.part is None or name not in value.table.rows else f" part {value.part}"
                message = f"the table '{clip(value.table.name)}' has no{part} '{clip(name)}'"
                if part:
                    message = f"'{clip(name)}' of the table '{clip(value.table.name)}' has no{part}"
                place = value.table.spans.get(name) or value.table.span or span
                yield Diagnostic("BBT0708", message, place)
