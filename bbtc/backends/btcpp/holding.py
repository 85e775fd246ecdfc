"""What running actions hold (:mod:`bbtc.backends.commitment`) in BehaviorTree.CPP: entries of the blackboard
that the standard nodes read, or the names by which our own nodes know facts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from xml.etree.ElementTree import Element

from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.commitment import held_by
from bbtc.backends.interface import variable_symbol
from bbtc.backends.names import Namer, Symbol, snake
from bbtc.ground.task import Variable
from bbtc.tree.nodes import Tree


@dataclass(frozen=True, slots=True)
class Ports:
    """The ports of a BehaviorTree: what stands for an object there, and for the entry of a fact."""

    args: Mapping[str, str] = field(default_factory=dict)
    facts: Mapping[int, str] = field(default_factory=dict)
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
        self.facts = tuple(sorted({fact for held in self.by_action.values() for fact in held}))
        """The facts that any action holds."""

    @cached_property
    def entries(self) -> Mapping[int, str]:
        """The entry of the root blackboard of each fact that is held: what it was, or ``live``."""
        namer = Namer()
        return {
            fact: f"@{self._own}held_{namer.take(snake(variable.name), seed=variable.name)}"
            for fact in self.facts
            for variable in [self._task.variables[fact]]
        }

    def entry(self, fact: int, ports: Ports) -> str:
        """The entry of a fact, for a port."""
        return f"{{{ports.facts.get(fact, self.entries[fact])}}}"

    def ports(self, facts: Iterable[int], args: Mapping[str, str]) -> Ports:
        """The ports of a BehaviorTree that has these for objects, and uses these facts: one for each of
        them that is about such an object."""
        namer = Namer({*args.values(), "name", "id"})
        found: dict[int, str] = {}
        for fact in dict.fromkeys(facts):
            variable = self._task.variables[fact]
            if fact in self.entries and not args.keys().isdisjoint(variable.args):
                words = [variable.predicate, *(args.get(arg, arg) for arg in variable.args)]
                found[fact] = namer.take(snake("_".join(words)), seed=variable.name)
        return Ports(args, found)

    def named(self, facts: Iterable[int], args: Mapping[str, str]) -> str:
        """Facts as our own nodes call them: ``At(place=hall); At(place={place})``."""
        return "; ".join(self._name(self._task.variables[fact], args) for fact in facts)

    def _name(self, variable: Variable, args: Mapping[str, str]) -> str:
        symbol: Symbol = variable_symbol(variable)
        values = (f"{{{args[arg]}}}" if arg in args else self._names.values[arg] for arg in variable.args)
        ports = sorted(zip(self._names.interface.leaves[symbol].parameters, values, strict=True))
        return f"{self._names.ids[symbol]}({','.join(f'{port}={value}' for port, value in ports)})"
