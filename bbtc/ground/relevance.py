"""Which actions and variables can matter to the goal, found before any action is made.

This is the backward relevance of :mod:`bbtc.ground.prune` on argument rows, for tasks without
templates: a task with a million actions is then made once, with what matters only.
"""

from __future__ import annotations

from itertools import compress

from bbtc.diagnostics import Report
from bbtc.ground.atoms import Atoms
from bbtc.ground.condition import Condition, variables
from bbtc.ground.effects import EffectLowering, LoweredEffect
from bbtc.ground.lower import Frame, Lowered, Lowering
from bbtc.ground.universe import Row
from bbtc.model import domain as md
from bbtc.model import effect as me

_SWEEPS = 6


class _Rows:
    """The rows of one schema, and which of them matter."""

    def __init__(self, atoms: Atoms, schema: md.Schema, rows: list[Row]) -> None:
        lowering = Lowering(atoms)
        self.frame = Frame(atoms.universe, schema.parameters)
        self.precondition: Lowered = lowering.condition(schema.precondition, self.frame, strict=True)
        block = atoms.reach.usage.blocks[schema.name]
        # What is reported here is reported again when the actions are made.
        effects = EffectLowering(lowering, Report())
        self.effect: LoweredEffect = effects.effect(block, self.frame)
        self.guarded = next(me.conditions(schema.effect), None) is not None
        self.rows = rows
        self.kept = bytearray(len(rows))


class Relevance:
    """The closure: ``read`` are the variables that matter, as numbers of ``atoms``."""

    def __init__(self, atoms: Atoms, goal: Condition, rows: list[list[Row]]) -> None:
        self._atoms = atoms
        model = atoms.model
        self._schemas = [
            _Rows(atoms, schema, each) for schema, each in zip(model.schemas.values(), rows, strict=True)
        ]
        self.read: set[int] = set(variables(goal))
        if model.metric == "reward":
            for schema, each in zip(model.schemas.values(), self._schemas, strict=True):
                if any(isinstance(leaf, me.Add) and leaf.to == "reward" for leaf in me.leaves(schema.effect)):
                    for index in range(len(each.rows)):
                        self._keep(each, index)
        self._close()

    def rows(self) -> list[list[Row]]:
        """The rows that matter, in their order."""
        return [
            each.rows if all(each.kept) else list(compress(each.rows, each.kept)) for each in self._schemas
        ]

    def keep(self) -> set[tuple[str, Row]]:
        """The variables that matter."""
        return {self._atoms.keys[number] for number in self.read}

    def _close(self) -> None:
        """Sweep over the rows until nothing changes; where that takes long, follow an index instead."""
        for _ in range(_SWEEPS):
            before = len(self.read)
            for each in self._schemas:
                for index in range(len(each.rows)):
                    if each.guarded or not each.kept[index]:
                        self._look(each, index)
            if len(self.read) == before:
                return
        self._follow()

    def _look(self, each: _Rows, index: int) -> None:
        """Keep a row if it sets a variable that matters; then what it reads matters, too."""
        for number, guard in each.effect.settings(each.frame.env(each.rows[index]), []):
            if number in self.read:
                self._keep(each, index)
                self.read.update(number for part in guard for number in variables(part))

    def _keep(self, each: _Rows, index: int) -> None:
        if not each.kept[index]:
            each.kept[index] = 1
            self.read.update(variables(each.precondition(each.frame.env(each.rows[index]))))

    def _follow(self) -> None:
        """Look again at the rows that set a variable, whenever one turns out to matter."""
        setters: dict[int, list[tuple[_Rows, int]]] = {}
        for each in self._schemas:
            for index in range(len(each.rows)):
                if each.guarded or not each.kept[index]:
                    env = each.frame.env(each.rows[index])
                    for number in {number for number, _ in each.effect.settings(env, [])}:
                        setters.setdefault(number, []).append((each, index))
        done: set[int] = set()
        while self.read != done:
            for number in sorted(self.read - done):
                done.add(number)
                for each, index in setters.get(number, ()):
                    self._look(each, index)
