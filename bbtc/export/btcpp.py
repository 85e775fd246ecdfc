"""Exporter ``btcpp``: BehaviorTree.CPP v4 XML (4.6 and later) from the engine's own nodes.

A Skipper is a Parallel that ends with its first child to end; an action stands in a BehaviorTree per
schema that keeps its latch; conditions are leaves that return RUNNING for unknown. docs/export-btcpp.md
explains every idiom.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from typing_extensions import assert_never

from bbtc.export.btcpp_conditions import ConditionWriter, control, is_numeric
from bbtc.export.interface import Interface, Leaf, action_symbol, guard_of, interface_of
from bbtc.export.names import Namer, Symbol, camel, identifiers, port_values, printable
from bbtc.export.registry import Figures, Option, OptionValue
from bbtc.export.shape import fit, normal, words_of
from bbtc.ground.condition import Condition
from bbtc.ground.task import GroundAction, Task
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree

ENGINE = "BehaviorTree.CPP"
_DEEPEST_XML = 120  # levels of a BehaviorTree before a subtree gets one of its own; the engine takes 256

RESERVED = frozenset(
    """
    AlwaysFailure AlwaysSuccess AsyncFallback AsyncSequence Delay Fallback ForceFailure ForceSuccess
    IfThenElse Inverter KeepRunningUntilFailure LoopBool LoopDouble LoopInt LoopString Parallel
    ParallelAll Precondition ReactiveFallback ReactiveSequence Repeat RetryUntilSuccessful
    RetryUntilSuccesful RunOnce Script ScriptCondition Sequence SequenceStar SequenceWithMemory
    SetBlackboard SkipUnlessUpdated Sleep SubTree SubTreePlus Switch2 Switch3 Switch4 Switch5 Switch6
    Timeout TryCatch UnsetBlackboard WaitValueUpdate WasEntryUpdated WhileDoElse EntryUpdated
    ConsumeQueue PopFromQueue QueueSize ManualSelector TestNode Root BehaviorTree TreeNodesModel Include
    Action Condition Control Decorator
    """.split()  # noqa: SIM905 (a list of seventy lines would be no clearer)
)
"""Ids with a meaning of their own in BehaviorTree.CPP 4 files."""

Guard: TypeAlias = bytes
"""The XML of a guard, which tells guards apart."""


@dataclass(frozen=True, slots=True)
class BtcppNames:
    """Which identifier stands for what in an exported file: ids of leaves, and object names as
    values of ports."""

    interface: Interface
    ids: Mapping[Symbol, str]
    values: Mapping[str, str]


def btcpp_names(tree: Tree) -> BtcppNames:
    """The names used in the export of a tree."""
    task = tree.task
    interface = interface_of(task, tree.root)
    arguments = [arg for variable in task.variables for arg in variable.args]
    arguments += [arg for action in task.actions for arg in action.args]
    return BtcppNames(interface, identifiers(interface.leaves, "camel", RESERVED), port_values(arguments))


@dataclass(frozen=True, slots=True)
class BtcppExporter:
    """Writes a tree as BehaviorTree.CPP v4 XML."""

    name: str = "btcpp"
    description: str = "BehaviorTree.CPP v4 XML with its TreeNodesModel, from stock nodes"
    suffix: str = ".xml"
    options: tuple[Option, ...] = (
        Option("model", True, "append the TreeNodesModel, which editors such as Groot2 read"),
    )

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The XML. Raises :class:`BbtcError` (BBT0705) for a tree that is too deep."""
        del figures  # a file that runs has no place for them
        root = _Writer(tree).document(model=bool(options.get("model", True)))
        indent(root, "  ")
        text: str = tostring(root, encoding="unicode", short_empty_elements=True)
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


btcpp = BtcppExporter()


class _Writer:
    """Writes one document: BehaviorTrees are collected while the main tree is written."""

    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.task: Task = tree.task
        self.names = btcpp_names(tree)
        self.tree_ids = Namer({*RESERVED, *self.names.ids.values()})
        self.hoisted: list[Element] = []
        self.action_trees: dict[tuple[str, bytes, Guard | None], Element] = {}
        self.condition_trees: dict[Condition, Element] = {}
        self.subtree_ports: dict[str, tuple[str, ...]] = {}
        self.counters: dict[str, str] = {}
        self.conditions = ConditionWriter(
            self.task, self.names.interface, self.names.ids, self.names.values, self.tree_ids
        )

    def document(self, model: bool) -> Element:
        main_id = self.tree_ids.take(camel(self.tree.task.problem), seed=self.tree.task.problem)
        document = Element("root", BTCPP_format="4", main_tree_to_execute=main_id)
        main = SubElement(document, "BehaviorTree", ID=main_id)
        main.set("_description", self._headline())
        guarded = self._written(fit(self.tree.root, ENGINE), _Place(main_id))
        main.append(_until_blocked(guarded, list(self.counters.values())))
        document.extend(self.hoisted)
        document.extend(self.condition_trees.values())
        document.extend(self.conditions.trees.values())
        document.extend(self.action_trees.values())
        self.subtree_ports |= {
            tree_id: self.conditions.ports_of(tree_id) for tree_id in self.conditions.trees
        }
        if model:
            document.append(self._model())
        return document

    def _headline(self) -> str:
        task, claim = self.task, self.tree.success_probability
        return printable(f"{task.domain}, {task.problem}: succeeds with probability {claim}. Made by bbtc.")

    # --- nodes -------------------------------------------------------------------------------

    def _written(self, node: Node, place: _Place) -> Element:
        match node:
            case ControlNode():
                if node.attempts is not None:
                    counter = self.counters.setdefault(node.id, f"@attempts_{len(self.counters) + 1}")
                    place = place.counting(f"{counter} < {node.attempts}", f"{counter} += 1")
                    return self._written(node.children[0], place)
                if place.level >= _DEEPEST_XML:
                    return self._own_tree(node, place)
                element = _control(node.kind, [self._written(child, place.down()) for child in node.children])
                label = node.name or node.template or ("skipper" if node.kind == "skipper" else None)
                if label:
                    element.set("name", printable(label))
            case ConditionNode():
                element = self._condition(node, place)
            case ActionNode():
                element = self._action(node, place)
            case _:
                assert_never(node)
        if node.reason and not isinstance(node, ConditionNode):
            element.set("_description", printable(f"for {node.reason}"))
        return element

    def _own_tree(self, node: ControlNode, place: _Place) -> Element:
        tree_id = self.tree_ids.take(f"{place.tree_id}Part", seed=node.id)
        tree = Element("BehaviorTree", ID=tree_id)
        self.hoisted.append(tree)
        tree.append(self._written(node, place.inside(tree_id)))
        return Element("SubTree", ID=tree_id)

    def _condition(self, node: ConditionNode, place: _Place) -> Element:
        condition = normal(self.task, node.condition)
        element = self.conditions.write(condition, {})
        if self.conditions.uses_register(condition):
            if condition not in self.condition_trees:
                self.condition_trees[condition] = self._condition_tree(condition, element)
            tree_id = self.condition_trees[condition].attrib["ID"]
            label = node.name or words_of(self.task, condition).short
            return Element("SubTree", ID=tree_id, name=place.unique(printable(label)))
        if node.name:
            label = printable(node.name)
            element.set("name", place.unique(label) if element.tag == "SubTree" else label)
        return element

    def _condition_tree(self, condition: Condition, content: Element) -> Element:
        words = words_of(self.task, condition)
        tree_id = self.tree_ids.take(camel(words.short), seed=words.full)
        tree = Element("BehaviorTree", ID=tree_id)
        tree.set("_description", f"{words.full}, three-valued")
        tree.append(content)
        return tree

    def _action(self, node: ActionNode, place: _Place) -> Element:
        action = self.task.action_by_name[node.action]
        ports = self._ports(action)
        # A number passed to a SubTree changes its type from 4.9 on: it stays a literal inside.
        passed = {port: arg for port, arg in ports.items() if not is_numeric(arg)}
        binding = {arg: port for port, arg in reversed(passed.items())}
        tag = Element(self.names.ids[action_symbol(action)])
        for port, arg in ports.items():
            tag.set(port, f"{{{port}}}" if port in passed else self.names.values[arg])
        condition = guard_of(self.task, node)
        guard = None
        if condition is not None:
            guard = self.conditions.write(condition, binding)
        if place.counters:
            guard = _attempt(guard, place.counters)
        suffix = ("Once" if node.latched else "Again") + ("WhenReady" if guard is not None else "")
        key = (suffix, tostring(tag), None if guard is None else tostring(guard))
        if key not in self.action_trees:
            tree_id = self.tree_ids.take(f"{tag.tag}{suffix}", seed=repr(key))
            self.action_trees[key] = (_latched if node.latched else _unlatched)(tree_id, tag, guard)
            self.subtree_ports[tree_id] = tuple(passed)
        tree_id = self.action_trees[key].attrib["ID"]
        element = Element("SubTree", ID=tree_id, name=place.unique(printable(node.name or node.action)))
        for port in self.subtree_ports[tree_id]:
            element.set(port, self.names.values[ports[port]])
        return element

    def _ports(self, action: GroundAction) -> dict[str, str]:
        symbol = action_symbol(action)
        return dict(zip(self.names.interface.leaves[symbol].parameters, action.args, strict=True))

    # --- palette -----------------------------------------------------------------------------

    def _model(self) -> Element:
        model = Element("TreeNodesModel")
        for condition in self.names.interface.conditions:
            self._model_entry(model, "Condition", condition)
        for action in self.names.interface.actions:
            self._model_entry(model, "Action", action)
        for tree_id in sorted(self.subtree_ports):
            if self.subtree_ports[tree_id]:
                entry = SubElement(model, "SubTree", ID=tree_id)
                for port in self.subtree_ports[tree_id]:
                    SubElement(entry, "input_port", name=port, type="std::string")
        return model

    def _model_entry(self, model: Element, kind: str, entry: Leaf) -> None:
        element = SubElement(model, kind, ID=self.names.ids[entry.symbol])
        for position, port in enumerate(entry.parameters, 1):
            text = f"argument {position} of {entry.symbol.kind} {printable(entry.symbol.name)}"
            SubElement(element, "input_port", name=port, type="std::string").text = text


class _Place:
    """Where in a BehaviorTree the writer is. SubTree names are unique within one."""

    def __init__(
        self,
        tree_id: str,
        level: int = 0,
        uses: dict[str, int] | None = None,
        counters: tuple[tuple[str, str], ...] = (),
    ) -> None:
        self.tree_id = tree_id
        self.level = level
        self.counters = counters
        self._uses = {} if uses is None else uses

    def down(self) -> _Place:
        """One level further down."""
        return _Place(self.tree_id, self.level + 1, self._uses, self.counters)

    def counting(self, test: str, count: str) -> _Place:
        """Below a retry node: scripts that test for an attempt left, and count one."""
        return _Place(self.tree_id, self.level, self._uses, (*self.counters, (test, count)))

    def inside(self, tree_id: str) -> _Place:
        """At the top of a BehaviorTree of its own."""
        return _Place(tree_id, counters=self.counters)

    def unique(self, label: str) -> str:
        """The label; with a number from its second use on."""
        while True:
            count = self._uses[label] = self._uses.get(label, 0) + 1
            if count == 1:
                return label
            label = f"{label} #{count}"


def _control(kind: ControlKind, children: list[Element]) -> Element:
    # The engine refuses control nodes without children; they return the status they go on with.
    if children:
        return control(kind, children)
    match kind:
        case "sequence":
            return Element("AlwaysSuccess")
        case "fallback" | "retry":
            return Element("AlwaysFailure")
        case "skipper":
            running = Element("KeepRunningUntilFailure")
            SubElement(running, "AlwaysSuccess")
            return running
        case _:
            assert_never(kind)


def _attempt(guard: Element | None, counters: tuple[tuple[str, str], ...]) -> Element:
    """What must succeed before an action below retry nodes starts; then it is an attempt."""
    left = Element("ScriptCondition", code=" && ".join(test for test, _ in counters))
    made = Element("Script", code="; ".join(count for _, count in counters))
    return control("sequence", [*([] if guard is None else [guard]), left, made])


def _until_blocked(root: Element, counters: list[str]) -> Element:
    """The tree, and FAILURE as soon as it is running while no action is: nothing can change then,
    and a loop that ticks while RUNNING would never end. Counters are set to 0 in the first tick."""
    outer = control("skipper", [])
    outer.set("name", "until blocked")
    ticked = control("sequence", [Element("Script", code="@acting := false"), root])
    if counters:
        once = Element("RunOnce", then_skip="false")
        SubElement(once, "Script", code="; ".join(f"{counter} := 0" for counter in counters))
        ticked.insert(0, once)
    blocked = Element("Precondition", {"if": "!@acting", "else": "RUNNING"})
    SubElement(blocked, "AlwaysFailure", name="blocked: nothing can observe what is unknown")
    outer.extend([ticked, blocked])
    return outer


def _latched(tree_id: str, action: Element, guard: Element | None) -> Element:
    """Runs the action once. Its status is withheld until the next tick, because conditions to the
    left were read before its effect; then it is kept. Halted after its start counts as run."""
    tree = Element("BehaviorTree", ID=tree_id)
    latch = SubElement(tree, "Switch2", variable="{_latch}", case_1="success", case_2="failure")
    SubElement(latch, "AlwaysSuccess")
    SubElement(latch, "AlwaysFailure")
    action.set("_onSuccess", "_latch := 'success'")
    action.set("_onFailure", "_latch := 'failure'")
    action.set("_onHalted", "_latch := 'success'")
    running = _running(action, "@acting := true")
    if guard is None:
        latch.append(running)
    else:
        # With memory: once the action runs, its own effect may end its precondition.
        started = SubElement(latch, "Sequence", name="start when ready")
        started.extend([guard, running])
    return tree


def _unlatched(tree_id: str, action: Element, guard: Element | None) -> Element:
    """Runs the action whenever it is ticked, again and again."""
    tree = Element("BehaviorTree", ID=tree_id)
    if guard is None:
        tree.append(_running(action, "@acting := true"))
        return tree
    for event in ("_onSuccess", "_onFailure", "_onHalted"):
        action.set(event, "_started := 'no'")
    running = _running(action, "@acting := true; _started := 'yes'")
    ready = Element("Switch2", variable="{_started}", case_1="yes", case_2="never")
    SubElement(ready, "AlwaysSuccess")
    SubElement(ready, "AlwaysFailure")
    ready.append(guard)
    running.insert(0, ready)
    tree.append(running)
    return tree


def _running(action: Element, script: str) -> Element:
    keep = Element("KeepRunningUntilFailure")
    SubElement(keep, "ForceSuccess").append(action)
    return control("sequence", [Element("Script", code=script), keep])
