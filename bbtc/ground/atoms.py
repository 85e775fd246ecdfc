"""The variables of a task, and the ground leaves of conditions over them."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property

from bbtc.ground.condition import FALSE, TRUE, Condition, Is, Known
from bbtc.ground.reach import Reach
from bbtc.ground.task import Variable
from bbtc.ground.universe import Row
from bbtc.kleene import Truth

_VALUES = (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN)

Leaves = dict[Row, Condition]
Pair = tuple[int, Truth]
"""A variable and the value that it is set to."""


class Atoms:
    """Ground atoms: those that can change, or stay unknown, are variables; others are constants.

    Leaves are made once and shared, and so are the pairs that effects set.
    """

    def __init__(self, reach: Reach, keep: Collection[tuple[str, Row]] | None = None) -> None:
        """Only variables in ``keep`` are kept, if given: then no condition may read another."""
        self.reach = reach
        self.model = reach.usage.model
        self.universe = reach.universe
        self._possible = {
            name: self._possible_values(name)
            for name in self.model.predicates
            if name not in reach.usage.derived
        }
        every = self._sorted_variables()
        self.keys = every if keep is None else [key for key in every if key in keep]
        self.numbers: dict[str, dict[Row, int]] = {name: {} for name in self.model.predicates}
        for number, (predicate, row) in enumerate(self.keys):
            self.numbers[predicate][row] = number
        # Without a variable a literal is constant, but that of an atom which is always unknown is
        # neither true nor false: for what a test makes of it, it has a number beyond the variables.
        self._always_unknown = [
            (predicate, row)
            for predicate, row in (every if keep is not None else ())
            if self._possible[predicate][row] == (Truth.UNKNOWN,) and row not in self.numbers[predicate]
        ]
        self._beyond: dict[str, dict[Row, int]] = {}
        for number, (predicate, row) in enumerate(self._always_unknown, len(self.keys)):
            self._beyond.setdefault(predicate, {})[row] = number
        self._tables: dict[tuple[str, Truth | None, bool], Leaves] = {}
        self._is: dict[Truth, list[Is]] = {}

    @cached_property
    def pairs(self) -> dict[Truth, list[Pair]]:
        """For each value and variable, the pair that effects hold."""
        return {value: [(number, value) for number in range(len(self.keys))] for value in _VALUES}

    def key(self, number: int) -> tuple[str, Row]:
        """The atom that has a number in a leaf."""
        size = len(self.keys)
        return self.keys[number] if number < size else self._always_unknown[number - size]

    def _possible_values(self, predicate: str) -> dict[Row, tuple[Truth, ...]]:
        """The values of every atom that may be something else than false."""
        reach = self.reach
        true, unknown = reach.values[Truth.TRUE][predicate], reach.values[Truth.UNKNOWN][predicate]
        if reach.usage.is_static(predicate) and not unknown and true == reach.never_false.get(predicate):
            return dict.fromkeys(true, (Truth.TRUE,))
        return {
            row: tuple(value for value in _VALUES if reach.can_be(value, predicate, row))
            for row in (true | unknown if unknown else true)
        }

    def _sorted_variables(self) -> list[tuple[str, Row]]:
        keys = [
            (predicate, row)
            for predicate in sorted(self._possible, key=lambda name: f"{name}(")
            for row, values in sorted(self._possible[predicate].items())
            if len(values) > 1 or values[0] is Truth.UNKNOWN
        ]
        if not self.universe.sorts_like_names:
            keys.sort(key=lambda key: f"{key[0]}({','.join(self.universe.args(key[1]))})")
        return keys

    def variables(self) -> tuple[Variable, ...]:
        """The variables of the task, sorted by name."""
        spans = {(fact.predicate, fact.args): fact.span for fact in self.model.init.facts}
        made = []
        for predicate, row in self.keys:
            args = self.universe.args(row)
            unknown = Truth.UNKNOWN in self._possible[predicate][row]
            span = spans.get((predicate, args)) or self.model.predicates[predicate].span
            made.append(Variable(predicate, args, unknown, span=span))
        return tuple(made)

    def leaves(self, predicate: str, value: Truth | None, *, strict: bool) -> tuple[Leaves, Condition]:
        """The condition that an atom has the value (None: is known), for every atom that may be
        something else than false, and the condition for all others.

        It is constant where it is always or never so, also of an atom whose variable is not kept.
        Where only truth matters (``strict``), a literal that can never be true is false, even if it
        can be unknown.
        """
        key = (predicate, value, strict)
        if key not in self._tables:
            beyond = self._beyond.get(predicate)
            numbers = self.numbers[predicate] if beyond is None else {**self.numbers[predicate], **beyond}
            if value is not None and value not in self._is:
                count = len(self.keys) + len(self._always_unknown)
                self._is[value] = [Is(number, value) for number in range(count)]
            leaves = (
                (row, self._leaf(numbers.get(row), values, value, strict))
                for row, values in self._possible[predicate].items()
            )
            self._tables[key] = {row: leaf for row, leaf in leaves if leaf is not None}
        return self._tables[key], TRUE if value in {Truth.FALSE, None} else FALSE

    def _leaf(
        self, number: int | None, values: tuple[Truth, ...], value: Truth | None, strict: bool
    ) -> Condition | None:
        """None where the variable matters and is not kept."""
        if value is None:
            if Truth.UNKNOWN not in values:
                return TRUE
            if len(values) == 1:
                return FALSE
            return None if number is None else Known(number)
        if values == (value,):
            return TRUE
        # A literal that can never be true may still be unknown, which matters unless strict.
        if value not in values and (strict or value is Truth.UNKNOWN or Truth.UNKNOWN not in values):
            return FALSE
        return None if number is None else self._is[value][number]
