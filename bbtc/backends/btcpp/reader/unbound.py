"""Nodes that bindings have stand for leaves, put back as these leaves, so that a file with them is read as
any other. The inverse of :class:`bbtc.backends.btcpp.bindings.bound.BoundNodes`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.bindings.bound import NEGATION, parameter_names
from bbtc.backends.btcpp.bindings.entries import Argument, Binding, Bindings, Entry, NodeBinding, Text
from bbtc.backends.btcpp.names import objects_of
from bbtc.backends.btcpp.reader.layout import is_port
from bbtc.backends.btcpp.reader.leaves import FileNames
from bbtc.backends.btcpp.reader.shapes import tag_of
from bbtc.backends.btcpp.reader.unread import unreadable
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.backends.interface import action_symbol, parameters_of, variable_symbol
from bbtc.backends.names import Symbol, camel, port_values, possible_identifiers
from bbtc.diagnostics import BbtcError, Unreadable
from bbtc.ground.task import Task


def put_back(document: XmlDocument, task: Task, names: FileNames, bindings: Bindings) -> None:
    """Replace, in place, every node that a binding names by the leaf that it stands for. Raises
    :class:`BbtcError` (BBT0606) for one that stands for none, or for several."""
    reader = _Unbinder(document, task, names, bindings)
    faults = []
    for tree in (each for each in document.root.children if each.tag == "BehaviorTree"):
        stack = [tree]
        while stack:
            element = stack.pop()
            try:
                reader.children(element)
            except Unreadable as fault:
                faults.append(fault.diagnostic)
            stack += element.children
    if faults:
        raise BbtcError(faults)


@dataclass(frozen=True, slots=True)
class _Leaf:
    """What a node stands for: the binding, the leaf, and the values of its ports."""

    binding: NodeBinding
    symbol: Symbol
    ports: Mapping[str, str]


class _Unbinder:
    def __init__(self, document: XmlDocument, task: Task, names: FileNames, bindings: Bindings) -> None:
        self._document = document
        self._task = task
        self._values = port_values(objects_of(task))
        self._values |= {name: value for value, name in names.objects.items()}
        self._ids = {symbol: name for name, symbol in names.symbols.items()}
        self._prefix = camel(names.namespace) if names.namespace else ""
        self._atoms: dict[Symbol, dict[tuple[str, ...], None]] = {}
        for variable in task.variables:
            if variable.digit is None:
                self._atoms.setdefault(variable_symbol(variable), {})[variable.args] = None
        for action in task.actions:
            self._atoms.setdefault(action_symbol(action), {})[action.args] = None
        self._nodes: dict[str, list[tuple[Binding, NodeBinding]]] = {}
        for binding in bindings.bindings:
            if binding.node is not None:
                self._nodes.setdefault(binding.node.node, []).append((binding, binding.node))

    def children(self, element: XmlElement) -> None:
        """Put back the nodes right below an element, and below Inverters there that belong to them."""
        for place, child in enumerate(element.children):
            inside = child.children[0] if tag_of(child) == NEGATION and len(child.children) == 1 else None
            if inside is not None and tag_of(inside) in self._nodes:
                leaf = self._leaf(inside)
                if leaf.binding.negated:
                    shown = {**_other(inside), **child.attributes}
                    element.children[place] = self._written(leaf, child, shown)
                else:
                    child.children[0] = self._written(leaf, inside, _other(inside))
            elif tag_of(child) in self._nodes:
                leaf = self._leaf(child)
                if leaf.binding.negated:
                    outer = XmlElement(NEGATION, _other(child), child.start)
                    outer.children.append(self._written(leaf, child, {}))
                    element.children[place] = outer
                else:
                    element.children[place] = self._written(leaf, child, _other(child))

    def _written(self, leaf: _Leaf, element: XmlElement, other: Mapping[str, str]) -> XmlElement:
        own = self._prefix + possible_identifiers(leaf.symbol, "camel")[0]
        tag = self._ids.get(leaf.symbol, own)
        return XmlElement(tag, {**leaf.ports, **other}, element.start)

    def _leaf(self, element: XmlElement) -> _Leaf:
        found: list[_Leaf] = []
        for binding, node in self._nodes[tag_of(element)]:
            for symbol in self._atoms:
                kind = "action" if symbol.kind == "action" else "predicate"
                if (kind, symbol.name) == (binding.kind, binding.name) and symbol.kind != "function":
                    found += (_Leaf(node, symbol, ports) for ports in self._ports(element, node, symbol))
        if len(found) == 1:
            return found[0]
        name = clip(tag_of(element))
        if found:
            listed = ", ".join(f"{leaf.symbol.name}({', '.join(leaf.ports.values())})" for leaf in found[:3])
            message = f"by the bindings, '{name}' with these ports may be each of {listed}"
        else:
            message = f"by the bindings, '{name}' with these ports stands for nothing of the task"
        raise unreadable(self._document, element, "BBT0606", message)

    def _ports(self, element: XmlElement, node: NodeBinding, symbol: Symbol) -> Iterator[dict[str, str]]:
        """The ports of the leaf, in every way in which the node with its ports stands for it."""
        given = {key: value for key, value in element.attributes.items() if is_port(key)}
        if given.keys() != {each.name for each in node.ports}:
            return
        names = parameter_names(self._task, symbol, parameters_of(self._task, symbol))
        passed: dict[int, str] = {}
        looked_up: list[tuple[int, Argument, str]] = []
        for each in node.ports:
            text = given[each.name]
            match each.value:
                case Text(wanted) if text != wanted:
                    return
                case Entry(name) if text != f"{{@{name}}}":
                    return
                case Argument(parameter=parameter) as argument if parameter in names:
                    position = names.index(parameter)
                    if argument.table is not None:
                        looked_up.append((position, argument, text))
                    elif passed.setdefault(position, text) != text:
                        return
                case Argument():
                    return
                case _:
                    pass
        seen: dict[tuple[str, ...], None] = {}
        for args in self._atoms[symbol]:
            if all(_says(argument, args[at], text) for at, argument, text in looked_up):
                texts = tuple(passed.get(at, self._values[arg]) for at, arg in enumerate(args))
                literal = (
                    (at, text) for at, text in passed.items() if not (text[:1] == "{" and text[-1:] == "}")
                )
                if all(self._values[args[at]] == text for at, text in literal):
                    seen[texts] = None
        parameters = parameters_of(self._task, symbol)
        yield from (dict(zip(parameters, texts, strict=True)) for texts in seen)


def _says(argument: Argument, name: str, text: str) -> bool:
    row = argument.looked_up(name)
    return row is not None and row.text == text


def _other(element: XmlElement) -> dict[str, str]:
    """The attributes that are no ports."""
    attributes: Iterable[tuple[str, str]] = element.attributes.items()
    return {key: value for key, value in attributes if not is_port(key) and key != "ID"}
