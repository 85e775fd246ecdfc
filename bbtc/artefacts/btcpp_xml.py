"""BehaviorTree.CPP files that bbtc wrote, read back into a tree, by hand edited ones too.

The file is read by its nodes, not by its notes: what a person changed counts. Every SubTree is put in
its place. What a tree cannot hold is reported with its place. The inverse of :mod:`bbtc.export.btcpp`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from bbtc.artefacts.btcpp_conditions import ConditionReader
from bbtc.artefacts.btcpp_leaves import NOT_PORTS, Leaves, Unreadable, unreadable
from bbtc.artefacts.btcpp_notes import Notes, read_notes, with_notes
from bbtc.artefacts.btcpp_patterns import (
    ActionParts,
    action_of,
    has,
    inside_register,
    inside_until_blocked,
    is_skipper,
    retry_of,
    tag_of,
)
from bbtc.artefacts.cursor import clip
from bbtc.artefacts.xmltext import XmlDocument, XmlElement, parse_xml
from bbtc.diagnostics import BbtcError, Diagnostic, Report, Severity
from bbtc.export.btcpp_idioms import LATCH, SKIPPER_LABEL, is_retry_label
from bbtc.export.btcpp_names import shown, without_number
from bbtc.export.btcpp_notes import TEMPLATE
from bbtc.export.interface import guard_of
from bbtc.export.shape import words_of, written
from bbtc.ground.condition import TRUE, And, Condition, Or
from bbtc.ground.task import Task, ground_name
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.tree.deep import Deep, unwind
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree, walk
from bbtc.tree.validate import MAX_DEPTH, ChildPath, tree_problems

_MOST_FAULTS = 50
_MOST_READ = 30  # elements of a file for each node that a tree may have
_REASON = "for "

_HINTS = {
    "Sequence": "it has memory; a tree reads its conditions in every tick: use ReactiveSequence",
    "SequenceWithMemory": "it has memory; a tree reads its conditions in every tick: use ReactiveSequence",
    "Fallback": "it has memory; a tree reads its conditions in every tick: use ReactiveFallback",
    "RetryUntilSuccessful": "several attempts stand side by side in a ReactiveFallback",
    "Parallel": 'only one with success_count="1" failure_count="1", a skipper, has a counterpart',
    "include": "put the trees of the other file into this one",
}


@dataclass(frozen=True, slots=True)
class Scope:
    """Where in the file the reader is: the values of the ports there, the BehaviorTrees around, and the
    retry nodes around, each with its counter."""

    ports: Mapping[str, str] = field(default_factory=dict)
    trees: tuple[str, ...] = ()
    counters: tuple[str, ...] = ()
    level: int = 1

    def down(self) -> Scope:
        """One level of the tree further down."""
        return replace(self, level=self.level + 1)


def tree_from_btcpp(
    source: SourceFile, task: Task, report: Report, limits: Limits | None = None, namespace: str = ""
) -> Tree:
    """The tree of a BehaviorTree.CPP file, on a task. The planner's claim is that of the file's notes;
    without them it is 0, for nobody claimed anything. ``namespace`` is that of the ids, where the notes
    do not tell.

    Raises :class:`BbtcError` with everything that cannot be read, and :class:`LimitReached` for a tree of
    more nodes than the limits allow. Doubts go to the report.
    """
    document = parse_xml(source)
    notes = read_notes(document, namespace)
    if notes is None:
        message = "the notes at the end of the file cannot be read: ids and claims are made anew"
        report.add(Diagnostic("BBT0617", message, document.span(document.root), None, Severity.WARNING))
        notes = read_notes(XmlDocument(source, document.root, ()), namespace) or Notes()
    if notes.problem is not None and (notes.domain, notes.problem) != (task.domain, task.problem):
        about = clip(f"{notes.domain}/{notes.problem}")
        message = f"the tree is for {about}, the task is {clip(f'{task.domain}/{task.problem}')}"
        raise BbtcError.single("BBT0604", message, document.span(document.root))
    reader = _Reader(document, task, notes, limits or Limits())
    root = unwind(reader.main())
    reader.raise_faults()
    tree = Tree(
        task,
        root,
        notes.success_probability or Fraction(0),
        task.goal_probability if notes.target is None else notes.target,
        notes.status,
        notes.bounds,
    )
    tree = with_notes(tree, notes)
    (limits or Limits()).check_nodes(sum(1 for _ in walk(root)))
    problems = [
        Diagnostic(p.code, p.message, document.span(reader.place(root, p.path)), p.hint)
        for p in tree_problems(tree)
    ]
    if problems:
        raise BbtcError(problems)
    return tree


class _Reader:
    def __init__(self, document: XmlDocument, task: Task, notes: Notes, limits: Limits) -> None:
        self._document = document
        self._task = task
        self._limits = limits
        self._faults: list[Diagnostic] = []
        self._read = 0
        self.places: dict[int, XmlElement] = {}
        self._trees = {
            tree.attributes["ID"]: tree
            for tree in reversed(document.root.children)
            if tree.tag == "BehaviorTree" and "ID" in tree.attributes
        }
        self._leaves = Leaves(task, document, notes.names)
        self._conditions = ConditionReader(document, self._leaves, self._call, self._count)

    def raise_faults(self) -> None:
        """Raise :class:`BbtcError` if anything could not be read."""
        if self._faults:
            raise BbtcError(self._faults)

    def place(self, root: Node, path: ChildPath) -> XmlElement:
        """The element that a node was read from."""
        node = root
        for number in path:
            assert isinstance(node, ControlNode)
            node = node.children[number]
        return self.places[id(node)]

    # --- the file ----------------------------------------------------------------------------

    def main(self) -> Deep[Node]:
        """The tree that the file runs."""
        root = self._document.root
        if root.tag != "root" or root.attributes.get("BTCPP_format") != "4":
            self._refuse(root, 'a BehaviorTree.CPP file of version 4 begins with <root BTCPP_format="4">')
        if not self._trees:
            self._refuse(root, "the file has no BehaviorTree")
        for element in root.children:
            if element.tag == "include":
                message, hint = self._no_counterpart(element)
                self._fault(unreadable(self._document, element, "BBT0616", message, hint=hint))
        name = root.attributes.get("main_tree_to_execute")
        if name is None and len(self._trees) > 1:
            self._refuse(root, "the file does not tell its main_tree_to_execute")
        name = next(iter(self._trees)) if name is None else name
        if name not in self._trees:
            self._refuse(root, f"the file has no BehaviorTree '{clip(name)}'", "main_tree_to_execute")
        try:
            content = self._content(self._trees[name])
        except Unreadable as found:
            raise BbtcError([found.diagnostic]) from None
        inner = inside_until_blocked(content)
        node: Node = yield self._node(content if inner is None else inner, Scope(trees=(name,)))
        return node

    def _refuse(self, element: XmlElement, message: str, attribute: str | None = None) -> None:
        raise BbtcError.single("BBT0615", message, self._document.span(element, attribute))

    def _content(self, tree: XmlElement) -> XmlElement:
        if len(tree.children) != 1:
            raise unreadable(
                self._document, tree, "BBT0615", f"a BehaviorTree holds one node, not {len(tree.children)}"
            )
        return tree.children[0]

    def _call(self, element: XmlElement, scope: Scope) -> tuple[XmlElement, Scope]:
        """The content of the BehaviorTree that a SubTree calls, and the scope inside it."""
        tree_id = element.attributes.get("ID", "")
        if tree_id not in self._trees:
            message = f"the file has no BehaviorTree '{clip(tree_id)}'"
            raise unreadable(self._document, element, "BBT0606", message, attribute="ID")
        if tree_id in scope.trees:
            message = f"BehaviorTree '{clip(tree_id)}' calls itself"
            raise unreadable(self._document, element, "BBT0612", message)
        if len(scope.trees) >= MAX_DEPTH:
            message = f"SubTrees are nested at most {MAX_DEPTH} times"
            raise unreadable(self._document, element, "BBT0605", message)
        inherited = element.attributes.get("_autoremap") in ("true", "1")
        ports = dict(scope.ports) if inherited else {}
        for name in element.attributes:
            if name not in NOT_PORTS and not name.startswith("_"):
                ports[name] = self._leaves.value(element, name, scope.ports)
        self._check_attributes(element, ("_autoremap",))
        return self._content(self._trees[tree_id]), replace(scope, ports=ports, trees=(*scope.trees, tree_id))

    # --- nodes -------------------------------------------------------------------------------

    def _node(self, element: XmlElement, scope: Scope) -> Deep[Node]:
        """The node; where it cannot be read, that goes on record and any node stands in for it."""
        try:
            if scope.level > MAX_DEPTH:
                message = f"a tree has at most {MAX_DEPTH} levels"
                raise unreadable(self._document, element, "BBT0605", message)
            self._count()
            node: Node = yield self._read_node(element, scope)
        except Unreadable as found:
            self._fault(found)
            return ConditionNode("", TRUE)
        reason = element.attributes.get("_description", "")
        if reason.startswith(_REASON):
            node = replace(node, reason=reason.removeprefix(_REASON) or None)
        self.places[id(node)] = element
        return node

    def _count(self) -> None:
        """An element has been read, in a place of its own: SubTrees that call SubTrees may make very many
        of a few."""
        self._read += 1
        if self._read > _MOST_READ * self._limits.nodes:
            raise self._limits.reached(
                f"the tree is much larger than the limit of {self._limits.nodes} nodes", "--max-nodes"
            )

    def _fault(self, found: Unreadable) -> None:
        self._faults.append(found.diagnostic)
        if len(self._faults) >= _MOST_FAULTS:
            self.raise_faults()

    def _read_node(self, element: XmlElement, scope: Scope) -> Deep[Node]:
        self._check_attributes(element)
        parts = action_of(element)
        if parts is not None:
            action: Node = yield self._action(element, parts, scope)
            return action
        if has(element, "SubTree"):
            called: Node = yield self._subtree(element, scope)
            return called
        retry = retry_of(element)
        if retry is not None:
            retried: Node = yield self._retry(element, *retry, scope)
            return retried
        condition: Condition | None = yield self._condition(element, scope)
        if condition is not None:
            return ConditionNode("", condition, self._condition_name(element, condition, scope))
        kind = self._kind(element)
        children: list[Node] = []
        for child in element.children:
            children.append((yield self._node(child, scope.down())))  # noqa: PERF401
        if not children:
            message = f"'{clip(tag_of(element))}' has no children"
            raise unreadable(self._document, element, "BBT0611", message)
        name = element.attributes.get("name") or None
        if has(element, "Parallel") and name == SKIPPER_LABEL:
            name = None
        return ControlNode("", kind, tuple(children), name)

    def _kind(self, element: XmlElement) -> ControlKind:
        if has(element, "ReactiveSequence"):
            return "sequence"
        if has(element, "ReactiveFallback"):
            return "fallback"
        if is_skipper(element):
            return "skipper"
        message, hint = self._no_counterpart(element)
        raise unreadable(self._document, element, "BBT0616", message, hint=hint)

    def _no_counterpart(self, element: XmlElement) -> tuple[str, str | None]:
        name = tag_of(element)
        if self._leaves.is_action(element):
            return (
                f"the action '{clip(name)}' stands by itself",
                f"put it into a {LATCH}, or call the BehaviorTree that runs it once",
            )
        return f"'{clip(name)}' has no counterpart in a tree", _HINTS.get(name)

    def _check_attributes(self, element: XmlElement, allowed: tuple[str, ...] = ()) -> None:
        for name in element.attributes:
            if name.startswith("_") and name != "_description" and name not in allowed:
                message = f"the attribute '{clip(name)}' has no counterpart in a tree"
                raise unreadable(self._document, element, "BBT0616", message, attribute=name)

    def _retry(
        self, element: XmlElement, counter: str, attempts: int, child: XmlElement, scope: Scope
    ) -> Deep[Node]:
        inside = replace(scope.down(), counters=(*scope.counters, counter))
        node: Node = yield self._node(child, inside)
        name = element.attributes.get("name") or None
        if name is not None and is_retry_label(name):
            name = None
        return ControlNode("", "retry", (node,), name, attempts=attempts)

    def _subtree(self, element: XmlElement, scope: Scope) -> Deep[Node]:
        content, inside = self._call(element, scope)
        label = without_number(element.attributes.get("name", "")) or None
        description = self._trees[element.attributes["ID"]].attributes.get("_description", "")
        template = description.startswith(f"{TEMPLATE} ")
        if not template:
            parts = action_of(content)
            if parts is not None:
                action: Node = yield self._action(element, parts, inside, scope)
                return action
            condition: Condition | None = yield self._condition(content, inside)
            if condition is not None:
                return ConditionNode("", condition, self._condition_name(element, condition, scope))
        node: Node = yield self._node(content, inside)
        if template:
            return replace(node, template=label or TEMPLATE)
        return node if label is None or node.name is not None else replace(node, name=label)

    # --- conditions --------------------------------------------------------------------------

    def _condition(self, element: XmlElement, scope: Scope) -> Deep[Condition | None]:
        """The condition that an element is written for; None if it is a control node."""
        if inside_register(element) is not None:
            held: Condition = yield self._conditions.read(element, scope)
            return written(self._task, held)
        if has(element, "ReactiveSequence") or has(element, "ReactiveFallback"):
            # Conditions side by side: one condition if the name says so, otherwise each its own.
            if "name" not in element.attributes or not self._conditions.could_be(element):
                return None
            read: Condition = yield self._conditions.read(element, scope)
            exact = written(self._task, read) == read and isinstance(read, (And, Or))
            label = words_of(self._task, read, self._binding(scope)).short
            return read if exact and label == element.attributes["name"] else None
        if not self._conditions.is_condition(element):
            return None
        condition: Condition = yield self._conditions.read(element, scope)
        return written(self._task, condition)

    def _condition_name(self, element: XmlElement, condition: Condition, scope: Scope) -> str | None:
        name = element.attributes.get("name", "")
        if has(element, "SubTree"):
            name = without_number(name)
        return name if name and name != words_of(self._task, condition, self._binding(scope)).short else None

    def _binding(self, scope: Scope) -> dict[str, str]:
        """The port that stands for each object in this BehaviorTree."""
        found: dict[str, str] = {}
        for port, value in scope.ports.items():
            name = self._leaves.object_of(value)
            if name is not None:
                found.setdefault(name, port)
        return found

    # --- actions -----------------------------------------------------------------------------

    def _action(
        self, element: XmlElement, parts: ActionParts, inside: Scope, outside: Scope | None = None
    ) -> Deep[Node]:
        """The action node of an idiom. ``element`` carries its label; the idiom itself may stand in a
        BehaviorTree, with a scope ``inside`` it."""
        if self._leaves.is_leaf(parts.leaf) and not parts.leaf.children:
            name = self._leaves.action(parts.leaf, inside.ports)
        else:
            message, hint = self._no_counterpart(parts.leaf)
            raise unreadable(self._document, parts.leaf, "BBT0616", message, hint=hint)
        guarded = yield self._guarded(parts, name, inside)
        if parts.counters != inside.counters:
            message = f"'{clip(name)}' must use up an attempt of each retry node around it, and of no other"
            hint = f"here: {', '.join(inside.counters) or 'none'}"
            raise unreadable(self._document, element, "BBT0613", message, hint=hint)
        action = self._task.action_by_name[name]
        binding = self._binding(inside if outside is None else outside)
        auto = ground_name(action.schema, tuple(binding.get(arg, arg) for arg in action.args))
        label = element.attributes.get("name", "")
        if has(element, "SubTree"):
            label = without_number(label)
        own = label if label and label != shown(auto) else None
        return ActionNode("", name, parts.latched, bool(guarded), own)

    def _guarded(self, parts: ActionParts, name: str, scope: Scope) -> Deep[bool]:
        """Whether the precondition is read before the action starts; nothing else may be."""
        if not parts.guards:
            return False
        guard = guard_of(self._task, ActionNode("", name, guarded=True))
        if len(parts.guards) == 1 and guard is not None:
            read: Condition = yield self._conditions.read(parts.guards[0], scope)
            if written(self._task, read) == written(self._task, guard):
                return True
        message = f"what stands before '{clip(name)}' is not its precondition"
        hint = "other conditions stand before the whole, in a ReactiveSequence"
        raise unreadable(self._document, parts.guards[0], "BBT0616", message, hint=hint)
