"""Which actions and variables can matter to the goal, found before any action is made.

This is the backward relevance of :mod:`bbtc.ground.pruning.prune` on argument rows, for tasks without
templates: a task with a million actions is then made once, with what matters only. It shares no code with
that, which needs a node for each action: here there are arrays of rows, looked at thousands at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain, compress
from operator import not_

from bbtc.diagnostics import Report
from bbtc.ground.condition import Condition, variables
from bbtc.ground.effects import EffectLowering
from bbtc.ground.lower import Frame, Lowering, projection
from bbtc.ground.normal import conjuncts, normal_form, reads
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.reachability.bulk import chunks, picker
from bbtc.ground.universe import Row
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model import effect as me
from bbtc.model import formula as mf

SWEEPS = 6
"""So often the rows are gone through, at most, for what they refer to."""
Numbers = Callable[[list[Row]], Iterable[int | None]]


class _Rows:
    """The rows of one schema; ``left`` are those that may still turn out to matter."""

    def __init__(self, lowering: Lowering, schema: md.Schema, rows: list[Row]) -> None:
        self.rows = self.left = rows
        self.happens = schema.exogenous is not None
        block = lowering.atoms.reach.usage.blocks[schema.name]
        used, frame = projection(lowering.universe, schema.parameters, reads(block))
        self.key = picker(used)
        # What is reported here is reported again when the actions are made.
        self._effect = EffectLowering(lowering, Report()).effect(block, frame, None)
        self._env = frame.env
        self._keys: dict[Row, None] = {}
        self.guarded = next(me.conditions(schema.effects), None) is not None
        leaves = list(me.leaves(schema.effects))
        self._charges = (self.guarded and any(isinstance(leaf, me.Add) for leaf in leaves)) or any(
            isinstance(leaf, me.Change) or (isinstance(leaf, me.Add) and reads_number(lowering, leaf))
            for leaf in leaves
        )
        self._conditions = lowering.reached(schema.precondition, schema.parameters)
        self._literals = _literals(lowering, schema.precondition, Frame(lowering.universe, schema.parameters))

    def test(self, read: set[int]) -> Callable[[list[Row]], list[bool]]:
        """The function that says of each row whether it sets a variable that matters. The guards of
        such settings matter, too, and are added."""
        plain = self._effect.plain
        if plain is None:
            self._keys = self._keys or dict.fromkeys(self.key(self.rows))
            known = {key: self.sets(key, read) for key in self._keys}
            return lambda rows: list(map(known.__getitem__, self.key(rows)))

        def test(rows: list[Row]) -> list[bool]:
            keys = list(self.key(rows))
            found = [map(read.__contains__, numbers(keys)) for numbers in plain]
            return list(map(any, zip(*found, strict=True))) if found else [False] * len(rows)

        return test

    def sets(self, key: Row, read: set[int]) -> bool:
        """:meth:`test` of what the effect reads of a row."""
        matters = False
        for number, guard in self._effect.settings(self._env(key), []):
            if number in read:
                matters = True
                read.update(number for part in guard for number in variables(part))
        return matters

    def numbers(self, key: Row) -> dict[int, None]:
        """The variables that an action may set, by what its effect reads of its row."""
        return {number: None for number, _ in self._effect.settings(self._env(key), [])}

    def reads(self, rows: list[Row]) -> Iterator[int | None]:
        """The variables that preconditions and the conditions of costs and rewards read (and perhaps
        None)."""
        charged = self._charged(rows) if self._charges else ()
        if self._literals is not None:
            return chain(charged, chain.from_iterable(numbers(rows) for numbers in self._literals))
        distinct = {id(condition): condition for condition in self._conditions.all(rows)}
        return chain(charged, chain.from_iterable(map(variables, distinct.values())))

    def _charged(self, rows: list[Row]) -> Iterator[int]:
        for key in dict.fromkeys(self.key(rows)):
            for guard in self._effect.charged(self._env(key), []):
                for part in guard:
                    yield from variables(part)


def reads_number(lowering: Lowering, leaf: me.Add) -> bool:
    """Does what is added to costs or rewards depend on numbers of the state?"""
    return lowering.amounts.depends(leaf.amount)


def _literals(lowering: Lowering, formula: mf.Formula, frame: Frame) -> list[Numbers] | None:
    """The variables that a conjunction of literals reads; None for other conditions, of which
    constants may leave a part only."""
    found: list[Numbers] = []
    for part in conjuncts(normal_form(formula)):
        match part:
            case mf.Equal() | mf.Not(mf.Equal()):
                continue
            case mf.Atom(predicate, args) | mf.Not(mf.Atom(predicate, args)):
                if predicate in lowering.atoms.reach.usage.derived:
                    return None
                found.append(lowering.read(predicate, args, frame))
            case _:
                return None
    return found


class Relevance:
    """The closure: ``read`` are the variables that matter, as numbers of ``atoms``."""

    def __init__(self, atoms: Atoms, goal: Condition, rows: list[list[Row]], limits: Limits) -> None:
        self._atoms = atoms
        self._limits = limits
        model = atoms.model
        lowering = Lowering(atoms, limits)
        self._schemas = [
            _Rows(lowering, schema, each) for schema, each in zip(model.schemas.values(), rows, strict=True)
        ]
        self.read = set(variables(goal))
        for schema, each in zip(model.schemas.values(), self._schemas, strict=True):
            if schema.counts or (model.metric == "reward" and me.earns(schema.effects)):
                self._keep(each, each.rows)
                each.left = []
        self._close()
        if any(each.happens and len(each.left) < len(each.rows) for each in self._schemas):
            # An action that does nothing else may be there to wait for it.
            for rows_ in (each for each in self._schemas if not each.happens):
                self._keep(rows_, rows_.left)
                rows_.left = []
            self._close()

    def rows(self) -> list[list[Row]]:
        """The rows that matter, in their order. The others are given up."""
        handed = []
        for each in self._schemas:
            if each.left:
                test = each.test(self.read)
                kept = [row for rows in chunks(each.rows) for row in compress(rows, test(rows))]
                each.rows.clear()
                handed.append(kept)
            else:
                handed.append(each.rows)
        return handed

    def keep(self) -> set[tuple[str, Row]]:
        """The variables that matter."""
        return {self._atoms.keys[number] for number in self.read}

    def _keep(self, each: _Rows, rows: list[Row]) -> None:
        self.read.update(number for number in each.reads(rows) if number is not None)

    def _close(self) -> None:
        """Sweep over the rows until nothing changes; where that takes long, follow an index instead."""
        for _ in range(SWEEPS):
            before = len(self.read)
            for each in self._schemas:
                self._sweep(each)
            if len(self.read) == before:
                return
        self._follow()

    def _sweep(self, each: _Rows) -> None:
        """Keep the rows that set a variable that matters; then what they read matters, too."""
        left: list[Row] = []
        test = each.test(self.read)
        for rows in chunks(each.left):
            self._limits.check_time("grounding")
            matters = test(rows)
            self._keep(each, list(compress(rows, matters)))
            left += compress(rows, map(not_, matters))
        each.left = left

    def _follow(self) -> None:
        """Look again at the rows that set a variable, whenever one turns out to matter."""
        setters: dict[int, list[tuple[dict[Row, list[Row]], _Rows, Row]]] = {}
        for each in self._schemas:
            groups: dict[Row, list[Row]] = {}
            for key, row in zip(each.key(each.left), each.left, strict=True):
                groups.setdefault(key, []).append(row)
            for key in dict.fromkeys(each.key(each.rows)) if each.guarded else groups:
                for number in each.numbers(key):
                    setters.setdefault(number, []).append((groups, each, key))
        done: set[int] = set()
        while self.read != done:
            for fresh in self.read - done:
                done.add(fresh)
                for groups, each, key in setters.get(fresh, ()):
                    each.sets(key, self.read)
                    self._keep(each, groups.pop(key, []))
