"""What stands side by side in a BehaviorTree.CPP file: its BehaviorTrees, which of them it runs, and what its
TreeNodesModel says of them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.reader.shapes import has
from bbtc.backends.btcpp.reader.unread import Unread, unreadable
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.markov import reachable

_MODEL = "TreeNodesModel"
_PORT = re.compile(r"[A-Za-z][\w-]*")
_PORTS = ("input_port", "output_port", "inout_port")


def is_port(name: str) -> bool:
    """Whether the engine takes an attribute for a port."""
    return _PORT.fullmatch(name) is not None and name not in ("name", "ID")


class Layout:
    """The parts of a file. ``main`` is the id of the tree to read; without it, it is the one that the file
    runs, or the one that no other calls.

    Raises :class:`BbtcError`: BBT0615 for what is no such file, BBT0607 for an id that stands twice, BBT0619
    where it is not clear which tree is meant.
    """

    def __init__(self, document: XmlDocument, main: str | None = None) -> None:
        self.document = document
        root = document.root
        if root.tag != "root" or root.attributes.get("BTCPP_format") != "4":
            raise self._refusal(
                "BBT0615", 'a BehaviorTree.CPP file of version 4 begins with <root BTCPP_format="4">'
            )
        self.trees = self._named()
        self.defaults: Mapping[str, Mapping[str, str]] = self._models()
        self.main = self._main(main)

    def _named(self) -> dict[str, XmlElement]:
        trees: dict[str, XmlElement] = {}
        for tree in self.document.root.children:
            if tree.tag != "BehaviorTree":
                continue
            if not tree.attributes.get("ID"):
                raise self._refusal("BBT0615", "a BehaviorTree has an ID", tree)
            if tree.attributes["ID"] in trees:
                message = f"two BehaviorTrees have the ID '{clip(tree.attributes['ID'])}'"
                raise self._refusal("BBT0607", message, tree, "ID", hint="the engine takes the last one")
            trees[tree.attributes["ID"]] = tree
        if not trees:
            raise self._refusal("BBT0615", "the file has no BehaviorTree")
        return trees

    def _models(self) -> dict[str, dict[str, str]]:
        """The ports of SubTrees with their default values, "" where they have none, by BehaviorTree."""
        models: dict[str, dict[str, str]] = {}
        for model in self.document.root.children:
            for entry in model.children if model.tag == _MODEL else ():
                if entry.tag == "SubTree":
                    ports = models.setdefault(entry.attributes.get("ID", ""), {})
                    for port in entry.children:
                        if port.tag in _PORTS:
                            ports[port.attributes.get("name", "")] = port.attributes.get("default", "")
        return models

    def _main(self, wanted: str | None) -> str:
        name = self.document.root.attributes.get("main_tree_to_execute") if wanted is None else wanted
        if name is None:
            return self._uncalled()
        if name not in self.trees:
            message = f"the file has no BehaviorTree '{clip(name)}'"
            if wanted is None:
                raise self._refusal("BBT0615", message, attribute="main_tree_to_execute")
            raise self._refusal("BBT0619", message, hint=f"it has {clip(', '.join(self.trees))}")
        return name

    def reachable(self) -> list[XmlElement]:
        """The BehaviorTrees that the main tree calls, and itself, in the order of the file."""
        found = reachable([self.main], lambda name: self._calls(self.trees[name]) & self.trees.keys())
        return [tree for name, tree in self.trees.items() if name in found]

    @staticmethod
    def _calls(tree: XmlElement) -> set[str]:
        called: set[str] = set()
        stack = list(tree.children)
        while stack:
            element = stack.pop()
            if has(element, "SubTree"):
                called.add(element.attributes.get("ID", ""))
            stack.extend(element.children)
        return called

    def _uncalled(self) -> str:
        """The BehaviorTree that no other calls."""
        called: set[str] = set()
        for name, tree in self.trees.items():
            called |= self._calls(tree) - {name}
        free = [name for name in self.trees if name not in called]
        if len(free) == 1:
            return free[0]
        hint = "choose one with --tree ID, or with main_tree_to_execute in the file"
        if not free:
            message = (
                "the file does not tell its main tree, and each of its BehaviorTrees is called by another"
            )
        else:
            message = f"the file does not tell its main tree, and nobody calls these: {clip(', '.join(free))}"
        raise self._refusal("BBT0619", message, hint=hint)

    def faults(self, unread: Unread) -> Iterator[Diagnostic]:
        """What stands beside the BehaviorTrees and has a meaning that a tree has no place for. A
        TreeNodesModel is a palette for editors, but for the ports of SubTrees."""
        document, models = self.document, 0
        unread.took(document.root, "BTCPP_format", "main_tree_to_execute")
        yield from unread.attributes(document.root, "root")
        yield from unread.texts(document.root)
        for element in document.root.children:
            hint = None
            match element.tag:
                case "BehaviorTree":
                    continue
                case "TreeNodesModel":
                    models += 1
                    if models == 1:
                        continue
                    message = f"the engine takes one {_MODEL}"
                case "include":
                    message = f"'{element.tag}' has no counterpart in a tree"
                    hint = "put the trees of the other file into this one"
                case _:
                    message = f"'{clip(element.tag)}' has no counterpart in a tree"
            yield unreadable(document, element, "BBT0616", message, hint=hint).diagnostic
        for start in document.instructions:
            message = "a processing instruction has no counterpart in a tree"
            yield Diagnostic("BBT0616", message, document.instruction_span(start))

    def _refusal(
        self,
        code: str,
        message: str,
        element: XmlElement | None = None,
        attribute: str | None = None,
        *,
        hint: str | None = None,
    ) -> BbtcError:
        span = self.document.span(element or self.document.root, attribute)
        return BbtcError.single(code, message, span, hint)
