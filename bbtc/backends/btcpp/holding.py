"""What running actions hold (:mod:`bbtc.backends.commitment`) in BehaviorTree.CPP: entries of the blackboard
that the standard nodes read, or the names by which our own nodes know facts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from xml.etree.ElementTree import Element

from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.commitment import Fact, first_variable, held_by
from bbtc.backends.interface import BOUNDS, variable_symbol
from bbtc.backends.names import Namer, snake
from bbtc.ground.condition import Is, Within
from bbtc.ground.describe import bounds, describe, digit_of
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class Ports:
    """The ports of a BehaviorTree: what stands for an object there, and for the entry of a fact."""

    args: Mapping[str, str] = field(default_factory=dict)
    facts: Mapping[Fact, str] = field(default_factory=dict)
    live: bool = False
    """Whether leaves are written there as they are, in any case."""

    def used_in(self, content: Element) -> Ports:
        """Those of them that stand for an object, or for a fact that the content of the BehaviorTree uses."""
        values = (value for element in content.iter() for value in element.attrib.values())
        given = {value.partition(" := ")[0].strip("{}") for value in values}
        facts = {fact: port for fact, port in self.facts.items() if port in given}
        return replace(self, facts=facts)

    def names(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.args.values(), *self.facts.values())


class Holding:
    """Which facts are held, and where. ``own`` comes before the names of entries."""

    def __init__(self, tree: Tree, names: BtcppNames, own: str) -> None:
        self._task = tree.task
        self._names = names
        self._own = own
        self.by_action = held_by(tree)
        self.facts = tuple(dict.fromkeys(fact for held in self.by_action.values() for fact in held))
        """The facts that any action holds."""

    @cached_property
    def entries(self) -> Mapping[Fact, str]:
        """The entry of the root blackboard of each fact that is held: what it was, or ``live``."""
        namer = Namer()
        return {
            fact: f"@{self._own}held_{namer.take(snake(word), seed=word)}"
            for fact in self.facts
            for word in [self._word(fact)]
        }

    def _word(self, fact: Fact) -> str:
        condition = Is(fact, Truth.TRUE) if isinstance(fact, int) else fact
        return describe(self._task, condition)

    def entry(self, fact: Fact, ports: Ports) -> str:
        """The entry of a fact, for a port."""
        return f"{{{ports.facts.get(fact, self.entries[fact])}}}"

    def ports(self, facts: Iterable[Fact], args: Mapping[str, str]) -> Ports:
        """The ports of a BehaviorTree that has these for objects, and uses these facts: one for each of
        them that is about such an object."""
        namer = Namer({*args.values(), "name", "id"})
        found: dict[Fact, str] = {}
        for fact in dict.fromkeys(facts):
            variable = self._task.variables[first_variable(fact)]
            if fact in self.entries and not args.keys().isdisjoint(variable.args):
                words = [variable_symbol(variable).name, *(args.get(arg, arg) for arg in variable.args)]
                found[fact] = namer.take(snake("_".join(words)), seed=self._word(fact))
        return Ports(args, found)

    def named(self, facts: Iterable[Fact], args: Mapping[str, str]) -> str:
        """Facts as our own nodes call them: ``At(place=hall); At(place={place})``."""
        return "; ".join(self._name(fact, args) for fact in facts)

    def _name(self, fact: Fact, args: Mapping[str, str]) -> str:
        variable = self._task.variables[first_variable(fact)]
        symbol = variable_symbol(variable)
        values = (f"{{{args[arg]}}}" if arg in args else self._names.values[arg] for arg in variable.args)
        given = dict(zip(self._names.interface.leaves[symbol].parameters, values, strict=True))
        if isinstance(fact, Within):
            given |= bounds_given(self._task, fact)
        ports = sorted(given.items())
        return f"{self._names.ids[symbol]}({','.join(f'{port}={value}' for port, value in ports)})"


def bounds_given(task: Task, test: Within) -> dict[str, str]:
    """What a leaf of a number is given to compare with, by port; the ends of its range are no bounds."""
    least, most = bounds(task.variables, test.digits, test.low, test.high)
    digit = digit_of(task.variables, test.digits)
    ends = zip(BOUNDS, (least, most), (digit.low, digit.high), strict=True)
    return {port: str(value) for port, value, end in ends if value != end}
