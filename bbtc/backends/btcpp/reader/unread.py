"""What of a BehaviorTree.CPP file is without meaning for a tree, and what nobody has read.

Whoever reads a part of a file says so. What is left in the end has a meaning that the tree would lack, and
is refused: an attribute that nobody knows may be a condition of a later version of the engine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType

from bbtc.artefacts.cursor import clip
from bbtc.backends.btcpp.reader.shapes import Match, is_long, tag_of
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.diagnostics import Diagnostic, Unreadable

_SHOWN = MappingProxyType(
    {
        "_description": "text for readers; only `for …` on a node and `template …` on a BehaviorTree count",
        "_fullpath": "the path that the engine writes of a node",
        "_uid": "the number that the engine writes of a node",
        "_collapsed": "whether an editor draws what is below",
    }
)

WITHOUT_MEANING: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "root": MappingProxyType(
            {
                "project_name": "the name of an editor's project",
                "xmlns:xsi": "the prefix of the next two",
                "xsi:noNamespaceSchemaLocation": "where a schema for editors is",
                "xsi:schemaLocation": "where a schema for editors is",
            }
        ),
        "BehaviorTree": _SHOWN,
        "node": MappingProxyType({"name": "a label, kept where a node of the tree has one"} | dict(_SHOWN)),
    }
)
"""The attributes that say nothing of what a tree does, by where they stand, and what they are."""


def unreadable(
    document: XmlDocument,
    element: XmlElement,
    code: str,
    message: str,
    *,
    attribute: str | None = None,
    hint: str | None = None,
) -> Unreadable:
    """The exception for an element or one of its attributes."""
    return Unreadable(Diagnostic(code, message, document.span(element, attribute), hint))


class Unread:
    """Remembers what of a file has been read."""

    def __init__(self, document: XmlDocument) -> None:
        self._document = document
        self._read: dict[int, set[str]] = {}

    def took(self, element: XmlElement, *names: str) -> None:
        """An element has been read, and these of its attributes."""
        known = self._read.setdefault(id(element), set())
        known.update(names)
        if is_long(element):
            known.add("ID")

    def take(self, found: Match) -> None:
        """An idiom has been read. Raises :class:`Unreadable` if an attribute
        has another value than the idiom."""
        for element, name, wanted in found.wrong:
            place = name if name in element.attributes else None
            message = f"the attribute '{name}' of '{clip(tag_of(element))}' has no such value in a tree"
            if place is None:
                message = f"'{clip(tag_of(element))}' lacks the attribute '{name}' here"
            hint = f'an export writes {name}="{wanted}" here'
            raise unreadable(self._document, element, "BBT0616", message, attribute=place, hint=hint)
        for element, names in found.read:
            self.took(element, *names)

    def left(self, tops: Iterable[XmlElement], *, whole: bool) -> Iterator[Diagnostic]:
        """Everything in these elements that has a meaning and was not read. Elements count only where
        the ``whole`` file could be read: below a node that was refused nobody has looked."""
        for top in tops:
            stack = [top]
            while stack:
                element = stack.pop()
                if id(element) in self._read:
                    yield from self._attributes(element)
                elif whole and element.tag != "BehaviorTree":
                    yield self._fault(element, f"'{clip(tag_of(element))}' has no place here")
                    continue
                yield from self.texts(element)
                stack.extend(reversed(element.children))

    def attributes(self, element: XmlElement, place: str) -> Iterator[Diagnostic]:
        """The attributes of an element that have a meaning and were not read."""
        known = self._read.get(id(element), set())
        for name in element.attributes:
            if name not in known and name not in WITHOUT_MEANING[place]:
                message = (
                    f"the attribute '{clip(name)}' of '{clip(tag_of(element))}' has no counterpart in a tree"
                )
                yield self._fault(element, message, name)

    def texts(self, element: XmlElement) -> Iterator[Diagnostic]:
        """The text in an element, if it is more than space."""
        if id(element) in self._document.texts:
            message = f"text in '{clip(tag_of(element))}' has no counterpart in a tree"
            yield Diagnostic("BBT0616", message, self._document.text_span(element))

    def _attributes(self, element: XmlElement) -> Iterator[Diagnostic]:
        return self.attributes(element, "BehaviorTree" if element.tag == "BehaviorTree" else "node")

    def _fault(self, element: XmlElement, message: str, attribute: str | None = None) -> Diagnostic:
        return unreadable(self._document, element, "BBT0616", message, attribute=attribute).diagnostic
