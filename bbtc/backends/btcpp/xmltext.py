"""Strict XML text in: elements with their places. Files come from strangers: a document type, with which
XML defines entities and names other files, is refused, and so is what is nested too deeply."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.source import SourceFile, Span

MAX_DEPTH = 300
"""Levels of elements that are read; BehaviorTree.CPP takes 256 in each of its trees."""


@dataclass(frozen=True, slots=True)
class XmlElement:
    """An element without its text. ``start`` is the offset of its tag in the UTF-8 bytes of the text."""

    tag: str
    attributes: dict[str, str]
    start: int
    children: list[XmlElement] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class XmlDocument:
    """The root element and the comments of a text; the first text in an element that is more than space,
    by the ``id`` of the element, and the processing instructions in the root element, by offset."""

    source: SourceFile
    root: XmlElement
    comments: tuple[str, ...]
    texts: Mapping[int, int] = field(default_factory=dict)
    instructions: tuple[int, ...] = ()

    def span(self, element: XmlElement, attribute: str | None = None) -> Span:
        """The place of an element's tag, or of one of its attributes."""
        return _span(self.source, element.start, attribute)

    def text_span(self, element: XmlElement) -> Span:
        """The place of the text in an element: its first word."""
        text = self.source.text
        start = _offset(text, self.texts[id(element)])
        word = re.compile(r"\s*(<!\[CDATA\[\s*)?([^\s<]*)").match(text, start)
        assert word is not None
        return Span(self.source, word.start(2), max(word.end(2), word.start(2) + 1))

    def instruction_span(self, start: int) -> Span:
        """The place of a processing instruction."""
        return _span(self.source, start, None)


def parse_xml(source: SourceFile) -> XmlDocument:
    """The elements of an XML text. Raises :class:`BbtcError`: BBT0614 for what is not well-formed XML or
    has a document type, BBT0605 for what is nested too deeply."""
    reader = _Reader(source)
    parser = expat.ParserCreate("utf-8")  # the text is decoded: what it says of its encoding is past
    parser.ordered_attributes = True
    parser.StartDoctypeDeclHandler = reader.document_type
    parser.StartElementHandler = lambda tag, given: reader.start(tag, given, parser.CurrentByteIndex)
    parser.EndElementHandler = reader.end
    parser.CommentHandler = reader.comments.append
    parser.CharacterDataHandler = lambda text: reader.text(text, parser.CurrentByteIndex)
    parser.ProcessingInstructionHandler = lambda *_: reader.instruction(parser.CurrentByteIndex)
    try:
        parser.Parse(source.text.encode(), True)
    except expat.ExpatError as error:
        # Where nothing was found at all, the index is -1: the end of the text.
        start = parser.ErrorByteIndex if parser.ErrorByteIndex >= 0 else len(source.text.encode())
        reason = expat.ErrorString(error.code)
        raise BbtcError.single(
            "BBT0614", f"not well-formed XML: {reason}", _span(source, start, None)
        ) from None
    assert reader.root is not None
    return XmlDocument(source, reader.root, tuple(reader.comments), reader.texts, tuple(reader.instructions))


class _Reader:
    def __init__(self, source: SourceFile) -> None:
        self.root: XmlElement | None = None
        self.comments: list[str] = []
        self.texts: dict[int, int] = {}
        self.instructions: list[int] = []
        self._source = source
        self._open: list[XmlElement] = []

    def document_type(self, *_: object) -> None:
        place = re.search(r"<!DOCTYPE", self._source.text)
        span = Span(self._source, place.start(), place.end()) if place else None
        raise BbtcError.single("BBT0614", "a document type is not read: it could expand or fetch", span)

    def start(self, tag: str, attributes: list[str], offset: int) -> None:
        element = XmlElement(tag, dict(zip(attributes[::2], attributes[1::2], strict=True)), offset)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)
        if len(self._open) > MAX_DEPTH:
            span = _span(self._source, offset, None)
            raise BbtcError([Diagnostic("BBT0605", f"more than {MAX_DEPTH} levels of elements", span)])

    def end(self, _tag: str) -> None:
        self._open.pop()

    def text(self, text: str, offset: int) -> None:
        if text.strip() and self._open:
            self.texts.setdefault(id(self._open[-1]), offset)

    def instruction(self, offset: int) -> None:
        if self.root is not None:
            self.instructions.append(offset)


def _offset(text: str, start: int) -> int:
    """The character at a byte of the UTF-8 form."""
    return start if text.isascii() else len(text.encode()[:start].decode(errors="replace"))


def _span(source: SourceFile, start: int, attribute: str | None) -> Span:
    text = source.text
    offset = _offset(text, start)
    tag = re.compile(r"<[^\s/>]*").match(text, offset)
    if tag is None:
        return Span(source, min(offset, len(text)), min(offset + 1, len(text)))
    if attribute is not None:
        # Values hold no quotes of their kind; so what looks like the attribute in one is skipped.
        pair = re.compile(r"""\s+([^\s=]+)\s*=\s*(?:"[^"]*"|'[^']*')""")
        at = tag.end()
        while (found := pair.match(text, at)) is not None:
            if found.group(1) == attribute:
                return Span(source, found.start(1), found.end())
            at = found.end()
    return Span(source, tag.start(), tag.end())
