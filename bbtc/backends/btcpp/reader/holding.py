"""What a BehaviorTree.CPP file says that its actions hold, read back. The inverse of
:mod:`bbtc.backends.btcpp.holding`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.reader.leaves import Leaves
from bbtc.backends.btcpp.reader.unread import unreadable
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.backends.commitment import Fact, first_variable, held_by
from bbtc.diagnostics import Diagnostic
from bbtc.ground.condition import Condition, Is, Within
from bbtc.tree.nodes import Tree, actions_of

_FACT = re.compile(r"(\w+)\(([^()]*)\)")


class Holds:
    """What has been read: the facts that conditions read as they are, and what each action holds."""

    def __init__(self, document: XmlDocument, leaves: Leaves) -> None:
        self.live: set[Fact] = set()
        self._document = document
        self._leaves = leaves
        self.set_back: frozenset[str] = frozenset()
        """The entries that the root makes live again."""
        self._facts: dict[str, Fact] = {}
        self._places: dict[str, XmlElement] = {}
        self._actions: list[tuple[XmlElement, frozenset[Fact], bool]] = []

    def entry(self, leaf: XmlElement, name: str, ports: Mapping[str, str], fact: Fact) -> None:
        """An entry of the blackboard, or the port of one, stands for a fact. Raises
        :class:`~bbtc.backends.btcpp.reader.unread.Unreadable`."""
        entry = name if name.startswith("@") else ports.get(name, "").strip("{}")
        if not entry.startswith("@"):
            message = f"'{clip(name)}' is no port that stands for an entry of the root blackboard"
            raise unreadable(self._document, leaf, "BBT0606", message)
        self._places.setdefault(entry, leaf)
        if self._facts.setdefault(entry, fact) != fact:
            message = f"the entry '{clip(entry)}' stands for two facts"
            raise unreadable(self._document, leaf, "BBT0616", message)

    def faults(self) -> Iterator[Diagnostic]:
        """Entries that would be held for ever, or that are never there."""
        for entry, place in self._places.items():
            if entry not in self.set_back:
                message = f"nothing sets '{clip(entry)}' back to 'live' where no action runs"
                hint = "an export does so in the first nodes of its main tree"
                yield unreadable(self._document, place, "BBT0616", message, hint=hint).diagnostic

    def listed(self, latch: XmlElement, text: str, ports: Mapping[str, str]) -> Iterator[Fact]:
        """The facts that a Latch sets. Raises :class:`~bbtc.backends.btcpp.reader.unread.Unreadable`."""
        for fact in filter(None, (part.strip() for part in text.split(";"))):
            found = _FACT.fullmatch(fact)
            if found is None:
                message = f"'{clip(fact)}' is no fact as a Latch knows it"
                hint = "it is written as At(place=hall)"
                raise unreadable(self._document, latch, "BBT0616", message, attribute="sets", hint=hint)
            given = [part.partition("=") for part in found[2].split(",") if part]
            leaf = XmlElement(found[1], {port: value for port, _, value in given}, latch.start)
            yield from self.facts_of(self._leaves.condition(leaf, ports))

    @staticmethod
    def facts_of(condition: Condition) -> Iterator[Fact]:
        """What a leaf asks for; nothing where that is certain."""
        if isinstance(condition, Is):
            yield condition.variable
        elif isinstance(condition, Within):
            yield condition

    def action(self, element: XmlElement, held: frozenset[Fact], waits: bool) -> None:
        """An action has been read."""
        self._actions.append((element, held, waits))

    def doubts(self, tree: Tree) -> Iterator[Diagnostic]:
        """Whether the file does not hold what the tree does while an action runs."""
        wanted = held_by(tree)
        read = frozenset(fact for held in wanted.values() for fact in held)
        nodes = list(actions_of(tree.root))
        if len(nodes) != len(self._actions):
            return
        for node, (element, held, waits) in zip(nodes, self._actions, strict=True):
            facts = frozenset(wanted.get(node.action, ()))
            lacks = (facts - held) or (facts & self.live & read)
            if not waits or lacks:
                names = ", ".join(sorted({tree.task.variables[first_variable(fact)].name for fact in lacks}))
                what = f"what it may set itself is not held: {clip(names)}" if lacks else "others start then"
                message = f"while '{clip(node.action)}' runs, {what}"
                hint = "export the tree anew: its own effects may end the action, in the file, before its end"
                yield Diagnostic("BBT0433", message, self._document.span(element), hint)
                return
