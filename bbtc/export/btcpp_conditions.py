"""Three-valued conditions from the stock nodes of BehaviorTree.CPP.

A literal is a leaf: SUCCESS, FAILURE, RUNNING for true, false, unknown. What is built from leaves:

- ``not p``: Inverter, which keeps RUNNING;
- ``unknown p``, ``known p``: the leaf with its two other results forced to one, and beside it, in a
  Skipper, the answer for RUNNING; as a BehaviorTree per predicate;
- ``and``, ``or`` with at most one part that can be unknown: ReactiveSequence, ReactiveFallback with
  that part last, which are minimum and maximum then;
- other ``and``, ``or``: a Parallel that succeeds when all (one) and fails when one (all) did, which is
  minimum (maximum). A running Parallel remembers its children, so it must not be running when a tick
  ends: its result goes to a blackboard entry, a Skipper ends it, and the entry is read back.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Literal
from xml.etree.ElementTree import Element, SubElement

from typing_extensions import assert_never

from bbtc.export.interface import Interface, variable_symbol
from bbtc.export.names import Namer, Symbol
from bbtc.export.shape import can_be_unknown, words_of
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import ControlKind

_NUMBER = re.compile(r"[+-]?(?:[0-9]|\.[0-9]|inf|nan)", re.IGNORECASE)


def control(kind: ControlKind, children: Sequence[Element]) -> Element:
    """A memoryless control node."""
    match kind:
        case "sequence":
            element = Element("ReactiveSequence")
        case "fallback":
            element = Element("ReactiveFallback")
        case "skipper":
            element = Element("Parallel", success_count="1", failure_count="1")
        case "retry":  # attempts are counted where actions start
            (element,) = children
            return element
        case _:
            assert_never(kind)
    element.extend(children)
    return element


def is_numeric(value: str) -> bool:
    """Whether a value may change its type when it is passed to a SubTree: numbers do from 4.9 on."""
    return _NUMBER.match(value) is not None


class ConditionWriter:
    """Writes conditions in normal form (:func:`bbtc.export.shape.normal`) of one tree. The
    BehaviorTrees that they refer to gather in :attr:`trees`, by id."""

    def __init__(
        self,
        task: Task,
        interface: Interface,
        ids: Mapping[Symbol, str],
        values: Mapping[str, str],
        tree_ids: Namer,
    ) -> None:
        self.trees: dict[str, Element] = {}
        self._task = task
        self._interface = interface
        self._ids = ids
        self._values = values
        self._tree_ids = tree_ids
        self._tests: dict[tuple[str, Symbol], str] = {}

    def ports_of(self, tree_id: str) -> tuple[str, ...]:
        """The ports of a BehaviorTree in :attr:`trees`."""
        return next(self._parameters(s) for (_, s), known in self._tests.items() if known == tree_id)

    def uses_register(self, condition: Condition) -> bool:
        """Whether the condition, or one inside it, is written with a blackboard entry."""
        match condition:
            case And(parts) | Or(parts):
                return sum(can_be_unknown(self._task, part) for part in parts) > 1 or any(
                    self.uses_register(part) for part in parts
                )
            case Is() | Known() | Not() | Constant():
                return False
            case _:
                assert_never(condition)

    def write(self, condition: Condition, binding: Mapping[str, str]) -> Element:
        """The condition as a subtree that is never left running with something remembered.
        ``binding`` maps object names to the ports of the BehaviorTree around it."""
        if self.uses_register(condition):
            element = _read_at_once(self._kleene(condition, binding))
        else:
            element = self._kleene(condition, binding)
        match condition:
            case Is(_, Truth.TRUE) | Constant():
                pass
            case Is() | Known() | Not() | And() | Or():
                # A SubTree says all in its tag, and its name would have to be unique; a condition
                # on ports has no words of its own.
                if not binding and element.tag != "SubTree":
                    element.set("name", words_of(self._task, condition).short)
            case _:
                assert_never(condition)
        return element

    def _kleene(self, condition: Condition, binding: Mapping[str, str]) -> Element:
        match condition:
            case Constant(value):
                return Element("AlwaysSuccess" if value else "AlwaysFailure")
            case Is(variable, Truth.TRUE):
                return self._leaf(variable, binding)
            case Is(variable, Truth.FALSE):
                return _decorated("Inverter", self._leaf(variable, binding))
            case Is(variable, _):
                return self._test("Unknown", variable, binding)
            case Known(variable):
                return self._test("Known", variable, binding)
            case Not(part):
                return _decorated("Inverter", self._kleene(part, binding))
            case And(parts):
                return self._junction("sequence", parts, binding)
            case Or(parts):
                return self._junction("fallback", parts, binding)
            case _:
                assert_never(condition)

    def _junction(
        self,
        kind: Literal["sequence", "fallback"],
        parts: tuple[Condition, ...],
        binding: Mapping[str, str],
    ) -> Element:
        ordered = sorted(parts, key=lambda part: can_be_unknown(self._task, part))
        unknowable = sum(can_be_unknown(self._task, part) for part in parts)
        if unknowable <= 1:
            return control(kind, [self._kleene(part, binding) for part in ordered])
        all_of, one_of = str(len(parts)), "1"
        if kind == "sequence":
            element = Element("Parallel", success_count=all_of, failure_count=one_of)
        else:
            element = Element("Parallel", success_count=one_of, failure_count=all_of)
        element.extend(self._kleene(part, binding) for part in parts)
        return element

    def _leaf(self, variable: int, binding: Mapping[str, str]) -> Element:
        read = self._task.variables[variable]
        symbol = variable_symbol(read)
        return self._with_ports(Element(self._ids[symbol]), symbol, read.args, binding)

    def _test(self, kind: Literal["Known", "Unknown"], variable: int, binding: Mapping[str, str]) -> Element:
        read = self._task.variables[variable]
        symbol = variable_symbol(read)
        if any(is_numeric(arg) for arg in read.args):
            return _test_of(kind, self._leaf(variable, binding))
        if (kind, symbol) not in self._tests:
            tree_id = self._tree_ids.take(f"{kind}{self._ids[symbol]}", seed=symbol.name)
            ports = self._parameters(symbol)
            leaf = Element(self._ids[symbol], {port: f"{{{port}}}" for port in ports})
            self.trees[tree_id] = Element("BehaviorTree", ID=tree_id)
            self.trees[tree_id].append(_test_of(kind, leaf))
            self._tests[kind, symbol] = tree_id
        return self._with_ports(Element("SubTree", ID=self._tests[kind, symbol]), symbol, read.args, binding)

    def _with_ports(
        self, element: Element, symbol: Symbol, args: tuple[str, ...], binding: Mapping[str, str]
    ) -> Element:
        for parameter, arg in zip(self._parameters(symbol), args, strict=True):
            element.set(parameter, f"{{{binding[arg]}}}" if arg in binding else self._values[arg])
        return element

    def _parameters(self, symbol: Symbol) -> tuple[str, ...]:
        return self._interface.leaves[symbol].parameters


def _test_of(kind: Literal["Known", "Unknown"], leaf: Element) -> Element:
    forced, otherwise = (
        ("ForceSuccess", "AlwaysFailure") if kind == "Known" else ("ForceFailure", "AlwaysSuccess")
    )
    return control("skipper", [_decorated(forced, leaf), Element(otherwise)])


def _decorated(decorator: str, child: Element) -> Element:
    element = Element(decorator)
    element.append(child)
    return element


def _read_at_once(condition: Element) -> Element:
    condition.set("_onSuccess", "_value := 'true'")
    condition.set("_onFailure", "_value := 'false'")
    unknown = Element("Script", code="_value := 'unknown'")
    read = control("skipper", [_decorated("ForceSuccess", condition), unknown])
    answer = Element("Precondition", {"if": "_value != 'unknown'", "else": "RUNNING"})
    SubElement(answer, "ScriptCondition", code="_value == 'true'")
    return control("sequence", [read, answer])
