"""What is reachable when nothing is ever taken back: atoms with their values, and bindings."""

from __future__ import annotations

from dataclasses import dataclass

from bbtc.ground.datalog import Row, derive
from bbtc.ground.program import Builder, Start
from bbtc.ground.start import Beginning
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.model import domain as md

_SMALL = 20_000
"""Up to this many conceivable bindings the program runs in this process."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Rows are object indices, in the order of :attr:`Model.objects`.

    ``values`` maps a value to the atoms of each predicate that can have it, initial atoms included;
    "false" lists only what becomes false or is asked about, see :meth:`can_be`. ``actions`` and
    ``templates`` hold the bindings of each, in the order of the model.
    """

    values: dict[Truth, dict[str, set[Row]]]
    never_false: dict[str, set[Row]]
    actions: list[list[Row]]
    templates: list[list[Row]]
    static: frozenset[str]

    def can_be(self, value: Truth, predicate: str, row: Row) -> bool:
        """Whether the atom can have the value at some time."""
        if value is Truth.FALSE and row not in self.never_false.get(predicate, ()):
            return True
        return row in self.values[value].get(predicate, ())


def reach(model: md.Model, begin: Beginning, limits: Limits) -> Reach:
    """The least fixpoint. Raises :class:`bbtc.diagnostics.LimitReached`."""
    start = _start(model, begin)
    builder = Builder(model, start)
    program = builder.build()
    facts = sum(map(len, start.true.values())) + sum(map(len, start.unknown.values()))
    derived = derive(
        program.lines,
        program.outputs,
        frozenset(program.counted),
        limits,
        small=program.bound + facts <= _SMALL,
    )
    values: dict[Truth, dict[str, set[Row]]] = {}
    for value, letter in ((Truth.TRUE, "t"), (Truth.FALSE, "f"), (Truth.UNKNOWN, "u")):
        initial = {Truth.TRUE: start.true, Truth.UNKNOWN: start.unknown, Truth.FALSE: {}}[value]
        values[value] = {
            name: {*derived.get(f"{letter}{number}", ()), *initial.get(name, ())}
            for name, number in builder.number.items()
        }
    return Reach(
        values,
        {name: set(rows) for name, rows in start.never_false.items()},
        [sorted(derived[lifted.predicate]) for lifted in builder.actions],
        [sorted(derived[lifted.predicate]) for lifted in builder.templates],
        frozenset(name for name in model.predicates if builder.is_static(name)),
    )


def _start(model: md.Model, begin: Beginning) -> Start:
    index = {name: position for position, name in enumerate(model.objects)}
    possible: dict[tuple[str, tuple[str, ...]], set[Truth]] = {
        atom: {value} for atom, value in begin.facts.items()
    }
    drawn = {atom for _, world in begin.states for atom in world}
    for atom in drawn:
        otherwise = begin.facts.get(atom, Truth.FALSE)
        possible[atom] = {world.get(atom, otherwise) for _, world in begin.states}
    start = Start({}, {}, {})
    for (predicate, args), values in possible.items():
        row = tuple(index[arg] for arg in args)
        if Truth.TRUE in values:
            start.true.setdefault(predicate, []).append(row)
        if Truth.UNKNOWN in values:
            start.unknown.setdefault(predicate, []).append(row)
        if Truth.FALSE not in values:
            start.never_false.setdefault(predicate, []).append(row)
    for rows in (start.true, start.unknown, start.never_false):
        for each in rows.values():
            each.sort()
    return start
