"""What is reachable when nothing is ever taken back: atoms with their values, and bindings."""

from __future__ import annotations

from dataclasses import dataclass

from bbtc.ground.reachability.datalog import derive
from bbtc.ground.reachability.program import LETTER, ProgramBuilder
from bbtc.ground.reachability.usage import Start, Usage
from bbtc.ground.start import Beginning
from bbtc.ground.universe import Row, Universe
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md

_SMALL = 20_000
"""Up to this many conceivable facts the program runs in this process."""
_NONE: frozenset[Row] = frozenset()


@dataclass(frozen=True, slots=True)
class Reach:
    """``values`` maps a value to the atoms of each predicate that can have it, initial atoms
    included; under "false" stand only those that become false, see :meth:`can_be`. ``actions`` and
    ``templates`` hold the bindings of each, sorted, in the order of the model.
    """

    usage: Usage
    universe: Universe
    values: dict[Truth, dict[str, set[Row]]]
    never_false: dict[str, set[Row]]
    actions: list[list[Row]]
    templates: list[list[Row]]

    def can_be(self, value: Truth, predicate: str, row: Row) -> bool:
        """Whether the atom can have the value at some time."""
        if value is Truth.FALSE and row not in self.never_false.get(predicate, _NONE):
            return True
        return row in self.values[value][predicate]


def reach(model: md.Model, begin: Beginning, limits: Limits) -> Reach:
    """The least fixpoint. Raises :class:`bbtc.diagnostics.LimitReached`."""
    universe = Universe(model)
    start = _start(universe, begin)
    usage = Usage(model, start)
    builder = ProgramBuilder(usage, universe)
    program = builder.build()
    counted = frozenset((*program.actions, *program.templates))
    small = program.bound + len(program.lines) <= _SMALL
    derived = derive(program.lines, program.outputs, counted, limits, small=small)
    initial = {Truth.TRUE: start.true, Truth.UNKNOWN: start.unknown, Truth.FALSE: {}}
    values = {
        value: {
            name: {*derived.get(f"{letter}{number}", ()), *initial[value].get(name, ())}
            for name, number in builder.number.items()
        }
        for value, letter in LETTER.items()
    }
    for name in (*program.actions, *program.templates):
        derived[name].sort()
    return Reach(
        usage,
        universe,
        values,
        {name: set(rows) for name, rows in start.never_false.items()},
        [derived[name] for name in program.actions],
        [derived[name] for name in program.templates],
    )


def _start(universe: Universe, begin: Beginning) -> Start:
    possible: dict[tuple[str, tuple[str, ...]], set[Truth]] = {
        atom: {value} for atom, value in begin.facts.items()
    }
    for atom in {atom: None for _, world in begin.states for atom in world}:
        otherwise = begin.facts.get(atom, Truth.FALSE)
        possible[atom] = {world.get(atom, otherwise) for _, world in begin.states}
    start = Start({}, {}, {})
    for (predicate, args), values in possible.items():
        row = universe.row(args)
        if Truth.TRUE in values:
            start.true.setdefault(predicate, []).append(row)
        if Truth.UNKNOWN in values:
            start.unknown.setdefault(predicate, []).append(row)
        if Truth.FALSE not in values:
            start.never_false.setdefault(predicate, []).append(row)
    return start
