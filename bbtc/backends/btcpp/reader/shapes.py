"""Elements of BehaviorTree.CPP files, and shapes that they are compared with.

A shape says which elements an idiom is made of and which values their attributes have. An element with the
elements of a shape stands for nothing else, so a value that differs is wrong, and named; an attribute that
the shape lacks is nobody's, which :mod:`bbtc.backends.btcpp.reader.unread` reports.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.backends.btcpp.idioms import SKIPPER
from bbtc.backends.btcpp.xmltext import XmlElement

_KINDS = ("Action", "Condition", "Control", "Decorator")
_BOOLEANS = {word: value for value in (True, False) for word in (str(value), str(value).lower())}
_BOOLEANS |= {"TRUE": True, "FALSE": False, "1": True, "0": False}


def tag_of(element: XmlElement) -> str:
    """The id of a node; ``<Action ID="Detect"/>`` is another spelling of ``<Detect/>``."""
    if is_long(element):
        return element.attributes["ID"]
    return element.tag


def is_long(element: XmlElement) -> bool:
    """Whether an element names its kind, and its id in an attribute."""
    return element.tag in _KINDS and "ID" in element.attributes


def has(element: XmlElement, tag: str, children: int | None = None) -> bool:
    """Whether an element has this tag and this many children."""
    return tag_of(element) == tag and (children is None or len(element.children) == children)


def boolean_of(text: str) -> bool | None:
    """The truth value that the engine reads in an attribute; None if it reads none."""
    return _BOOLEANS.get(text)


def is_skipper(element: XmlElement) -> bool:
    """Our node Skipper, or a Parallel that ends with the first child to end."""
    counts = (element.attributes.get("success_count"), element.attributes.get("failure_count"))
    return has(element, SKIPPER) or (has(element, "Parallel") and counts == ("1", "1"))


# --- shapes ----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Pattern:
    """Values of an attribute. Groups of the pattern have one text in all of a shape; ``example`` is shown to
    a person whose value does not fit."""

    pattern: re.Pattern[str]
    example: str


Value: TypeAlias = str | Pattern


@dataclass(frozen=True, slots=True)
class Hole:
    """Any element, with these attributes among others."""

    name: str
    attributes: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Holes:
    """Any number of elements, before all others."""

    name: str


@dataclass(frozen=True, slots=True)
class Shape:
    """An element, its attributes and its children. The tag ``Skipper`` stands for a Parallel, too."""

    tag: str
    attributes: Mapping[str, Value]
    children: tuple[Shape | Hole | Holes, ...] = ()


@dataclass(frozen=True, slots=True)
class Match:
    """What was found in the holes of a shape, and the texts of its groups; the elements and attributes that
    the shape has, and those attributes that have another value, with what they should have."""

    shape: Shape | None = None
    parts: dict[str, list[XmlElement]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    read: list[tuple[XmlElement, tuple[str, ...]]] = field(default_factory=list)
    wrong: list[tuple[XmlElement, str, str]] = field(default_factory=list)

    def part(self, name: str) -> XmlElement:
        """The element in a hole."""
        (element,) = self.parts[name]
        return element

    def attribute(self, element: XmlElement, name: str, wanted: Value) -> None:
        """Compare an attribute with the value it should have."""
        value = element.attributes.get(name)
        match wanted:
            case str():
                fits, example = value == wanted, wanted
            case Pattern(pattern, example):
                found = pattern.fullmatch(value or "")
                groups = {} if found is None else found.groupdict()
                fits = found is not None and all(
                    self.texts.setdefault(group, text) == text
                    for group, text in groups.items()
                    if text is not None
                )
            case _:
                assert_never(wanted)
        self.read.append((element, (name,)))
        if not fits:
            self.wrong.append((element, name, example))


_ONE_OF = {"success_count": "1", "failure_count": "1"}


def match(shape: Shape, element: XmlElement) -> Match | None:
    """An element as a shape; None if it has other elements."""
    found = Match(shape)
    return found if _fits(shape, element, found) else None


def match_one(shapes: Iterable[Shape], element: XmlElement) -> Match | None:
    """An element as the first of some shapes that fits."""
    return next((found for shape in shapes if (found := match(shape, element)) is not None), None)


def _fits(shape: Shape, element: XmlElement, found: Match) -> bool:
    attributes = shape.attributes
    if shape.tag == SKIPPER and has(element, "Parallel"):
        attributes = {**attributes, **_ONE_OF}
    elif not has(element, shape.tag):
        return False
    children, wanted = element.children, shape.children
    if wanted and isinstance(wanted[0], Holes) and len(children) >= len(wanted) - 1:
        many = len(children) - len(wanted) + 1
        found.parts[wanted[0].name] = children[:many]
        children, wanted = children[many:], wanted[1:]
    if len(children) != len(wanted):
        return False
    found.read.append((element, ()))
    for name, value in attributes.items():
        found.attribute(element, name, value)
    return all(_fits_in(part, child, found) for part, child in zip(wanted, children, strict=True))


def _fits_in(part: Shape | Hole | Holes, child: XmlElement, found: Match) -> bool:
    match part:
        case Shape():
            return _fits(part, child, found)
        case Hole(name, attributes):
            found.parts[name] = [child]
            for key, value in attributes.items():
                found.attribute(child, key, value)
            return True
        case Holes():
            raise ValueError("many elements stand first in a shape")
        case _:
            assert_never(part)
