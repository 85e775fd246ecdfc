"""BehaviorTree.CPP files that bbtc wrote, read back into a tree, by hand edited ones too.

The file is read by its nodes, not by its notes: what a person changed counts. Every SubTree is put in
its place. What a tree cannot hold is reported with its place. The inverse of
:mod:`bbtc.backends.btcpp.exporter`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.bindings.entries import Bindings
from bbtc.backends.btcpp.idioms import (
    HELD,
    LATCH,
    SKIPPER_LABEL,
    UNTIL_SUCCESS,
    attempt_ends,
    forgotten,
    full_again,
    is_retry_label,
)
from bbtc.backends.btcpp.names import is_numeric, shown, without_number
from bbtc.backends.btcpp.notes import CLAIM, DIGITS, TEMPLATE
from bbtc.backends.btcpp.reader.conditions import ConditionReader
from bbtc.backends.btcpp.reader.holding import Holds
from bbtc.backends.btcpp.reader.layout import Layout, is_port
from bbtc.backends.btcpp.reader.leaves import Leaves
from bbtc.backends.btcpp.reader.limits import GIVEN_UP, GIVEN_UP_ONCE, check_limit
from bbtc.backends.btcpp.reader.notes import Notes, read_notes, with_notes
from bbtc.backends.btcpp.reader.patterns import (
    NOT_COMMITTED,
    READ,
    REGISTER,
    RETRY,
    TRIED,
    UNTIL_BLOCKED,
    ActionParts,
    action_of,
)
from bbtc.backends.btcpp.reader.scope import Scope
from bbtc.backends.btcpp.reader.shapes import Match, boolean_of, has, is_skipper, match, match_one, tag_of
from bbtc.backends.btcpp.reader.unbound import put_back
from bbtc.backends.btcpp.reader.unread import Unread, unreadable
from bbtc.backends.btcpp.xmltext import XmlElement, parse_xml
from bbtc.backends.interface import during_of, guard_of
from bbtc.backends.shape import words_of, written
from bbtc.diagnostics import BbtcError, Diagnostic, Report, Unreadable
from bbtc.ground.condition import TRUE, And, Condition, Or
from bbtc.ground.task import Task, ground_name
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.tree.deep import Deep, unwind
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlKind, ControlNode, Node, Tree, walk
from bbtc.tree.validate import MAX_DEPTH, tree_problems

_MOST_FAULTS = 50
_MOST_READ = 30  # elements of a file for each node that a tree may have
_REASON = "for "
_TOLD = re.compile(rf"{re.escape(CLAIM)}([0-9]{{1,{DIGITS}}}(?:/0*[1-9][0-9]{{0,{DIGITS - 1}}})?)(?![0-9/])")

_HINTS = {
    "Sequence": "it has memory; a tree reads its conditions in every tick: use ReactiveSequence",
    "SequenceWithMemory": "it has memory; a tree reads its conditions in every tick: use ReactiveSequence",
    "Fallback": "it has memory; a tree reads its conditions in every tick: use ReactiveFallback",
    UNTIL_SUCCESS: "alone, it does not end what is remembered below it: docs/export-btcpp.md has its form",
    HELD: "it stands around one condition",
    "Parallel": 'only one with success_count="1" failure_count="1", a skipper, has a counterpart',
}


@dataclass(frozen=True, slots=True)
class Imported:
    """The tree of a file; the success probability that its notes claim, None where nobody claims any; and
    the one that the description of its main tree tells to readers."""

    tree: Tree
    claimed: Fraction | None
    told: Fraction | None


def tree_from_btcpp(
    source: SourceFile,
    task: Task,
    report: Report,
    limits: Limits | None = None,
    *,
    namespace: str = "",
    main: str | None = None,
    bindings: Bindings | None = None,
) -> Imported:
    """The tree of a BehaviorTree.CPP file, on a task. Its success probability is what the file's notes
    claim, or 0 without a meaning where they claim nothing. ``namespace`` is that of the ids, where the notes
    do not tell; ``main`` the id of the tree to read, where it is not the one that the file runs; ``bindings``
    are those that it was exported with.

    Raises :class:`BbtcError` with everything that cannot be read, and :class:`LimitReached` for a tree of
    more nodes than the limits allow. Doubts go to the report.
    """
    limits = limits or Limits()
    document = parse_xml(source)
    notes = read_notes(document, namespace)
    if notes is None:
        message = "the notes at the end of the file cannot be read: ids and claims are made anew"
        report.add(Diagnostic("BBT0617", message, document.span(document.root)))
        notes = read_notes(replace(document, comments=()), namespace) or Notes()
    if notes.problem is not None and (notes.domain, notes.problem) != (task.domain, task.problem):
        about = clip(f"{notes.domain}/{notes.problem}")
        message = f"the tree is for {about}, the task is {clip(f'{task.domain}/{task.problem}')}"
        raise BbtcError.single("BBT0604", message, document.span(document.root))
    if bindings is not None:
        put_back(document, task, notes.names, bindings)
    layout = Layout(document, main)
    reader = _Reader(layout, task, notes, limits)
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
    limits.check_nodes(sum(1 for _ in walk(root)))
    problems = [
        replace(each, span=document.span(reader.place(root, each.path)), path=())
        for each in islice(tree_problems(tree), _MOST_FAULTS)
    ]
    if problems:
        raise BbtcError(problems)
    for doubt in reader.doubts(tree):
        report.add(doubt)
    told = _TOLD.search(layout.trees[layout.main].attributes.get("_description", ""))
    return Imported(tree, notes.success_probability, None if told is None else Fraction(told.group(1)))


class _Reader:
    def __init__(self, layout: Layout, task: Task, notes: Notes, limits: Limits) -> None:
        self._layout = layout
        self._document = layout.document
        self._task = task
        self._limits = limits
        self._faults: list[Diagnostic] = []
        self._read = self._nodes = 0
        self.places: dict[int, XmlElement] = {}
        self._flag: str | None = None
        self._running = ""
        self._counters: set[str] = set()
        self._entries: dict[tuple[str, str], XmlElement] = {}
        self._unread = Unread(self._document)
        self._leaves = Leaves(task, self._document, notes.names, self._unread)
        self._holds = Holds(self._document, self._leaves)
        self._conditions = ConditionReader(
            task,
            self._document,
            self._leaves,
            self._unread,
            self._holds,
            call=self._call,
            count=self._count,
        )

    def raise_faults(self) -> None:
        """Raise :class:`BbtcError` if anything could not be read, or was not."""
        reachable = self._layout.reachable()
        self._faults += islice(self._holds.faults(), _MOST_FAULTS)
        left = self._unread.left(reachable, whole=not self._faults)
        self._faults += islice(left, _MOST_FAULTS)
        if self._faults:
            self._faults += islice(self._strangers(reachable), _MOST_FAULTS)
        self._raise(self._faults)

    def _strangers(self, trees: Iterable[XmlElement]) -> Iterator[Diagnostic]:
        """What has no counterpart anywhere, also where nobody has looked because something else is wrong."""
        for tree in trees:
            stack = list(reversed(tree.children))
            while stack:
                element = stack.pop()
                if tag_of(element) not in READ and not self._leaves.is_leaf(element):
                    message, hint = self._no_counterpart(element)
                    yield unreadable(self._document, element, "BBT0616", message, hint=hint).diagnostic
                stack.extend(reversed(element.children))

    @staticmethod
    def _raise(faults: list[Diagnostic]) -> None:
        if faults:
            # In the order of the file, once each: a BehaviorTree may be read in many places.
            unique = {(d.span.start if d.span else 0, d.code, d.message): d for d in faults}
            raise BbtcError([unique[key] for key in sorted(unique)][:_MOST_FAULTS])

    def doubts(self, tree: Tree) -> Iterator[Diagnostic]:
        """What the file does that the tree does not tell, though it could be read."""
        called = {tree.attributes["ID"] for tree in self._layout.reachable()}
        spare = [name for name in self._layout.trees if name not in called]
        if spare:
            listed = clip(", ".join(spare))
            place = self._document.span(self._layout.trees[spare[0]], "ID")
            message = f"not part of the tree, as '{clip(self._layout.main)}' does not call it: {listed}"
            yield Diagnostic("BBT0618", message, place, "give --tree ID for another")
        if self._flag is None:
            message = "where nothing can go on, the tree fails, but the file is RUNNING for ever"
            hint = "export the tree anew: its branch 'until blocked' is missing in the file"
            place = self._document.span(self._layout.trees[self._layout.main])
            yield Diagnostic("BBT0620", message, place, hint)
        yield from self._holds.doubts(tree)

    def place(self, root: Node, path: Sequence[str | int]) -> XmlElement:
        """The element that a node was read from."""
        node = root
        for number in path:
            assert isinstance(node, ControlNode)
            assert isinstance(number, int)
            node = node.children[number]
        return self.places[id(node)]

    # --- the file ----------------------------------------------------------------------------

    def main(self) -> Deep[Node]:
        """The tree that the file runs."""
        self._faults += islice(self._layout.faults(self._unread), _MOST_FAULTS)
        scope = Scope(trees=(self._layout.main,))
        try:
            content = self._enter(self._layout.main)
            guard = match_one((*UNTIL_BLOCKED, NOT_COMMITTED), content)
            if guard is not None:
                self._unread.take(guard)
                self._flag = guard.texts.get("flag", "acting")
                self._running = guard.texts.get("running", "")
                self._holds.set_back = frozenset(re.findall(r"@\w+", guard.texts.get("live", "")))
                content = guard.part("tree")
        except Unreadable as found:
            raise BbtcError([found.diagnostic]) from None
        node: Node = yield self._node(content, scope)
        return node

    def _enter(self, name: str) -> XmlElement:
        """The node in a BehaviorTree."""
        tree = self._layout.trees[name]
        self._unread.took(tree, "ID")
        if len(tree.children) != 1:
            raise unreadable(
                self._document, tree, "BBT0615", f"a BehaviorTree holds one node, not {len(tree.children)}"
            )
        return tree.children[0]

    def _call(self, element: XmlElement, scope: Scope) -> tuple[XmlElement, Scope]:
        """The content of the BehaviorTree that a SubTree calls, and the scope inside it."""
        tree_id = element.attributes.get("ID", "")
        if tree_id not in self._layout.trees:
            message = f"the file has no BehaviorTree '{clip(tree_id)}'"
            raise unreadable(self._document, element, "BBT0606", message, attribute="ID")
        if tree_id in scope.trees:
            message = f"BehaviorTree '{clip(tree_id)}' calls itself"
            raise unreadable(self._document, element, "BBT0612", message)
        if len(scope.trees) >= MAX_DEPTH:
            message = f"SubTrees are nested at most {MAX_DEPTH} times"
            raise unreadable(self._document, element, "BBT0605", message)
        ports = self._ports(element, tree_id, scope)
        return self._enter(tree_id), replace(scope, ports=ports, trees=(*scope.trees, tree_id))

    def _ports(self, element: XmlElement, tree_id: str, scope: Scope) -> dict[str, str]:
        """The values of the ports inside a SubTree: those it is given, those around it if it remaps by
        itself, or else those that the TreeNodesModel gives it."""
        remap = boolean_of(element.attributes.get("_autoremap", "false"))
        if remap is None:
            message = "'_autoremap' is true or false"
            raise unreadable(self._document, element, "BBT0604", message, attribute="_autoremap")
        ports = dict(scope.ports) if remap else {}
        given = [name for name in element.attributes if is_port(name)]
        self._unread.took(element, "ID", "_autoremap", *given)
        for name in given:
            given_value = element.attributes[name]
            if given_value.startswith("{@"):
                ports[name] = given_value  # an entry of the root blackboard, for a fact that is held
                continue
            ports[name] = self._leaves.value(element, name, scope.ports)
            if is_numeric(element.attributes[name]):
                message = f"the number '{clip(element.attributes[name])}' may change its form in a SubTree"
                hint = "write it into the leaves of a BehaviorTree of its own"
                raise unreadable(self._document, element, "BBT0616", message, attribute=name, hint=hint)
        if not remap:
            for name, default in self._layout.defaults.get(tree_id, {}).items():
                if name not in ports:
                    ports[name] = self._default(element, tree_id, name, default, scope)
        self._count(len(ports))
        return ports

    def _default(self, element: XmlElement, tree_id: str, name: str, default: str, scope: Scope) -> str:
        """The value of a port that a SubTree is not given."""
        if not default:
            message = f"'{clip(tree_id)}' needs the port '{clip(name)}'"
            raise unreadable(self._document, element, "BBT0603", message)
        value = self._leaves.resolved(default, name, scope.ports)
        if value is None or is_numeric(default):
            message = f"the TreeNodesModel gives the port '{clip(name)}' no value that is one here"
            raise unreadable(self._document, element, "BBT0606", message)
        return value

    # --- nodes -------------------------------------------------------------------------------

    def _node(self, element: XmlElement, scope: Scope) -> Deep[Node]:
        """The node; where it cannot be read, that goes on record and any node stands in for it."""
        try:
            if scope.level > MAX_DEPTH:
                message = f"a tree has at most {MAX_DEPTH} levels"
                raise unreadable(self._document, element, "BBT0605", message)
            self._count_node(element)
            node: Node = yield self._read_node(element, scope)
        except Unreadable as found:
            self._fault(found)
            return ConditionNode("", TRUE)
        reason = element.attributes.get("_description", "")
        if reason.startswith(_REASON):
            node = replace(node, reason=reason.removeprefix(_REASON) or None)
        self.places[id(node)] = element
        return node

    def _count_node(self, element: XmlElement) -> None:
        """A node will be read, in the place of its SubTree where it has one."""
        self._count()
        self._nodes += not has(element, "SubTree")
        if self._nodes > self._limits.nodes:
            message = f"the tree has more than the limit of {self._limits.nodes} nodes"
            raise self._limits.reached(message, "--max-nodes")

    def _count(self, number: int = 1) -> None:
        """Elements or ports have been read, in a place of their own: SubTrees that call SubTrees may make
        very many of a few."""
        self._read += number
        if self._read > _MOST_READ * self._limits.nodes:
            raise self._limits.reached(
                f"the tree is much larger than the limit of {self._limits.nodes} nodes", "--max-nodes"
            )

    def _fault(self, found: Unreadable) -> None:
        self._faults.append(found.diagnostic)
        if len(self._faults) >= _MOST_FAULTS:
            self._raise(self._faults)

    def _read_node(self, element: XmlElement, scope: Scope) -> Deep[Node]:
        parts = action_of(element)
        if parts is not None:
            action: Node = yield self._action(element, parts, scope)
            return action
        if has(element, "SubTree"):
            called: Node = yield self._subtree(element, scope)
            return called
        retry = match(RETRY, element)
        if retry is not None:
            retried: Node = yield self._retry(element, retry, scope)
            return retried
        until = match(TRIED, element)
        if until is not None:
            tried: Node = yield self._until_success(element, until, scope)
            return tried
        condition: Condition | None = yield self._condition(element, scope)
        if condition is not None:
            return ConditionNode("", condition, self._condition_name(element, condition, scope))
        kind = self._kind(element)
        self._unread.took(element)
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
            if has(element, "Parallel"):
                self._unread.took(element, "success_count", "failure_count")
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

    def _retry(self, element: XmlElement, found: Match, scope: Scope) -> Deep[Node]:
        self._unread.take(found)
        counter = found.texts["counter"]
        if counter in self._counters:
            message = f"two retry nodes count with '{clip(counter)}': each sets the other back"
            hint = "give each an entry of its own; a BehaviorTree that holds one is called once"
            raise unreadable(self._document, element, "BBT0613", message, hint=hint)
        self._counters.add(counter)
        for scripts in scope.forget:
            scripts.append(full_again(counter, int(found.texts["attempts"])))
        inside = replace(scope.down(), counters=(*scope.counters, counter))
        node: Node = yield self._node(found.part("child"), inside)
        name = element.attributes.get("name") or None
        if name is not None and is_retry_label(name):
            name = None
        return ControlNode("", "retry", (node,), name, attempts=int(found.texts["attempts"]))

    def _until_success(self, element: XmlElement, found: Match, scope: Scope) -> Deep[Node]:
        self._unread.take(found)
        state, scripts = found.texts["state"], list[str]()
        if state in self._counters:
            message = f"two nodes tell by '{clip(state)}' how far an attempt is: each sets the other back"
            hint = "give each an entry of its own; a BehaviorTree that holds one is called once"
            raise unreadable(self._document, element, "BBT0613", message, hint=hint)
        self._counters.add(state)
        inside = replace(scope.down(), forget=(*scope.forget, scripts))
        node: Node = yield self._node(found.part("child"), inside)
        attempt = element.children[1].children[0]
        ends = attempt_ends(state, scripts)
        for event in ("_onSuccess", "_onFailure", "_onHalted"):
            if attempt.attributes.get(event) != ends.get(event):
                message = f"'{event}' must make everything below forget what it did, and nothing else"
                hint = f'write {event}="{ends[event]}"' if event in ends else f"leave out {event}"
                raise unreadable(self._document, attempt, "BBT0616", message, hint=hint)
        self._unread.took(attempt, *ends)
        name = element.attributes.get("name") or None
        attempts = int(found.texts["attempts"])
        return ControlNode("", "retry-until-success", (node,), name, attempts=attempts)

    def _subtree(self, element: XmlElement, scope: Scope) -> Deep[Node]:
        content, inside = self._call(element, scope)
        label = without_number(element.attributes.get("name", "")) or None
        description = self._layout.trees[element.attributes["ID"]].attributes.get("_description", "")
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
        if match(REGISTER, element) is not None:
            held: Condition = yield self._conditions.read(element, scope)
            return written(self._task, held)
        if has(element, "ReactiveSequence") or has(element, "ReactiveFallback"):
            # Conditions side by side: one condition if the name says so, otherwise each its own.
            if not element.attributes.get("name") or not self._conditions.could_be(element):
                return None
            try:
                read: Condition = yield self._conditions.read(element, scope)
            except Unreadable:
                return None  # it may be a sequence of conditions; if it is not, reading that tells
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
        self._unread.take(parts.found)
        once = parts.latched and parts.found.shape is not None
        limited = match(GIVEN_UP_ONCE if once else GIVEN_UP, parts.leaf)
        if once and (limited is not None) != ("result" in parts.found.texts):
            said = "an action that may be given up keeps how it ended by itself, and only such a one does"
            raise unreadable(self._document, parts.leaf, "BBT0616", said, hint="export the tree anew")
        if limited is not None:
            self._unread.take(limited)
        leaf = parts.leaf if limited is None else limited.part("leaf")
        if self._leaves.is_leaf(leaf) and not leaf.children:
            name = self._leaves.action(leaf, inside.ports)
        else:
            message, hint = self._no_counterpart(leaf)
            raise unreadable(self._document, leaf, "BBT0616", message, hint=hint)
        found = None if limited is None else limited.texts["msec"]
        check_limit(self._document, leaf, found, self._task.action_by_name[name])
        self._check_entries(element, parts, name, inside)
        guarded = yield self._guarded(parts, name, inside)
        yield self._goes_on(element, parts, name, inside)
        held = [fact for note in parts.notes for fact in self._conditions.note(note, inside)]
        held += self._holds.listed(element, parts.sets, inside.ports)
        self._holds.action(element, frozenset(held), parts.waits)
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

    def _check_entries(self, element: XmlElement, parts: ActionParts, name: str, inside: Scope) -> None:
        """The entries of the blackboard through which an action speaks with the rest of the tree."""
        if self._flag is not None and parts.flag != self._flag:
            message = f"'{clip(name)}' sets '{clip(parts.flag)}', but the tree reads '{clip(self._flag)}'"
            hint = "the tree would be taken for blocked while the action runs"
            raise unreadable(self._document, element, "BBT0616", message, hint=hint)
        running = parts.found.texts.get("running", "")
        if self._flag is not None and running != self._running and parts.found.shape is not None:
            message = f"'{clip(name)}' does not tell that it runs by '{clip(self._running)}'"
            if not self._running:
                message = (
                    f"'{clip(name)}' tells that it runs by '{clip(running)}', which the tree does not read"
                )
            hint = "the tree asks one entry whether an action runs"
            raise unreadable(self._document, element, "BBT0616", message, hint=hint)
        lasting = parts.entry is None or not parts.entry.startswith("@")
        if parts.latched and lasting != (not inside.forget):
            message = f"'{clip(name)}' keeps its status for good, though it stands below a {UNTIL_SUCCESS}"
            hint = "let it keep it in an entry of the root blackboard that each attempt ends by setting back"
            if not lasting:
                message = f"'{clip(name)}' keeps its status in '{parts.entry}', which nothing sets back"
                hint = f"it is for actions below a {UNTIL_SUCCESS}; others use '_latch'"
            raise unreadable(self._document, element, "BBT0616", message, hint=hint)
        if parts.entry is not None and not lasting:
            for scripts in inside.forget:
                scripts.append(forgotten(parts.entry))
        if parts.entry is not None:
            key = (inside.trees[-1] if lasting else "@", parts.entry)
            if self._entries.setdefault(key, parts.leaf) is not parts.leaf:
                message = f"another action of this BehaviorTree keeps its state in '{parts.entry}', too"
                hint = "put each into a BehaviorTree of its own, and call it by a SubTree"
                raise unreadable(self._document, element, "BBT0616", message, hint=hint)

    def _goes_on(self, element: XmlElement, parts: ActionParts, name: str, scope: Scope) -> Deep[None]:
        """The action goes on while its condition says so, and no other."""
        during = during_of(self._task, ActionNode("", name))
        if during is None and parts.during is None:
            return
        if parts.during is not None:
            live = set(self._holds.live)
            read: Condition = yield self._conditions.read(parts.during, scope)
            self._holds.live = live  # it is read as it is, in any case
            if during is not None and written(self._task, read) == written(self._task, during):
                return
        message = f"'{clip(name)}' must go on while its condition in the task is true, and else be halted"
        raise unreadable(self._document, parts.during or element, "BBT0616", message)

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
