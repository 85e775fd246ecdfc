"""Exporter ``btcpp``: BehaviorTree.CPP v4 XML (4.6 and later).

Templates, action schemas and tests of knowledge have BehaviorTrees of their own; conditions are leaves
that return RUNNING for unknown. docs/export-btcpp.md explains every idiom.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from xml.etree.ElementTree import Comment, Element, SubElement, tostring

from typing_extensions import assert_never

from bbtc.backends.btcpp.bindings.bound import BINDINGS, bindings_of
from bbtc.backends.btcpp.bindings.entries import Bindings
from bbtc.backends.btcpp.conditions import ConditionWriter
from bbtc.backends.btcpp.holding import Holding, Ports
from bbtc.backends.btcpp.idioms import SKIPPER_LABEL, Idioms, Profile, forgotten, full_again
from bbtc.backends.btcpp.names import Labels, TreeIds, btcpp_names, is_numeric, ports_for, shown
from bbtc.backends.btcpp.notes import CLAIM, DIGITS, TEMPLATE, condition_below, notes, template_label
from bbtc.backends.btcpp.options import NAMESPACE, NODES, entry_prefix, namespace_of, profile_of, xml_text
from bbtc.backends.btcpp.palette import node_model
from bbtc.backends.commitment import Fact, facts_read, first_variable
from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.interface import action_symbol, during_of, guard_of, variable_symbol
from bbtc.backends.shape import fit, written
from bbtc.ground.condition import TRUE, And, Condition, Or, conjunction, variables
from bbtc.ground.task import GroundAction, Task, ground_name, split_name
from bbtc.rounding import brief
from bbtc.tree.deep import Deep, unwind
from bbtc.tree.nodes import (
    ActionNode,
    ConditionNode,
    ControlNode,
    Node,
    Tree,
    tries_without_end,
    walk,
)

ENGINE = "BehaviorTree.CPP"
_DEEPEST_XML = 120  # levels of a BehaviorTree before a subtree gets one of its own; the engine takes 256


@dataclass(frozen=True, slots=True)
class BtcppExporter:
    """Writes a tree as BehaviorTree.CPP v4 XML."""

    name: str = "btcpp"
    description: str = "BehaviorTree.CPP v4 XML with its TreeNodesModel"
    suffix: str = ".xml"
    options: tuple[Option, ...] = (
        NODES,
        NAMESPACE,
        BINDINGS,
        Option("model", True, "append the TreeNodesModel, which editors such as Groot2 read"),
        Option("notes", True, "append the comment from which `bbtc import` reads the very same tree"),
    )

    def export(self, tree: Tree, options: Mapping[str, OptionValue], figures: Figures | None) -> str:
        """The XML. Raises :class:`BbtcError` for a tree that is too deep (BBT0705), for a namespace
        that is none (BBT0704), and for bindings that have faults or do not fit the tree."""
        del figures  # a file that runs has no place for them
        namespace = namespace_of(self.name, options)
        writer = _Writer(tree, profile_of(options), namespace, bindings_of(options))
        document = writer.document(bool(options.get("model", True)), bool(options.get("notes", True)))
        return xml_text(document)


btcpp = BtcppExporter()


@dataclass(frozen=True, slots=True)
class _Place:
    """Where in a BehaviorTree the writer is: how deep, below which retry nodes, which objects are ports
    there, and, for each retry-until-success node around, the scripts that make what is below it forget."""

    tree_title: str
    level: int = 0
    counters: tuple[str, ...] = ()
    ports: Ports = field(default_factory=Ports)
    labels: Labels = field(default_factory=Labels)
    template: Node | None = None
    forget: tuple[list[str], ...] = ()

    def down(self) -> _Place:
        """One level further down."""
        return replace(self, level=self.level + 1)


@dataclass(frozen=True, slots=True)
class _Hoisted:
    """A BehaviorTree to make, unless there is one like it: its place among the others, and what its id
    is made of."""

    order: int
    title: str
    seed: str
    description: str


class _Writer:
    """Writes one document: BehaviorTrees are collected while the main tree is written."""

    def __init__(self, tree: Tree, profile: Profile, namespace: str, bindings: Bindings) -> None:
        self.tree = tree
        self.task: Task = tree.task
        self.names = btcpp_names(tree, namespace, bindings)
        self.profile: Profile = profile
        self.tree_ids = TreeIds(self.names, self.task.problem)
        prefix = entry_prefix(namespace)
        self.idioms = Idioms(profile, prefix, f"{prefix}{entry_prefix(self.task.problem)}")
        self.order: Iterator[int] = itertools.count()
        self.parts: dict[bytes, tuple[int, Element]] = {}
        self.action_trees: dict[tuple[str, bytes], Element] = {}
        self.subtree_ports: dict[str, tuple[str, ...]] = {}
        self.counters: Iterator[int] = itertools.count(1)
        self.latches: Iterator[int] = itertools.count(1)
        self.attempts: Iterator[int] = itertools.count(1)
        self.root = fit(tree.root, ENGINE)
        self.holding = Holding(replace(tree, root=self.root), self.names, self.idioms.own)
        if profile == "bbtc":
            held = (variable_symbol(self.task.variables[first_variable(fact)]) for fact in self.holding.facts)
            self.names.bound.refuse_held(held)
        self.conditions = ConditionWriter(self.task, self.names, self.tree_ids, self.idioms, self.holding)

    def document(self, model: bool, with_notes: bool) -> Element:
        """The whole document."""
        main_id = self.tree_ids.main
        document = Element("root", BTCPP_format="4", main_tree_to_execute=main_id)
        main = SubElement(document, "BehaviorTree", ID=main_id)
        main.set("_description", self._headline())
        root = self.root
        written_root = unwind(self._written(root, _Place(self.task.problem)))
        main.append(self.idioms.until_blocked(written_root, list(self.holding.entries.values())))
        document.extend(tree for _, tree in sorted(self.parts.values(), key=lambda part: part[0]))
        document.extend(self.conditions.trees.values())
        document.extend(self.action_trees.values())
        if model:
            ports = self.subtree_ports | self.conditions.ports
            document.append(node_model(self.task, self.names, self.profile, ports))
        if with_notes:
            document.append(Comment(notes(self.tree, root, self.names)))
        return document

    def _headline(self) -> str:
        task, claim = self.task, brief(self.tree.success_probability, DIGITS)
        unbounded = " Nothing bounds how often it tries." if tries_without_end(self.tree.root) else ""
        return shown(f"{task.domain}, {task.problem}: {CLAIM}{claim}.{unbounded} Made by bbtc.")

    # --- nodes -------------------------------------------------------------------------------

    def _written(self, node: Node, place: _Place) -> Deep[Element]:
        if node.template is not None and place.template is not node:
            templated: Element = yield self._template(node, node.template, place)
            return templated
        match node:
            case ControlNode():
                write = self._part if place.level >= _DEEPEST_XML else self._control
                element: Element = yield write(node, place)
            case ConditionNode():
                element = self._condition(node, place)
            case ActionNode():
                element = self._action(node, place)
            case _:
                assert_never(node)
        if node.reason and "_description" not in element.attrib:
            element.set("_description", f"for {shown(node.reason)}")
        return element

    def _control(self, node: ControlNode, place: _Place) -> Deep[Element]:
        if node.kind == "retry-until-success" and node.attempts is not None:
            state, scripts = self.idioms.attempt_state(next(self.attempts)), list[str]()
            inside = replace(place, level=place.level + 4, forget=(*place.forget, scripts))
            tried: Element = yield self._written(node.children[0], inside)
            element = self.idioms.retry_until_success(state, node.attempts, tried, scripts)
            if node.name:
                element.set("name", shown(node.name))
            return element
        if node.attempts is not None:
            counter = self.idioms.counter(next(self.counters))
            for scripts in place.forget:
                scripts.append(full_again(counter, node.attempts))
            inside = replace(place.down(), counters=(*place.counters, counter))
            child: Element = yield self._written(node.children[0], inside)
            element = self.idioms.retry(counter, node.attempts, child)
            if node.name:
                element.set("name", shown(node.name))
            return element
        children: list[Element] = []
        for each in node.children:
            children.append((yield self._written(each, place.down())))  # noqa: PERF401
        element = self.idioms.control(node.kind, children)
        below = condition_below(self.task, node) if node.name else None
        if below is not None and self.conditions.label(below, place.ports) == shown(node.name or ""):
            return element  # with that name it would be one condition
        if node.name:
            element.set("name", shown(node.name))
        elif element.tag == "Parallel":
            element.set("name", SKIPPER_LABEL)
        return element

    def _part(self, node: ControlNode, place: _Place) -> Deep[Element]:
        """A subtree in a BehaviorTree of its own, because it stands deep."""
        hoisted = _Hoisted(next(self.order), f"{place.tree_title}Part", node.id, "")
        inside = replace(place, tree_title=hoisted.title, level=0, labels=Labels())
        content: Element = yield self._written(node, inside)
        element = self._call(hoisted, content, place.ports.names())
        for port in place.ports.names():
            element.set(port, f"{{{port}}}")
        return element

    def _template(self, node: Node, template: str, place: _Place) -> Deep[Element]:
        """The expansion of a template: a BehaviorTree with its arguments as ports, which expansions that
        differ in nothing else share."""
        symbol, args = split_name(template)
        hoisted = _Hoisted(next(self.order), symbol, template, f"{TEMPLATE} {shown(symbol)}")
        ports = self._argument_ports(node, args)
        inside = _Place(symbol, counters=place.counters, ports=ports, template=node, forget=place.forget)
        content: Element = yield self._written(node, inside)
        ports = ports.used_in(content)
        element = self._call(hoisted, content, ports.names())
        element.set("name", place.labels.unique(template_label(template)))
        self.conditions.give(element, ports, place.ports)
        return element

    def _call(self, hoisted: _Hoisted, content: Element, ports: tuple[str, ...]) -> Element:
        """A SubTree that calls a BehaviorTree with this content, which is made unless there is one."""
        key = repr((hoisted.title, ports)).encode() + tostring(content)
        if key not in self.parts:
            tree = Element("BehaviorTree", ID=self.tree_ids.take(hoisted.title, seed=hoisted.seed))
            if hoisted.description:
                tree.set("_description", hoisted.description)
            tree.append(content)
            self.parts[key] = hoisted.order, tree
            self.subtree_ports[tree.attrib["ID"]] = ports
        return Element("SubTree", ID=self.parts[key][1].attrib["ID"])

    def _argument_ports(self, root: Node, args: tuple[str, ...]) -> Ports:
        """A port for every argument of a template that the leaves of its expansion name, and for every fact
        about one that may be held."""
        uses: list[tuple[str, str]] = []
        facts: list[Fact] = []
        for node in walk(root):
            read: Condition = TRUE
            if isinstance(node, ConditionNode):
                read = written(self.task, node.condition)
            elif isinstance(node, ActionNode):
                action = self.task.action_by_name[node.action]
                uses += self._ports(action)
                read = conjunction((guard_of(self.task, node) or TRUE, during_of(self.task, node) or TRUE))
                facts += self.holding.by_action.get(node.action, ())
            facts += facts_read(self.task, read)
            for variable in (self.task.variables[index] for index in variables(read)):
                parameters = self.names.interface.leaves[variable_symbol(variable)].parameters
                uses += zip(parameters, variable.args, strict=True)
        ports = ports_for((parameter, arg) for parameter, arg in uses if arg in args)
        return self.conditions.shared(facts, {arg: ports[arg] for arg in dict.fromkeys(args) if arg in ports})

    def _condition(self, node: ConditionNode, place: _Place) -> Element:
        condition = written(self.task, node.condition)
        label = shown(node.name) if node.name else None
        compound = isinstance(condition, (And, Or))
        if self.conditions.uses_register(condition) or (compound and label):
            element = self.conditions.write_apart(condition, place.ports)
            auto = self.conditions.label(condition, place.ports)
            element.set("name", place.labels.unique(label or auto))
            return element
        element = self.conditions.write(condition, place.ports)
        if label:
            element.set("name", place.labels.unique(label) if element.tag == "SubTree" else label)
        return element

    def _action(self, node: ActionNode, place: _Place) -> Element:
        action = self.task.action_by_name[node.action]
        args, held = place.ports.args, self.holding.by_action.get(node.action, ())
        auto = ground_name(action.schema, tuple(args.get(arg, arg) for arg in action.args))
        label = shown(node.name or auto)
        guard = guard_of(self.task, node)
        forgets = node.latched and bool(place.forget)
        entry = self.idioms.latch_entry(next(self.latches)) if forgets else None
        if entry is not None:
            for scripts in place.forget:
                scripts.append(forgotten(entry))
        if self.profile == "bbtc":
            tag = self._limited(self._leaf(action, place.ports), action)
            needed = self._start_conditions(guard, place.ports, place.counters)
            element = self.idioms.latch(tag, needed, node.latched, self._during(node, place.ports))
            given = {"name": label, "entry": entry, "sets": self.holding.named(held, args)}
            element.attrib |= {name: value for name, value in given.items() if value}
            return element
        tree_id, inside = self._action_tree(node, action, guard, place.counters, entry)
        element = Element("SubTree", ID=tree_id, name=place.labels.unique(label))
        for port, arg in self._ports(action):
            if port in self.subtree_ports[tree_id]:
                element.set(port, self.conditions.value(arg, place.ports))
        self.conditions.give(element, Ports(facts=inside.facts), place.ports)
        return element

    def _action_tree(
        self,
        node: ActionNode,
        action: GroundAction,
        guard: Condition | None,
        counters: tuple[str, ...],
        entry: str | None,
    ) -> tuple[str, Ports]:
        """The id of the BehaviorTree that runs actions of a schema, and its ports; ``entry`` is where one
        that is latched for an attempt keeps how it ended."""
        # A number passed to a SubTree changes its type from 4.9 on: it stays a literal inside.
        passed = {port: arg for port, arg in self._ports(action) if not is_numeric(arg)}
        args = {arg: port for port, arg in reversed(passed.items())}
        symbol, value = action_symbol(action), partial(self.conditions.value, ports=Ports(args))
        tag = self.names.bound.element(symbol, action.args, value)
        if tag is None:
            tag = Element(self.names.ids[symbol])
            for port, arg in self._ports(action):
                tag.set(port, f"{{{port}}}" if port in passed else self.names.values[arg])
        tag = self._limited(tag, action)
        held = self.holding.by_action.get(node.action, ())
        used = [*held, *facts_read(self.task, guard or TRUE)]
        ports = self.holding.ports(used, args)
        needed = self._start_conditions(guard, ports, counters, held)
        title = self.names.plain[action_symbol(action)]
        often = "Again" if not node.latched else "Once" if entry is None else "OnceAnAttempt"
        title += often + ("WhenReady" if guard is not None or counters else "")
        during = self._during(node, ports)
        if entry is not None:
            content = self.idioms.latched(tag, needed, during, entry)
        else:
            content = (self.idioms.latched if node.latched else self.idioms.unlatched)(tag, needed, during)
        key, ports = (title, tostring(content)), ports.used_in(content)
        if key not in self.action_trees:
            tree_id = self.tree_ids.take(title, seed=repr(key))
            self.action_trees[key] = Element("BehaviorTree", ID=tree_id)
            self.action_trees[key].append(content)
            self.subtree_ports[tree_id] = (*passed, *ports.facts.values())
        return self.action_trees[key].attrib["ID"], ports

    def _during(self, node: ActionNode, ports: Ports) -> Element | None:
        """What must stay true while the action goes on, read as it is."""
        during = during_of(self.task, node)
        if during is None:
            return None
        return self.conditions.write(written(self.task, during), replace(ports, live=True))

    def _start_conditions(
        self, guard: Condition | None, ports: Ports, counters: tuple[str, ...], held: Sequence[Fact] = ()
    ) -> list[Element]:
        read = None if guard is None else self.conditions.write(written(self.task, guard), ports)
        return self.idioms.start_conditions(read, counters, self.conditions.notes(held, ports))

    def _leaf(self, action: GroundAction, ports: Ports) -> Element:
        value = partial(self.conditions.value, ports=ports)
        element = self.names.bound.element(action_symbol(action), action.args, value)
        if element is None:
            element = Element(self.names.ids[action_symbol(action)])
            for port, arg in self._ports(action):
                element.set(port, value(arg))
        return element

    def _limited(self, leaf: Element, action: GroundAction) -> Element:
        return leaf if action.timeout is None else self.idioms.given_up(leaf, action.timeout)

    def _ports(self, action: GroundAction) -> list[tuple[str, str]]:
        parameters = self.names.interface.leaves[action_symbol(action)].parameters
        return list(zip(parameters, action.args, strict=True))
