"""How the predicates of a model are used: which change, which can be unknown, which are derived."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from bbtc.ground.normal import Block, Item, normalise
from bbtc.ground.universe import Row
from bbtc.kleene import Truth
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.hidden import has_hidden_state
from bbtc.model.types import Parameter


@dataclass(frozen=True, slots=True)
class Start:
    """What can hold at the start: atoms that can be true, that can be unknown, and that are false
    in no initial state."""

    true: dict[str, list[Row]]
    unknown: dict[str, list[Row]]
    never_false: dict[str, list[Row]]

    def uncertain(self) -> set[str]:
        """Predicates of which some atom is unknown, or differs between initial states."""
        # What is true in some state and false in none stands in both lists, in the same order.
        named = {*self.true, *self.never_false}
        differing = {name for name in named if self.true.get(name) != self.never_false.get(name)}
        return {*self.unknown, *differing}


class Usage:
    """Facts about the predicates of a model with its initial states, for the stages of grounding."""

    def __init__(self, model: md.Model, start: Start) -> None:
        self.model = model
        self.start = start
        self.blocks = {name: normalise(schema.effects) for name, schema in model.schemas.items()}
        self.set_values = md.set_values(model)
        self.derived = {rule.predicate for rule in model.rules}
        self.uncertain = start.uncertain()
        self.open = open_predicates(model)
        self.hides = has_hidden_state(model)
        """Is there hidden state? Then what becomes unknown is true, or false."""
        self.doubted = self._doubted() if self.hides else set[str]()
        self._readers: dict[str, set[str]] = {}
        """By predicate: the derived ones that a rule computes from it."""
        for rule in model.rules:
            for atom in mf.atoms(rule.condition):
                self._readers.setdefault(atom.predicate, set()).add(rule.predicate)
        certain = set(model.predicates) - self.derived - self.uncertain
        self.unchanging = self._only_reading(certain - set(self.set_values))
        self.fixed = self._only_reading(certain - self.open)
        self.loose = self._loose()

    def is_static(self, predicate: str) -> bool:
        """Whether no action changes the predicate (initial states may differ in it); true of derived
        ones, too, where nothing they read changes or is uncertain."""
        if predicate in self.derived:
            return predicate in self.unchanging
        return predicate not in self.set_values

    def can_be_unknown(self, predicate: str) -> bool:
        """Whether some atom of the predicate may be unknown at some time."""
        if predicate in self.derived:
            possible = self.hides or self.model.predicates[predicate].three_valued
            return predicate not in self.unchanging and possible
        if predicate in self.doubted:
            return True
        return Truth.UNKNOWN in self.set_values.get(predicate, ()) or bool(self.start.unknown.get(predicate))

    def _doubted(self) -> set[str]:
        """Predicates of which something asks whether they are known, and which effects that read hidden facts
        may leave unknown: any that an effect sets, for all that is known here."""
        formulas = [schema.precondition for schema in self.model.schemas.values()]
        formulas += [
            guard for schema in self.model.schemas.values() for guard in me.conditions(schema.effects)
        ]
        formulas += [
            condition for each in self.model.templates.values() for condition in md.conditions(each.body)
        ]
        formulas += [rule.condition for rule in self.model.rules]
        formulas += [] if self.model.goal is None else [self.model.goal]
        asked = {
            reading.atom.predicate
            for formula in formulas
            for reading in mf.readings(formula)
            if reading.value in {Truth.UNKNOWN, None}
        }
        return asked & self.set_values.keys()

    def _only_reading(self, base: set[str]) -> set[str]:
        """Derived predicates that only read, all the way down, predicates of ``base``. Where these are
        certain and never change, so are they: ``unchanging`` in the model, ``fixed`` whatever others do."""
        found = set(self.derived)
        others = [name for name in self._readers if name not in base and name not in found]
        while others:
            lost = found.intersection(self._readers.get(others.pop(), ()))
            found -= lost
            others.extend(lost)
        return found

    def _loose(self) -> set[tuple[str, int]]:
        """Argument positions that may hold objects outside their declared type, because an effect
        or a rule sets them through a parameter of a more general type."""
        loose: set[tuple[str, int]] = set()
        types = self.model.types

        def look(predicate: str, args: tuple[mf.Term, ...], around: tuple[Parameter, ...]) -> None:
            scope = {parameter.name: parameter for parameter in around}
            declared = self.model.predicates[predicate].parameters
            for position, (arg, parameter) in enumerate(zip(args, declared, strict=True)):
                if arg in scope and not types.fits(scope[arg].types, parameter.types):
                    loose.add((predicate, position))

        for name, schema in self.model.schemas.items():
            for item, around in items(self.blocks[name], schema.parameters):
                if isinstance(item.leaf, me.Set):
                    look(item.leaf.predicate, item.leaf.args, around)
        for rule in self.model.rules:
            look(rule.predicate, rule.args, rule.parameters)
        return loose


def items(block: Block, around: tuple[Parameter, ...]) -> Iterator[tuple[Item, tuple[Parameter, ...]]]:
    """Every item of a block, those of its chances included, with all parameters in scope."""
    for item in block.items:
        yield item, around + item.parameters
    for chance in block.chances:
        for _, branch in chance.branches:
            yield from items(branch, around + chance.parameters)


def open_predicates(model: md.Model) -> frozenset[str]:
    """Predicates whose facts may change in the world, whatever the model's actions can reach: those that an
    effect mentions, and those declared as external."""
    mentioned = {leaf.predicate for each in model.schemas.values() for leaf in me.settings(each.effects)}
    return frozenset(mentioned | {name for name, each in model.predicates.items() if each.external})


def called(model: md.Model) -> set[str]:
    """Names of the schemas that template bodies call."""
    bodies = [template.body for template in model.templates.values()]
    return {call.name for body in bodies for call in md.calls(body) if call.kind == "action"}
