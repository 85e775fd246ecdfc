"""The ``TreeNodesModel`` of BehaviorTree.CPP: what an editor such as Groot2 offers, with the ports of
every node; inside the file of a tree, or as a palette of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias
from xml.etree.ElementTree import Element, SubElement

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.bindings.bound import BINDINGS, bindings_of
from bbtc.backends.btcpp.idioms import COMMITTED, HELD, LATCH, SKIPPER, WHILE, Profile
from bbtc.backends.btcpp.names import BtcppNames, btcpp_names
from bbtc.backends.btcpp.options import NAMESPACE, NODES, namespace_of, profile_of, xml_text
from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.interface import BOUNDS, Leaf, variable_symbol
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.tree.nodes import Tree

_MOST_OBJECTS = 8

_Objects: TypeAlias = Mapping[tuple[str, str, int], Mapping[str, None]]


def node_model(
    task: Task, names: BtcppNames, profile: Profile, subtrees: Mapping[str, tuple[str, ...]]
) -> Element:
    """The model of the leaves, of our own control nodes if the profile uses them, and of the
    BehaviorTrees that have ports."""
    model = Element("TreeNodesModel")
    objects = _objects(task)
    for condition in filter(names.ours, names.interface.conditions):
        _entry(model, "Condition", condition, names, objects)
    for action in filter(names.ours, names.interface.actions):
        _entry(model, "Action", action, names, objects)
    names.bound.describe(model)
    if profile == "bbtc":
        _our_nodes(model)
    for tree_id in sorted(subtrees):
        if subtrees[tree_id]:
            entry = SubElement(model, "SubTree", ID=tree_id)
            for port in subtrees[tree_id]:
                SubElement(entry, "input_port", name=port, type="std::string")
    return model


def signature(leaf: Leaf) -> str:
    """``seen(item)``."""
    return printable(f"{leaf.symbol.name}({', '.join(leaf.parameters)})")


def meaning(leaf: Leaf) -> str:
    """What a leaf tells or does, in a sentence."""
    if leaf.symbol.kind == "action":
        return f"Does {signature(leaf)}."
    if leaf.counts:
        least, most = BOUNDS
        compared = f"is no less than {least} and no more than {most}, as far as these are given"
        return f"SUCCESS where {signature(leaf)} {compared}, else FAILURE; RUNNING where it is unknown."
    unknown = ", RUNNING where it is unknown" if leaf.three_valued else ""
    return f"SUCCESS where {signature(leaf)} is true, FAILURE where it is false{unknown}."


def _entry(
    model: Element,
    kind: str,
    leaf: Leaf,
    names: BtcppNames,
    objects: _Objects,
) -> None:
    element = SubElement(model, kind, ID=names.ids[leaf.symbol])
    for port, text in zip(leaf.parameters, _port_text(names, objects, leaf), strict=True):
        SubElement(element, "input_port", name=port, type="std::string").text = text or None
    for port, value, _, text in _bounds(leaf):
        SubElement(element, "input_port", name=port, type="int", default=str(value)).text = text
    SubElement(element, "description").text = meaning(leaf)


def _bounds(leaf: Leaf) -> list[tuple[str, int, str, str]]:
    """What a number is compared with: the port, what it holds where nothing is given (any number the engine
    can hold lies within), that in C++, and what is said of it."""
    if not leaf.counts:
        return []
    return [
        (BOUNDS[0], -(2**31), "std::numeric_limits<int>::min()", "the least value"),
        (BOUNDS[1], 2**31 - 1, "std::numeric_limits<int>::max()", "the greatest value"),
    ]


def port_code(task: Task, names: BtcppNames, leaf: Leaf) -> str:
    """The ports of a leaf in C++, with what is said of each."""
    ports = [
        f"BT::InputPort<std::string>({cppcode.literal(port)}, {cppcode.literal(text)})"
        for port, text in zip(leaf.parameters, _port_text(names, _objects(task), leaf), strict=True)
    ]
    ports += [
        f"BT::InputPort<int>({cppcode.literal(port)}, {code}, {cppcode.literal(text)})"
        for port, _, code, text in _bounds(leaf)
    ]
    return f"{{{', '.join(ports)}}}"


def _port_text(names: BtcppNames, objects: _Objects, leaf: Leaf) -> list[str]:
    """What is said of each port of a leaf: some of the objects that may stand there."""
    texts = []
    for position in range(leaf.symbol.arity):
        known = objects.get((leaf.symbol.kind, leaf.symbol.name, position), {})
        listed = [names.values[name] for name in known][:_MOST_OBJECTS]
        more = ", …" if len(known) > _MOST_OBJECTS else ""
        texts.append(f"such as {', '.join(listed)}{more}" if listed else "")
    return texts


def _objects(task: Task) -> _Objects:
    """The objects that a task puts at each position of a predicate or action."""
    found: dict[tuple[str, str, int], dict[str, None]] = {}
    for variable in task.variables:
        for position, arg in enumerate(variable.args):
            symbol = variable_symbol(variable)
            found.setdefault((symbol.kind, symbol.name, position), {})[arg] = None
    for action in task.actions:
        for position, arg in enumerate(action.args):
            found.setdefault(("action", action.schema, position), {})[arg] = None
    return found


def _our_nodes(model: Element) -> None:
    skipper = SubElement(model, "Control", ID=SKIPPER)
    SubElement(
        skipper, "description"
    ).text = "Goes on to the next child while a child returns RUNNING; returns the first SUCCESS or FAILURE."
    latch = SubElement(model, "Control", ID=LATCH)
    keep = SubElement(latch, "input_port", name="keep", type="bool", default="true")
    keep.text = "whether the action runs once and its status is kept"
    flag = SubElement(latch, "input_port", name="flag", type="std::string", default="acting")
    flag.text = "entry of the root blackboard that is set to true while the action runs"
    entry = SubElement(latch, "input_port", name="entry", type="std::string", default="")
    entry.text = "entry of the blackboard that its status is kept in"
    sets = SubElement(latch, "input_port", name="sets", type="std::string", default="")
    sets.text = "the facts that are held while the action runs"
    SubElement(latch, "description").text = (
        "Runs the action that is its last child, once the children before it have succeeded; its "
        "status counts from the next tick on."
    )
    held = SubElement(model, "Decorator", ID=HELD)
    SubElement(
        held, "description"
    ).text = (
        "What the condition returned before the running action began, if that sets it; or what it returns."
    )
    goes_on = SubElement(model, "Decorator", ID=WHILE)
    SubElement(goes_on, "description").text = "In a Latch, before its action: it goes on while this is so."
    committed = SubElement(model, "Decorator", ID=COMMITTED)
    SubElement(committed, "description").text = (
        "The root: knows which action runs, is RUNNING where the tick passes that by, and fails where the "
        "tree is RUNNING but no action is."
    )


@dataclass(frozen=True, slots=True)
class PaletteExporter:
    """Writes the palette of the nodes that a tree needs."""

    name: str = "btcpp_palette"
    description: str = "palette of the nodes of --to btcpp, for Groot2 and other editors"
    suffix: str = ".xml"
    options: tuple[Option, ...] = (NODES, NAMESPACE, BINDINGS)

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The XML. Raises :class:`BbtcError` (BBT0704) for a namespace that is none, and for bindings that
        have faults or do not fit the tree."""
        del figures
        document = Element("root", BTCPP_format="4")
        names = btcpp_names(tree, namespace_of(self.name, options), bindings_of(options))
        document.append(node_model(tree.task, names, profile_of(options), {}))
        return xml_text(document)


btcpp_palette = PaletteExporter()
