"""Which actions and variables can matter to the goal, found before any action is made.

This is the backward relevance of :mod:`bbtc.ground.prune` on argument rows, for tasks without
templates: a task with a million actions is then made once, with what matters only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import compress

from bbtc.diagnostics import Report
from bbtc.ground.atoms import Atoms
from bbtc.ground.condition import Condition, variables
from bbtc.ground.effects import EffectLowering
from bbtc.ground.lower import Env, Frame, Lowering
from bbtc.ground.normal import conjuncts, normal_form
from bbtc.ground.universe import Row
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf

_SWEEPS = 6


class _Rows:
    """The rows of one schema, and which of them matter."""

    def __init__(self, lowering: Lowering, schema: md.Schema, rows: list[Row]) -> None:
        self.rows = rows
        self.kept = bytearray(len(rows))
        self.frame = Frame(lowering.universe, schema.parameters)
        block = lowering.atoms.reach.usage.blocks[schema.name]
        # What is reported here is reported again when the actions are made.
        self.effect = EffectLowering(lowering, Report()).effect(block, self.frame)
        self.guarded = next(me.conditions(schema.effect), None) is not None
        self._precondition = lowering.condition(schema.precondition, self.frame, strict=True)
        self._literals = _literals(lowering, schema.precondition, self.frame)

    def reads(self, env: Env) -> Iterable[int | None]:
        """The variables that the precondition reads (and perhaps None)."""
        if self._literals is not None:
            return [number(env) for number in self._literals]
        return variables(self._precondition(env))


def _literals(
    lowering: Lowering, formula: mf.Formula, frame: Frame
) -> list[Callable[[Env], int | None]] | None:
    """The variables that a conjunction of literals reads; None for other conditions, of which
    constants may leave a part only."""
    found = []
    for part in conjuncts(normal_form(formula)):
        match part:
            case mf.Equal() | mf.Not(mf.Equal()):
                continue
            case mf.Atom(predicate, args) | mf.Not(mf.Atom(predicate, args)):
                if predicate in lowering.atoms.reach.usage.derived:
                    return None
                found.append(lowering.number(predicate, args, frame))
            case _:
                return None
    return found


class Relevance:
    """The closure: ``read`` are the variables that matter, as numbers of ``atoms``."""

    def __init__(self, atoms: Atoms, goal: Condition, rows: list[list[Row]], limits: Limits) -> None:
        self._atoms = atoms
        model = atoms.model
        lowering = Lowering(atoms, limits)
        self._schemas = [
            _Rows(lowering, schema, each) for schema, each in zip(model.schemas.values(), rows, strict=True)
        ]
        self.read: set[int | None] = {None, *variables(goal)}
        if model.metric == "reward":
            for schema, each in zip(model.schemas.values(), self._schemas, strict=True):
                if any(isinstance(leaf, me.Add) and leaf.to == "reward" for leaf in me.leaves(schema.effect)):
                    for index in range(len(each.rows)):
                        self._keep(each, index)
        self._close()

    def rows(self) -> list[list[Row]]:
        """The rows that matter, in their order. The others are given up."""
        handed = []
        for each in self._schemas:
            handed.append(each.rows if all(each.kept) else list(compress(each.rows, each.kept)))
            if handed[-1] is not each.rows:
                each.rows.clear()
        return handed

    def keep(self) -> set[tuple[str, Row]]:
        """The variables that matter."""
        return {self._atoms.keys[number] for number in self.read if number is not None}

    def _close(self) -> None:
        """Sweep over the rows until nothing changes; where that takes long, follow an index instead."""
        for _ in range(_SWEEPS):
            before = len(self.read)
            for each in self._schemas:
                self._sweep(each)
            if len(self.read) == before:
                return
        self._follow()

    def _sweep(self, each: _Rows) -> None:
        plain = each.effect.plain
        if plain is None:
            for index in range(len(each.rows)):
                if each.guarded or not each.kept[index]:
                    self._look(each, index)
            return
        # The same as _look for the many actions of plain tasks, with nothing in the way.
        read, kept, env_of = self.read, each.kept, each.frame.env
        for index, row in enumerate(each.rows):
            if not kept[index]:
                env = env_of(row)
                for number_of in plain:
                    number = number_of(env)
                    if number is not None and number in read:
                        kept[index] = 1
                        read.update(each.reads(env))
                        break

    def _look(self, each: _Rows, index: int) -> None:
        """Keep a row if it sets a variable that matters; then what it reads matters, too."""
        for number, guard in each.effect.settings(each.frame.env(each.rows[index]), []):
            if number in self.read:
                self._keep(each, index)
                self.read.update(number for part in guard for number in variables(part))

    def _keep(self, each: _Rows, index: int) -> None:
        if not each.kept[index]:
            each.kept[index] = 1
            self.read.update(each.reads(each.frame.env(each.rows[index])))

    def _follow(self) -> None:
        """Look again at the rows that set a variable, whenever one turns out to matter."""
        setters: dict[int | None, list[tuple[_Rows, int]]] = {}
        for each in self._schemas:
            for index in range(len(each.rows)):
                if each.guarded or not each.kept[index]:
                    env = each.frame.env(each.rows[index])
                    for number in {number for number, _ in each.effect.settings(env, [])}:
                        setters.setdefault(number, []).append((each, index))
        done: set[int | None] = {None}
        while self.read != done:
            for fresh in self.read - done:
                done.add(fresh)
                for each, index in setters.get(fresh, ()):
                    self._look(each, index)
