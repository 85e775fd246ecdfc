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

from collections.abc import Mapping
from functools import partial
from typing import Literal
from xml.etree.ElementTree import Element

from typing_extensions import assert_never

from bbtc.backends.btcpp.bindings.bound import NEGATION
from bbtc.backends.btcpp.idioms import Idioms, decorated
from bbtc.backends.btcpp.names import BtcppNames, TreeIds, is_numeric, ports_for
from bbtc.backends.interface import variable_symbol
from bbtc.backends.names import Symbol
from bbtc.backends.shape import can_be_unknown, words_of
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, variables
from bbtc.ground.task import Task
from bbtc.kleene import Truth


class ConditionWriter:
    """Writes conditions as :func:`bbtc.backends.shape.written` shapes them. The BehaviorTrees that they
    refer to gather in :attr:`trees`, by id, with their ports in :attr:`ports`."""

    def __init__(self, task: Task, names: BtcppNames, tree_ids: TreeIds, idioms: Idioms) -> None:
        self.trees: dict[str, Element] = {}
        self.ports: dict[str, tuple[str, ...]] = {}
        self._task = task
        self._names = names
        self._tree_ids = tree_ids
        self._idioms = idioms
        self._tests: dict[tuple[str, Symbol], str] = {}
        self._registers: dict[Condition, tuple[str, dict[str, str]]] = {}

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

    def label(self, condition: Condition, binding: Mapping[str, str]) -> str:
        """The name that a condition gets where it has none of its own."""
        return words_of(self._task, condition, binding).short

    def write(self, condition: Condition, binding: Mapping[str, str]) -> Element:
        """The condition as a subtree that is never left running with something remembered.
        ``binding`` maps object names to the ports of the BehaviorTree around it."""
        if self.uses_register(condition):
            element = self._idioms.read_at_once(self._kleene(condition, binding))
        else:
            element = self._kleene(condition, binding)
        match condition:
            case Is(_, Truth.TRUE) | Constant():
                pass
            case Is() | Known() | Not() | And() | Or():
                # A SubTree says all in its tag, and its name would have to be unique.
                if element.tag != "SubTree":
                    element.set("name", self.label(condition, binding))
            case _:
                assert_never(condition)
        return element

    def write_apart(self, condition: Condition, binding: Mapping[str, str]) -> Element:
        """The condition as a BehaviorTree of its own, and the SubTree that calls it."""
        if condition not in self._registers:
            words = words_of(self._task, condition)
            tree_id = self._tree_ids.take(self._title(condition), seed=words.full)
            ports = self._ports(condition)
            tree = Element("BehaviorTree", ID=tree_id)
            tree.set("_description", f"{words_of(self._task, condition, ports).full}, three-valued")
            tree.append(self.write(condition, ports))
            self._registers[condition] = tree_id, ports
            self.trees[tree_id] = tree
            self.ports[tree_id] = tuple(ports.values())
        tree_id, ports = self._registers[condition]
        element = Element("SubTree", ID=tree_id)
        for arg, port in ports.items():
            element.set(port, self.value(arg, binding))
        return element

    def value(self, arg: str, binding: Mapping[str, str]) -> str:
        """An object as the value of a port."""
        return f"{{{binding[arg]}}}" if arg in binding else self._names.values[arg]

    def _ports(self, condition: Condition) -> dict[str, str]:
        """A port for every object of a condition, named as the parameter it first stands for."""
        uses = (
            (parameter, arg)
            for variable in dict.fromkeys(variables(condition))
            for parameter, arg in zip(
                self._parameters(variable_symbol(self._task.variables[variable])),
                self._task.variables[variable].args,
                strict=True,
            )
        )
        return ports_for(uses)

    def _title(self, condition: Condition) -> str:
        match condition:
            case Constant(value):
                return str(value)
            case Is(variable, Truth.TRUE):
                return self._names.plain[variable_symbol(self._task.variables[variable])]
            case Is(variable, value):
                word = "Not" if value is Truth.FALSE else "Unknown"
                return word + self._names.plain[variable_symbol(self._task.variables[variable])]
            case Known(variable):
                return "Known" + self._names.plain[variable_symbol(self._task.variables[variable])]
            case Not(part):
                return "Not" + self._title(part)
            case And(parts):
                return "And".join(map(self._title, parts))
            case Or(parts):
                return "Or".join(map(self._title, parts))
            case _:
                assert_never(condition)

    def _kleene(self, condition: Condition, binding: Mapping[str, str]) -> Element:
        match condition:
            case Constant(value):
                return Element("AlwaysSuccess" if value else "AlwaysFailure")
            case Is(variable, Truth.TRUE):
                return self._leaf(variable, binding)
            case Is(variable, Truth.FALSE):
                leaf = self._leaf(variable, binding)
                # One that answers the contrary is inverted already.
                return leaf[0] if leaf.tag == NEGATION else decorated(NEGATION, leaf)
            case Is(variable, _):
                return self._test("unknown", variable, binding)
            case Known(variable):
                return self._test("known", variable, binding)
            case Not(part):
                return decorated(NEGATION, self._kleene(part, binding))
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
        elements = [self._kleene(part, binding) for part in parts]
        unknowable = sum(can_be_unknown(self._task, part) for part in parts)
        if unknowable <= 1:
            return self._idioms.control(kind, elements)
        all_of, one_of = str(len(parts)), "1"
        if kind == "sequence":
            element = Element("Parallel", success_count=all_of, failure_count=one_of)
        else:
            element = Element("Parallel", success_count=one_of, failure_count=all_of)
        element.extend(elements)
        return element

    def _leaf(self, variable: int, binding: Mapping[str, str]) -> Element:
        read = self._task.variables[variable]
        symbol = variable_symbol(read)
        bound = self._names.bound.element(symbol, read.args, partial(self.value, binding=binding))
        if bound is not None:
            return bound
        return self._with_ports(Element(self._names.ids[symbol]), symbol, read.args, binding)

    def _test(self, kind: Literal["known", "unknown"], variable: int, binding: Mapping[str, str]) -> Element:
        read = self._task.variables[variable]
        symbol = variable_symbol(read)
        if any(is_numeric(arg) for arg in read.args) or symbol in self._names.bound.leaves:
            return self._idioms.test(kind, self._leaf(variable, binding))
        if (kind, symbol) not in self._tests:
            title = f"{kind.capitalize()}{self._names.plain[symbol]}"
            tree_id = self._tree_ids.take(title, seed=symbol.name)
            ports = self._parameters(symbol)
            leaf = Element(self._names.ids[symbol], {port: f"{{{port}}}" for port in ports})
            self.trees[tree_id] = Element("BehaviorTree", ID=tree_id)
            self.trees[tree_id].append(self._idioms.test(kind, leaf))
            self.ports[tree_id] = ports
            self._tests[kind, symbol] = tree_id
        return self._with_ports(Element("SubTree", ID=self._tests[kind, symbol]), symbol, read.args, binding)

    def _with_ports(
        self, element: Element, symbol: Symbol, args: tuple[str, ...], binding: Mapping[str, str]
    ) -> Element:
        for parameter, arg in zip(self._parameters(symbol), args, strict=True):
            element.set(parameter, self.value(arg, binding))
        return element

    def _parameters(self, symbol: Symbol) -> tuple[str, ...]:
        return self._names.interface.leaves[symbol].parameters
