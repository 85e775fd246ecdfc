"""Three-valued conditions from the stock nodes of BehaviorTree.CPP.

A literal is a leaf: SUCCESS, FAILURE, RUNNING for true, false, unknown. What is built from leaves:

- ``not p``: Inverter, which keeps RUNNING;
- ``n >= 5``, ``2 <= n <= 5``: the leaf of the number, with the bounds in its ports;
- ``unknown p``, ``known p``: the leaf with its two other results forced to one, and beside it, in a
  Skipper, the answer for RUNNING; as a BehaviorTree per predicate;
- ``and``, ``or`` with at most one part that can be unknown: ReactiveSequence, ReactiveFallback with
  that part last, which are minimum and maximum then;
- other ``and``, ``or``: a Parallel that succeeds when all (one) and fails when one (all) did, which is
  minimum (maximum). A running Parallel remembers its children, so it must not be running when a tick
  ends: its result goes to a blackboard entry, a Skipper ends it, and the entry is read back.

A leaf that a running action may hold stands in a BehaviorTree that asks the entry of its fact first.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal
from xml.etree.ElementTree import Element

from typing_extensions import assert_never

from bbtc.backends.btcpp.bindings.bound import NEGATION
from bbtc.backends.btcpp.holding import Holding, Ports, bounds_given
from bbtc.backends.btcpp.idioms import Idioms, decorated
from bbtc.backends.btcpp.names import BtcppNames, TreeIds, is_numeric, ports_for
from bbtc.backends.commitment import Fact, facts_read, first_variable
from bbtc.backends.interface import variable_symbol
from bbtc.backends.names import Namer, Symbol
from bbtc.backends.shape import can_be_unknown, words_of
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, variables
from bbtc.ground.task import Task
from bbtc.kleene import Truth


class ConditionWriter:
    """Writes conditions as :func:`bbtc.backends.shape.written` shapes them. The BehaviorTrees that they
    refer to gather in :attr:`trees`, by id, with their ports in :attr:`ports`."""

    def __init__(
        self, task: Task, names: BtcppNames, tree_ids: TreeIds, idioms: Idioms, holding: Holding
    ) -> None:
        self.trees: dict[str, Element] = {}
        self.ports: dict[str, tuple[str, ...]] = {}
        self._task = task
        self._names = names
        self._tree_ids = tree_ids
        self._idioms = idioms
        self._holding = holding
        self._tests: dict[tuple[str, Symbol, bool], str] = {}
        self._around: dict[tuple[str, Symbol], str] = {}
        self._registers: dict[Condition, tuple[str, Ports]] = {}

    def uses_register(self, condition: Condition) -> bool:
        """Whether the condition, or one inside it, is written with a blackboard entry."""
        match condition:
            case And(parts) | Or(parts):
                return sum(can_be_unknown(self._task, part) for part in parts) > 1 or any(
                    self.uses_register(part) for part in parts
                )
            case Is() | Known() | Within() | Not() | Constant():
                return False
            case _:
                assert_never(condition)

    def label(self, condition: Condition, ports: Ports) -> str:
        """The name that a condition gets where it has none of its own."""
        return words_of(self._task, condition, ports.args).short

    def write(self, condition: Condition, ports: Ports) -> Element:
        """The condition as a subtree that is never left running with something remembered.
        ``ports`` are those of the BehaviorTree around it."""
        if self.uses_register(condition):
            element = self._idioms.read_at_once(self._kleene(condition, ports))
        else:
            element = self._kleene(condition, ports)
        match condition:
            case Is(_, Truth.TRUE) | Constant():
                pass
            case Is() | Known() | Within() | Not() | And() | Or():
                # A SubTree says all in its tag, and its name would have to be unique.
                if element.tag != "SubTree":
                    element.set("name", self.label(condition, ports))
            case _:
                assert_never(condition)
        return element

    def write_apart(self, condition: Condition, ports: Ports) -> Element:
        """The condition as a BehaviorTree of its own, and the SubTree that calls it."""
        if condition not in self._registers:
            words = words_of(self._task, condition)
            tree_id = self._tree_ids.take(self._title(condition), seed=words.full)
            inside = self._ports(condition)
            tree = Element("BehaviorTree", ID=tree_id)
            tree.set("_description", f"{words_of(self._task, condition, inside.args).full}, three-valued")
            tree.append(self.write(condition, inside))
            self._registers[condition] = tree_id, inside
            self.trees[tree_id] = tree
            self.ports[tree_id] = inside.names()
        tree_id, inside = self._registers[condition]
        element = Element("SubTree", ID=tree_id)
        self.give(element, inside, ports)
        return element

    def give(self, element: Element, inside: Ports, ports: Ports) -> None:
        """Set the ports ``inside`` a BehaviorTree at the SubTree that calls it."""
        for arg, port in inside.args.items():
            element.set(port, self.value(arg, ports))
        for fact, port in inside.facts.items():
            element.set(port, self._holding.entry(fact, ports))

    def shared(self, facts: Iterable[Fact], args: Mapping[str, str]) -> Ports:
        """The ports of a BehaviorTree that reads or notes these facts. Only standard nodes need entries."""
        return self._holding.ports(facts, args) if self._idioms.profile == "stock" else Ports(args)

    def notes(self, facts: Sequence[Fact], ports: Ports) -> list[Element]:
        """Nodes that write down what facts are, for standard nodes. Where some facts of a predicate are about
        no argument, all of them are written out, as they are for other arguments: such actions share a
        BehaviorTree."""
        if self._idioms.profile != "stock":
            return []
        symbols = {fact: variable_symbol(self._task.variables[first_variable(fact)]) for fact in facts}
        outright = {symbol for fact, symbol in symbols.items() if fact not in ports.facts}
        return [
            self._kept("Note", fact, Ports() if symbol in outright else ports)
            for fact, symbol in symbols.items()
        ]

    def value(self, arg: str, ports: Ports) -> str:
        """An object as the value of a port."""
        return f"{{{ports.args[arg]}}}" if arg in ports.args else self._names.values[arg]

    def _ports(self, condition: Condition) -> Ports:
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
        return self.shared(facts_read(self._task, condition), ports_for(uses))

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
            case Within(digits):
                return self._names.plain[variable_symbol(self._task.variables[digits[0]])]
            case Not(part):
                return "Not" + self._title(part)
            case And(parts):
                return "And".join(map(self._title, parts))
            case Or(parts):
                return "Or".join(map(self._title, parts))
            case _:
                assert_never(condition)

    def _kleene(self, condition: Condition, ports: Ports) -> Element:
        match condition:
            case Constant(value):
                return Element("AlwaysSuccess" if value else "AlwaysFailure")
            case Is(variable, Truth.TRUE):
                return self._leaf(variable, ports)
            case Is(variable, Truth.FALSE):
                leaf = self._leaf(variable, ports)
                # One that answers the contrary is inverted already.
                return leaf[0] if leaf.tag == NEGATION else decorated(NEGATION, leaf)
            case Is(variable, _):
                return self._test("unknown", variable, ports)
            case Known(variable):
                return self._test("known", variable, ports)
            case Within():
                return self._number(condition, ports)
            case Not(part):
                return decorated(NEGATION, self._kleene(part, ports))
            case And(parts):
                return self._junction("sequence", parts, ports)
            case Or(parts):
                return self._junction("fallback", parts, ports)
            case _:
                assert_never(condition)

    def _junction(
        self,
        kind: Literal["sequence", "fallback"],
        parts: tuple[Condition, ...],
        ports: Ports,
    ) -> Element:
        elements = [self._kleene(part, ports) for part in parts]
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

    def _leaf(self, variable: int, ports: Ports) -> Element:
        if self._is_held(variable, ports):
            return self._kept("Held", variable, ports)
        read = self._task.variables[variable]
        symbol = variable_symbol(read)
        bound = self._names.bound.element(symbol, read.args, partial(self.value, ports=ports))
        if bound is not None:
            return bound
        return self._with_ports(Element(self._names.ids[symbol]), symbol, read.args, ports)

    def _is_held(self, variable: int, ports: Ports) -> bool:
        return not ports.live and variable in self._holding.entries

    def _kept(self, kind: Literal["Held", "Note"], fact: Fact, ports: Ports) -> Element:
        """A leaf that may be held, or the note of what it reads: a BehaviorTree of each predicate, but for
        numbers, which may change on their way into one, and for our own node."""
        write = self._idioms.held if kind == "Held" else self._idioms.note
        read, entry = self._task.variables[first_variable(fact)], self._holding.entry(fact, ports)
        symbol, live = variable_symbol(read), replace(ports, live=True)
        if isinstance(fact, Within):
            return write(self._number(fact, live), entry if kind == "Held" else entry[1:-1])
        outright = any(is_numeric(arg) for arg in read.args) or symbol in self._names.bound.leaves
        if self._idioms.profile == "bbtc" or outright:
            leaf = self._leaf(fact, live)
            return write(leaf, entry if kind == "Held" else entry[1:-1])
        port = self._entry_port(symbol)
        if (kind, symbol) not in self._around:
            leaf = write(
                self._passed(self._names.ids[symbol], symbol), f"{{{port}}}" if kind == "Held" else port
            )
            self._around[kind, symbol] = self._tree(f"{kind}{self._names.plain[symbol]}", symbol, leaf, port)
        element = Element("SubTree", ID=self._around[kind, symbol])
        element = self._with_ports(element, symbol, read.args, ports)
        element.set(port, entry)
        return element

    def _entry_port(self, symbol: Symbol) -> str:
        """The port of a BehaviorTree for a predicate that stands for the entry of the fact."""
        return Namer(self._parameters(symbol)).take("held", seed="held")

    def _passed(self, tag: str, symbol: Symbol) -> Element:
        """A node with the parameters of a predicate, in a BehaviorTree that has them for ports."""
        return Element(tag, {port: f"{{{port}}}" for port in self._parameters(symbol)})

    def _tree(self, title: str, symbol: Symbol, content: Element, *more: str) -> str:
        """The id of a new BehaviorTree with the parameters of a predicate for ports, and more."""
        tree_id = self._tree_ids.take(title, seed=symbol.name)
        self.trees[tree_id] = Element("BehaviorTree", ID=tree_id)
        self.trees[tree_id].append(content)
        self.ports[tree_id] = (*self._parameters(symbol), *more)
        return tree_id

    def _number(self, test: Within, ports: Ports) -> Element:
        """The leaf of a number with what it is compared with; the ends of its range are no bounds."""
        if not ports.live and test in self._holding.entries:
            return self._kept("Held", test, ports)
        element = self._leaf(test.digits[0], ports)
        for port, value in bounds_given(self._task, test).items():
            element.set(port, value)
        return element

    def _test(self, kind: Literal["known", "unknown"], variable: int, ports: Ports) -> Element:
        read = self._task.variables[variable]
        symbol = variable_symbol(read)
        if any(is_numeric(arg) for arg in read.args) or symbol in self._names.bound.leaves:
            return self._idioms.test(kind, self._leaf(variable, ports))
        held = self._is_held(variable, ports)
        entry = self._entry_port(symbol) if held and self._idioms.profile == "stock" else None
        if (kind, symbol, held) not in self._tests:
            title = f"{kind.capitalize()}{self._names.plain[symbol]}"
            leaf = self._passed(self._names.ids[symbol], symbol)
            if entry is not None:
                self._leaf(variable, ports)  # so that there is the BehaviorTree to call
                leaf = self._passed("SubTree", symbol)
                leaf.attrib = {"ID": self._around["Held", symbol], **leaf.attrib, entry: f"{{{entry}}}"}
            elif held:
                leaf = self._idioms.held(leaf, "")
            more = [] if entry is None else [entry]
            self._tests[kind, symbol, held] = self._tree(title, symbol, self._idioms.test(kind, leaf), *more)
        element = Element("SubTree", ID=self._tests[kind, symbol, held])
        element = self._with_ports(element, symbol, read.args, ports)
        if entry is not None:
            element.set(entry, self._holding.entry(variable, ports))
        return element

    def _with_ports(self, element: Element, symbol: Symbol, args: tuple[str, ...], ports: Ports) -> Element:
        for parameter, arg in zip(self._parameters(symbol), args, strict=True):
            element.set(parameter, self.value(arg, ports))
        return element

    def _parameters(self, symbol: Symbol) -> tuple[str, ...]:
        return self._names.interface.leaves[symbol].parameters
