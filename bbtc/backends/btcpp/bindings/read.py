"""From the text of a file of bindings to what it says, every fault reported with its place."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from bbtc.artefacts.cursor import At, Faults, clip, nearest, run_reader
from bbtc.artefacts.marked import Marked, Written, read_yaml
from bbtc.backends.btcpp.bindings.check import model_faults
from bbtc.backends.btcpp.bindings.entries import (
    Argument,
    Binding,
    Bindings,
    Comparison,
    Entry,
    Given,
    Kind,
    NodeBinding,
    NodeModel,
    RosCall,
    RosTopic,
    Table,
    Text,
    Value,
    is_number,
)
from bbtc.backends.btcpp.bindings.models import read_models
from bbtc.diagnostics import BbtcError, Unreadable
from bbtc.files.sources import read_source

_T = TypeVar("_T")

MOST_BYTES = 1 << 22
"""Largest file of bindings, or of models, that is read."""

_ENTRY = re.compile(r"\{@?([A-Za-z_][A-Za-z0-9_]*)\}")
_ID = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,199}")
_PORT = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,199}")
_FIELD = re.compile(r"[a-z][a-z0-9_]*(?:\.[a-z][a-z0-9_]*){0,19}")
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/(action|srv|msg)/([A-Z][A-Za-z0-9]*)")
_ROS_NAME = re.compile(r"[~/A-Za-z_][~/A-Za-z0-9_]{0,199}")
_WHERE = re.compile(r"\s*([a-z][a-z0-9_.]*)\s*(==|!=|<=|>=|<|>)\s*(\S|\S.*\S)\s*")
_OPERATORS = ("==", "!=", "<=", ">=", "<", ">")
_QUOTED = re.compile(r"""'([^']*)'|"([^"]*)\"""")


def read_bindings(path: str) -> Bindings:
    """What the file of bindings at a path says, checked against the models that it names. Raises
    :class:`BbtcError` with every fault and its place."""
    marked = read_yaml(read_source(path, MOST_BYTES))
    return run_reader(lambda faults: _Reader(marked, faults, path).bindings(), None, marked.locate)


def files_of(path: str) -> tuple[str, ...]:
    """The files that are read for a file of bindings: itself, and the models that it names, as far as that
    can be told."""
    try:
        value = read_yaml(read_source(path, MOST_BYTES)).value
    except BbtcError:
        return (path,)
    models = value.get("models") if isinstance(value, dict) else None
    named = [each for each in models if isinstance(each, str)] if isinstance(models, list) else []
    return (path, *(_beside(path, each) for each in named))


def _beside(path: str, name: str) -> str:
    return str(Path(path).parent / name)


@dataclass(slots=True)
class _Reader:
    marked: Marked
    faults: Faults
    path: str
    tables: dict[str, Table] = field(default_factory=dict)
    omit: frozenset[str] = frozenset()

    def bindings(self) -> Bindings:
        """The whole file."""
        members = At(self.marked.value).members(
            [], ["version", "models", "omit", "tables", "actions", "conditions"]
        )
        if "version" in members and members["version"].value != "1":
            raise members["version"].fault("BBT0602", "this version of bbtc reads version 1")
        models = self._models(members["models"]) if "models" in members else None
        if "omit" in members:
            self.omit = frozenset(self._attempt(members["omit"].strings) or ())
        for name, at in members["tables"].entries() if "tables" in members else ():
            self._attempt(partial(self._table, name, at))
        found: list[Binding] = []
        kinds: dict[str, Kind] = {"actions": "action", "conditions": "predicate"}
        for key, kind in kinds.items():
            for name, at in members[key].entries() if key in members else ():
                read = self._attempt(partial(self._binding, kind, name, at))
                if read is not None:
                    found.append(read)
        bindings = Bindings(self.path, tuple(found), models or {})
        self.faults.stop_if_any()
        if models is not None:
            wrong = list(model_faults(bindings))
            if wrong:
                raise BbtcError(wrong)
        return bindings

    def _attempt(self, read: Callable[[], _T]) -> _T | None:
        try:
            return read()
        except Unreadable as fault:
            self.faults.add(fault.diagnostic)
            return None

    def _models(self, at: At) -> dict[str, NodeModel]:
        found: dict[str, NodeModel] = {}
        for each in at.elements():
            if _text(each) == "-":
                raise each.fault("BBT0604", "'-' is not a path")
            path = _beside(self.path, each.string())
            try:
                source = read_source(path, MOST_BYTES)
            except BbtcError as error:
                first = error.diagnostics[0]
                raise each.fault(first.code, first.message, first.hint) from None
            for name, model in read_models(source).items():
                if found.setdefault(name, model) != model:
                    message = (
                        f"{clip(each.string())} has another model of '{clip(name)}' than the files before"
                    )
                    raise each.fault("BBT0709", message)
        return found

    def _table(self, name: str, at: At) -> None:
        rows: dict[str, Text] = {}
        spans = {}
        for row, each in at.entries():
            read = self._attempt(partial(_fixed, each))
            if read is not None:
                rows[row], spans[row] = read, self.marked.span(each.path)
        self.tables[name] = Table(name, rows, self.marked.keys.get(at.path), spans)

    # --- one binding -------------------------------------------------------------------------

    def _binding(self, kind: Kind, name: str, at: At) -> Binding:
        members = at.members([], ["node", "ports", "omit", "negated", "unknown", "ros"])
        node = self._node(kind, members) if "node" in members else None
        if node is None:
            for key in ("ports", "omit", "negated", "unknown"):
                if key in members:
                    raise members[key].fault("BBT0603", f"'{key}' needs a 'node'")
        call = topic = None
        if "ros" in members and kind == "action":
            call = self._call(members["ros"])
        elif "ros" in members:
            topic = self._topic(members["ros"])
        if node is None and "ros" not in members:
            raise at.fault("BBT0603", "a binding has a 'node', or 'ros', or both")
        return Binding(kind, name, node, call, topic, self.marked.keys.get(at.path))

    def _node(self, kind: Kind, members: dict[str, At]) -> NodeBinding:
        node = _match(members["node"], _ID, "the id of a node")
        for key in ("negated", "unknown") if kind == "action" else ():
            if key in members:
                raise members[key].fault("BBT0603", f"'{key}' is for conditions")
        ports: list[Given] = []
        for port, each in members["ports"].entries() if "ports" in members else ():
            if not _PORT.fullmatch(port) or port.lower() in ("name", "id"):
                raise each.fault("BBT0604", f"'{clip(port)}' is not the name of a port")
            ports.append(Given(port, self._value(each), self.marked.keys.get(each.path)))
        omit = members["omit"].strings() if "omit" in members else ()
        return NodeBinding(
            node,
            tuple(ports),
            self.omit | frozenset(omit),
            members["negated"].flag() if "negated" in members else False,
            "unknown" in members and members["unknown"].word("running") == "running",
            self.marked.span(members["node"].path),
        )

    def _call(self, at: At) -> RosCall:
        members = at.members([], ["action", "service", "name", "goal", "request", "success"])
        kinds = [key for key in ("action", "service") if key in members]
        if len(kinds) != 1:
            raise at.fault("BBT0603", "the type of an 'action' or of a 'service', one of them")
        kind, package = kinds[0], "action" if kinds[0] == "action" else "srv"
        if "name" not in members:
            raise at.fault("BBT0603", "field 'name' is missing")
        what, other = ("goal", "request") if kind == "action" else ("request", "goal")
        if other in members:
            raise members[other].fault("BBT0603", f"unknown field '{other}'; did you mean '{what}'?")
        fields = []
        for name, each in members[what].entries() if what in members else ():
            if not _FIELD.fullmatch(name):
                raise each.fault("BBT0604", f"'{clip(name)}' is not a field such as pose.position.x")
            fields.append(Given(name, self._plain(each), self.marked.span(each.path)))
        return RosCall(
            "action" if kind == "action" else "service",
            self._type(members[kind], package),
            _match(members["name"], _ROS_NAME, "the name of a server"),
            tuple(fields),
            self._comparison(members["success"], fixed=True) if "success" in members else None,
            self.marked.span(at.path),
        )

    def _topic(self, at: At) -> RosTopic:
        members = at.members(["topic", "type", "where"], ["unknown", "latched"])
        where = self._comparison(members["where"], fixed=False)
        nan = "unknown" in members and members["unknown"].word("nan") == "nan"
        if nan and not _numeric(where.value):
            raise members["unknown"].fault("BBT0604", "only a number can be none: what is compared is none")
        return RosTopic(
            _match(members["topic"], _ROS_NAME, "the name of a topic"),
            self._type(members["type"], "msg"),
            where,
            nan,
            members["latched"].flag() if "latched" in members else False,
            self.marked.span(at.path),
        )

    def _type(self, at: At, folder: str) -> tuple[str, str, str]:
        found = _TYPE.fullmatch(_text(at))
        if found is None or found.group(2) != folder:
            raise at.fault("BBT0604", f"'{clip(at.string())}' is no type such as package/{folder}/Name")
        return found.group(1), found.group(2), found.group(3)

    # --- values ------------------------------------------------------------------------------

    def _comparison(self, at: At, *, fixed: bool) -> Comparison:
        span = self.marked.span(at.path)
        if isinstance(at.value, dict):
            members = at.members(["field", "is", "value"])
            name = _match(members["field"], _FIELD, "a field such as battery.percentage")
            value = self._plain(members["value"])
            if fixed and isinstance(value, Argument):
                raise members["value"].fault("BBT0604", "a result is compared with a fixed value")
            return Comparison(name, _ordered(at, members["is"].word(*_OPERATORS), value), value, span)
        found = _WHERE.fullmatch(_text(at))
        if found is None or not _FIELD.fullmatch(found.group(1)):
            raise at.fault("BBT0604", "must be FIELD COMPARISON VALUE, such as 'percentage >= 0.2'")
        value = _written(at, found.group(3))
        return Comparison(found.group(1), _ordered(at, found.group(2), value), value, span)

    def _plain(self, at: At) -> Text | Argument:
        value = self._value(at)
        if isinstance(value, Entry):
            raise at.fault("BBT0604", "an entry of the blackboard is for ports")
        return value

    def _value(self, at: At) -> Value:
        if isinstance(at.value, dict):
            members = at.members(["of"], ["table", "part"])
            table = part = None
            if "table" in members:
                name = _text(members["table"])
                table = self.tables.get(name)
                if table is None:
                    hint = nearest(name, tuple(self.tables))
                    raise members["table"].fault("BBT0708", f"there is no table '{clip(name)}'", hint)
            if "part" in members:
                text = members["part"].value
                if (
                    not isinstance(text, Written)
                    or not re.fullmatch("[1-9][0-9]{0,3}", text)
                    or table is None
                ):
                    raise members["part"].fault("BBT0604", "must be a whole number from 1, of a table")
                part = int(members["part"].string())
            return Argument(_text(members["of"]).removeprefix("?"), table, part)
        return _literal(at, entries=True)


def _literal(at: At, *, entries: bool = False) -> Text | Entry:
    """A fixed value, or, where that may stand, an entry of the blackboard."""
    if isinstance(at.value, bool):
        return Text(str(at.value).lower(), "truth")
    text = at.string()
    if isinstance(at.value, Written):
        if not is_number(text):
            raise at.fault("BBT0604", f"'{clip(text)}' is no decimal number", "put a text in quotes")
        return Text(text, "number")
    if not text.isprintable():
        raise at.fault("BBT0604", "a character that does not print")
    if text.startswith("{"):
        found = _ENTRY.fullmatch(text)
        if found is None or not entries:
            raise at.fault("BBT0604", f"'{clip(text)}' is no entry of the blackboard that may stand here")
        return Entry(found.group(1))
    return Text(text)


def _fixed(at: At) -> Text:
    """A value that is the same wherever the tree runs."""
    value = _literal(at)
    assert isinstance(value, Text)
    return value


def _text(at: At) -> str:
    if isinstance(at.value, Written):
        raise at.fault("BBT0604", f"must be a text, not the number {clip(at.value)}", "put it in quotes")
    return at.string()


def _match(at: At, pattern: re.Pattern[str], what: str) -> str:
    text = _text(at)
    if not pattern.fullmatch(text):
        raise at.fault("BBT0604", f"'{clip(text)}' is not {what}")
    return text


def _written(at: At, text: str) -> Text:
    """A value as it stands in a comparison."""
    if text in ("true", "false"):
        return Text(text, "truth")
    if is_number(text):
        return Text(text, "number")
    quoted = _QUOTED.fullmatch(text)
    if quoted is None or not text.isprintable():
        message = f"'{clip(text)}' is no number, true, false, or text in quotes"
        raise at.fault("BBT0604", message)
    return Text(quoted.group(1) or quoted.group(2) or "")


def _ordered(at: At, operator: str, value: Text | Argument) -> str:
    """The operator, if such values have an order."""
    if operator not in ("==", "!=") and not _numeric(value):
        raise at.fault("BBT0604", f"'{operator}' compares numbers only")
    return operator


def _numeric(value: Text | Argument) -> bool:
    if isinstance(value, Argument):
        return value.table is not None and value.numeric
    return value.plain == "number"
