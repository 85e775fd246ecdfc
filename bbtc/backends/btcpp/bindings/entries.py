"""What a file of bindings says, as data. docs/bindings.md explains it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from bbtc.source import Span

Kind: TypeAlias = Literal["action", "predicate"]

_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Text:
    """A value as it is written; ``plain`` says how: a number, a truth value, or a text."""

    text: str
    plain: Literal["number", "truth", "text"] = "text"


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of the root blackboard, by its name."""

    name: str


@dataclass(frozen=True, slots=True)
class Table:
    """Values by the name of an object, and where each stands."""

    name: str
    rows: Mapping[str, Text]
    span: Span | None = field(default=None, compare=False)
    spans: Mapping[str, Span | None] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, slots=True)
class Argument:
    """The object that stands for a parameter, or what a table says of it, or of that one part: parts are
    separated by ``;``, and the first is 1."""

    parameter: str
    table: Table | None = None
    part: int | None = None

    def looked_up(self, name: str) -> Text | None:
        """What the table says of an object; None where it says nothing."""
        assert self.table is not None
        row = self.table.rows.get(name)
        if row is None or self.part is None:
            return row
        parts = row.text.split(";")
        if self.part > len(parts):
            return None
        return Text(parts[self.part - 1].strip(), "number" if self.numeric else "text")

    @property
    def numeric(self) -> bool:
        """Are all values that the table may give numbers?"""
        assert self.table is not None
        rows = self.table.rows.values()
        if self.part is None:
            return all(row.plain == "number" for row in rows)
        parts = [row.text.split(";") for row in rows]
        return all(len(each) >= self.part and is_number(each[self.part - 1].strip()) for each in parts)


Value: TypeAlias = Text | Entry | Argument


@dataclass(frozen=True, slots=True)
class Given:
    """A value for a port or a field, by name, and the place of it."""

    name: str
    value: Value
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Comparison:
    """``percentage >= 0.2``."""

    member: str
    operator: str
    value: Text | Argument
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class NodeBinding:
    """A node that others have. ``negated``: it answers the contrary of the condition. ``running``: it returns
    RUNNING where that is unknown. ``omit`` are ports that it does without."""

    node: str
    ports: tuple[Given, ...] = ()
    omit: frozenset[str] = frozenset()
    negated: bool = False
    running: bool = False
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class RosCall:
    """An action or a service of ROS 2: its type in three parts, the name of its server, the fields of the
    goal or the request, and when its result means success."""

    kind: Literal["action", "service"]
    type: tuple[str, str, str]
    server: str
    fields: tuple[Given, ...] = ()
    success: Comparison | None = None
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class RosTopic:
    """A topic of ROS 2 whose latest message answers a condition. ``nan``: a value that is no number tells
    that it is unknown. ``latched``: the last message waits for those who come later (transient local)."""

    topic: str
    type: tuple[str, str, str]
    where: Comparison
    nan: bool = False
    latched: bool = False
    span: Span | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Binding:
    """What stands for an action, or for a condition."""

    kind: Kind
    name: str
    node: NodeBinding | None = None
    call: RosCall | None = None
    topic: RosTopic | None = None
    span: Span | None = field(default=None, compare=False)

    def values(self) -> Iterator[tuple[Value, Span | None]]:
        """Every value, with its place."""
        given = () if self.node is None else self.node.ports
        given += () if self.call is None else self.call.fields
        yield from ((each.value, each.span) for each in given)
        tests = [self.call.success if self.call else None, self.topic.where if self.topic else None]
        yield from ((test.value, test.span) for test in tests if test is not None)


@dataclass(frozen=True, slots=True)
class Bindings:
    """All that a file says; ``reserved`` are the ids of nodes that others have."""

    file: str = ""
    bindings: tuple[Binding, ...] = ()
    models: Mapping[str, NodeModel] = field(default_factory=dict)

    @property
    def reserved(self) -> frozenset[str]:
        """Ids of nodes that others have."""
        bound = {each.node.node for each in self.bindings if each.node is not None}
        return frozenset(bound | self.models.keys())

    def find(self, kind: Kind, name: str) -> Binding | None:
        """What stands for an action or a condition."""
        return next((each for each in self.bindings if (each.kind, each.name) == (kind, name)), None)


# --- models of nodes -------------------------------------------------------------------------

Direction: TypeAlias = Literal["input", "output", "inout"]


@dataclass(frozen=True, slots=True)
class PortModel:
    """A port of a node as its package describes it; an empty ``type`` takes anything."""

    name: str
    direction: Direction
    type: str = ""
    default: str | None = None


@dataclass(frozen=True, slots=True)
class NodeModel:
    """A node as its package describes it: ``kind`` is the name of the element, such as ``Action``."""

    id: str
    kind: str
    ports: Mapping[str, PortModel]


def is_number(text: str) -> bool:
    """Is it a finite number, as C++ and YAML write it?"""
    return _NUMBER.fullmatch(text) is not None and math.isfinite(float(text))
