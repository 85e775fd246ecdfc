"""Which variable or action of a task a leaf of a BehaviorTree.CPP file stands for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from bbtc.artefacts.cursor import clip, nearest
from bbtc.backends.btcpp.names import objects_of
from bbtc.backends.btcpp.reader.layout import is_port
from bbtc.backends.btcpp.reader.shapes import tag_of
from bbtc.backends.btcpp.reader.unread import Unread, unreadable
from bbtc.backends.btcpp.xmltext import XmlDocument, XmlElement
from bbtc.backends.interface import BOUNDS, action_symbol, parameters_of, variable_symbol
from bbtc.backends.names import Kind, Symbol, camel, port_values, possible_identifiers
from bbtc.diagnostics import Unreadable
from bbtc.ground.condition import Condition, Is, within
from bbtc.ground.task import Task, ground_name
from bbtc.kleene import Truth

_WHOLE = re.compile(r"[+-]?[0-9]{1,12}", re.ASCII)


@dataclass(frozen=True, slots=True)
class FileNames:
    """The names in a file: leaves by id, and objects by their value in ports."""

    namespace: str
    symbols: Mapping[str, Symbol]
    objects: Mapping[str, str]


class Leaves:
    """Reads leaves on a task. ``names`` are those that the file itself explains; others are taken as an
    export would write them; ``unread`` is told what has been read."""

    def __init__(self, task: Task, document: XmlDocument, names: FileNames, unread: Unread) -> None:
        self._task = task
        self._unread = unread
        self._document = document
        self._names = names
        symbols = {variable_symbol(variable) for variable in task.variables}
        symbols |= {action_symbol(action) for action in task.actions}
        self._symbols = sorted(symbols)
        self._possible: dict[str, dict[Symbol, int]] = {}
        prefix = camel(names.namespace) if names.namespace else ""
        for symbol in self._symbols:
            for rank, name in enumerate(possible_identifiers(symbol, "camel")):
                self._possible.setdefault(f"{prefix}{name}", {}).setdefault(symbol, rank)
        values = port_values(objects_of(task))
        self._objects = {value: name for name, value in values.items()} | dict(names.objects)

    def object_of(self, value: str) -> str | None:
        """The object that a value of a port stands for; None if none does."""
        return self._objects.get(value)

    def is_action(self, element: XmlElement) -> bool:
        """Whether an id can only be that of an action."""
        found = self._found(element)
        return bool(found) and all(symbol.kind == "action" for symbol in found)

    def is_leaf(self, element: XmlElement) -> bool:
        """Whether an id is that of a predicate or action."""
        return bool(self._found(element))

    def variable(self, element: XmlElement, ports: Mapping[str, str]) -> int:
        """The variable that a condition leaf reads. ``ports`` are the values of the ports of the
        BehaviorTree around it. Raises :class:`Unreadable`."""
        name = self._ground(element, ports, "predicate")
        if name not in self._task.variable_index:
            raise self._unknown(element, "variable", name, list(self._task.variable_index))
        return self._task.variable_index[name]

    def is_number(self, element: XmlElement) -> bool:
        """Whether an id can only be that of a number."""
        found = self._found(element)
        return bool(found) and all(symbol.kind == "function" for symbol in found)

    def number(self, element: XmlElement, ports: Mapping[str, str]) -> Condition:
        """What the leaf of a number asks. Raises :class:`Unreadable`."""
        name = self._ground(element, ports, "function")
        if name not in self._task.number_by_name:
            raise self._unknown(element, "number", name, list(self._task.number_by_name))
        number = self._task.number_by_name[name]
        least, most = (self._bound(element, port, ports) for port in BOUNDS)
        low = 0 if least is None else least - number.low
        top = (1 << len(number.digits)) - 1
        return within(number.digits, low, top if most is None or most >= number.high else most - number.low)

    def _bound(self, element: XmlElement, port: str, ports: Mapping[str, str]) -> int | None:
        if port not in element.attributes:
            return None
        value = self.value(element, port, ports)
        if not _WHOLE.fullmatch(value):
            message = f"the port '{port}' holds a whole number, not '{clip(value)}'"
            raise unreadable(self._document, element, "BBT0604", message, attribute=port)
        return int(value)

    def condition(self, element: XmlElement, ports: Mapping[str, str]) -> Condition:
        """What the leaf of a variable or a number asks. Raises :class:`Unreadable`."""
        if self.is_number(element):
            return self.number(element, ports)
        return Is(self.variable(element, ports), Truth.TRUE)

    def action(self, element: XmlElement, ports: Mapping[str, str]) -> str:
        """The action that an action leaf runs. Raises :class:`Unreadable`."""
        name = self._ground(element, ports, "action")
        if name not in self._task.action_by_name:
            raise self._unknown(element, "action", name, list(self._task.action_by_name))
        return name

    def value(self, element: XmlElement, attribute: str, ports: Mapping[str, str]) -> str:
        """The value of an attribute, ports looked up. Raises :class:`Unreadable`."""
        value = self.resolved(element.attributes[attribute], attribute, ports)
        if value is None:
            message = f"the port '{clip(element.attributes[attribute])}' has no value here"
            raise unreadable(self._document, element, "BBT0606", message, attribute=attribute)
        return value

    @staticmethod
    def resolved(value: str, attribute: str, ports: Mapping[str, str]) -> str | None:
        """A text as the value of an attribute, ports looked up; None for a port without a value."""
        if value == "{=}":
            value = f"{{{attribute}}}"
        if not (value.startswith("{") and value.endswith("}")):
            return value
        return ports.get(value[1:-1])

    def _ground(self, element: XmlElement, ports: Mapping[str, str], kind: Kind) -> str:
        symbol = self._symbol(element, kind)
        wanted = parameters_of(self._task, symbol)
        given = [key for key in element.attributes if is_port(key)]
        self._unread.took(element, *given)
        for port in wanted:
            if port not in given:
                message = f"'{clip(tag_of(element))}' needs the port '{port}'"
                other = next((key for key in given if key not in wanted), None)
                hint = f"it has no port '{clip(other)}'" if other is not None else None
                raise unreadable(self._document, element, "BBT0603", message, attribute=other, hint=hint)
        for port in given:
            if port not in wanted and not (kind == "function" and port in BOUNDS):
                message = f"'{clip(tag_of(element))}' has no port '{clip(port)}'"
                hint = f"its ports: {', '.join(wanted)}" if wanted else "it has no ports"
                raise unreadable(self._document, element, "BBT0603", message, attribute=port, hint=hint)
        return ground_name(symbol.name, tuple(self._argument(element, port, ports) for port in wanted))

    def _argument(self, element: XmlElement, port: str, ports: Mapping[str, str]) -> str:
        value = self.value(element, port, ports)
        found = self._objects.get(value)
        if found is None:
            hint = nearest(value, list(self._objects))
            message = f"no object of the task is called '{clip(value)}'"
            raise unreadable(self._document, element, "BBT0606", message, attribute=port, hint=hint)
        return found

    def _symbol(self, element: XmlElement, kind: Kind) -> Symbol:
        found = [symbol for symbol in self._found(element) if symbol.kind == kind]
        word = "action" if kind == "action" else "condition"
        if not found:
            hint = nearest(tag_of(element), list(self._possible))
            message = f"no {word} of the task is written as '{clip(tag_of(element))}'"
            raise unreadable(self._document, element, "BBT0606", message, hint=hint)
        if len(found) > 1:
            listed = ", ".join(f"{symbol.name}/{symbol.arity}" for symbol in found)
            message = f"'{clip(tag_of(element))}' may be each of {listed}"
            hint = "export the tree anew, with the notes that tell"
            raise unreadable(self._document, element, "BBT0606", message, hint=hint)
        return found[0]

    def _found(self, element: XmlElement) -> list[Symbol]:
        """The symbols an id may stand for; the notes of the file decide, then the usual spelling."""
        name = tag_of(element)
        if name in self._names.symbols:
            return [self._names.symbols[name]]
        ranks = self._possible.get(name, {})
        best: list[Symbol] = []
        for kind in ("predicate", "function", "action"):
            of_kind = {symbol: rank for symbol, rank in ranks.items() if symbol.kind == kind}
            best += [symbol for symbol, rank in of_kind.items() if rank == min(of_kind.values())]
        return best

    def _unknown(self, element: XmlElement, what: str, name: str, known: list[str]) -> Unreadable:
        message = f"the task has no {what} '{clip(name)}'"
        return unreadable(self._document, element, "BBT0606", message, hint=nearest(name, known))
