"""The variables of a task, and the ground leaves of conditions over them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from enum import Enum
from functools import cached_property
from types import MappingProxyType
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import FALSE, TRUE, And, Condition, Constant, Is, Known, Not, Or, Within
from bbtc.ground.reachability.reach import Reach
from bbtc.ground.task import Digit, Variable, ground_name
from bbtc.ground.universe import Row
from bbtc.kleene import Truth

_VALUES = (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN)
_ONLY_FALSE = (Truth.FALSE,)
_NO_NUMBER = -1

Pair = tuple[int, Truth]
"""A variable and the value that it is set to."""
Key: TypeAlias = tuple[str, Row]
"""Predicate and arguments of a ground atom."""


NO_DIGITS: Mapping[str, Digit] = MappingProxyType({})


class Scope(Enum):
    """Where a ground condition must have the value that the text gives it."""

    WORLD = "in every state, whatever others change"
    MODEL = "in the states that the model may reach"
    TRUTH = "there, and only as to whether it is true"


class Leaves(dict[Row, Condition]):
    """The condition that an atom has a value, by the atom's arguments; ``other`` stands for those that are
    not listed."""

    def __init__(self, leaves: Iterable[tuple[Row, Condition]], other: Condition) -> None:
        super().__init__(leaves)
        self.other = other

    def __missing__(self, row: Row) -> Condition:
        return self.other


class OpenLeaves(Leaves):
    """Leaves of a predicate that others may change: an atom gets a variable when it is asked for."""

    def __init__(
        self, leaves: Iterable[tuple[Row, Condition]], other: Condition, make: Callable[[Row], Condition]
    ) -> None:
        super().__init__(leaves, other)
        self._make = make

    def __missing__(self, row: Row) -> Condition:
        leaf = self[row] = self._make(row)
        return leaf


class Atoms:
    """Ground atoms. Those that can change in the model, or stay unknown, are variables (``numbers``); so
    are those that only others can change, once a condition asks for them (``steady``, which no effect sets).
    The rest are constants.

    Leaves are made once and shared, and so are the pairs that effects set.
    """

    def __init__(self, reach: Reach, keep: Collection[Key] | None = None) -> None:
        """Only variables in ``keep`` are kept, if given: then no condition may read another in the end."""
        self.reach = reach
        self.model = reach.usage.model
        self.universe = reach.universe
        self._possible = {
            name: self._possible_values(name)
            for name in self.model.predicates
            if name not in reach.usage.derived
        }
        changing = {name: self._changing(name) for name in self._possible}
        steady: dict[str, set[Row]] = {}
        for name, row in () if keep is None else keep:
            if not self._changes(name, row):
                steady.setdefault(name, set()).add(row)
        if keep is not None:
            changing = {name: [row for row in rows if (name, row) in keep] for name, rows in changing.items()}
        self.keys = self._sorted({name: [*rows, *steady.get(name, ())] for name, rows in changing.items()})
        self.numbers: dict[str, dict[Row, int]] = {name: {} for name in self.model.predicates}
        self.steady: dict[str, dict[Row, int]] = {name: {} for name in self.model.predicates}
        for number, (name, row) in enumerate(self.keys):
            numbers = self.steady if steady and row in steady.get(name, ()) else self.numbers
            numbers[name][row] = number
        self._kept = None if keep is None else len(self.keys)
        self._tables: dict[tuple[str, Truth | None, Scope], Leaves] = {}
        self._is: dict[Truth, list[Is]] = {}
        self._well_typed: dict[str, list[frozenset[int]]] = {}

    @cached_property
    def pairs(self) -> dict[Truth, list[Pair]]:
        """For each value and variable, the pair that effects hold."""
        return {value: [(number, value) for number in range(len(self.keys))] for value in _VALUES}

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

    def _changing(self, predicate: str) -> list[Row]:
        possible = self._possible[predicate].items()
        return [row for row, values in possible if len(values) > 1 or values[0] is Truth.UNKNOWN]

    def _changes(self, predicate: str, row: Row) -> bool:
        values = self._possible[predicate].get(row, _ONLY_FALSE)
        return len(values) > 1 or values[0] is Truth.UNKNOWN

    def _sorted(self, rows: Mapping[str, Iterable[Row]]) -> list[Key]:
        """The keys of some rows of each predicate, sorted by name."""
        names = sorted(rows, key=lambda name: f"{name}(")
        keys = [(name, row) for name in names for row in sorted(rows[name])]
        if not self.universe.sorts_like_names:
            keys.sort(key=self._name)
        return keys

    def _name(self, key: Key) -> str:
        return ground_name(key[0], self.universe.args(key[1]))

    def order(self) -> list[int]:
        """The numbers of the variables to keep, sorted by name; in ``keys``, those that a condition asked for
        stand last."""
        if self._kept is not None:
            return list(range(self._kept))
        rows: dict[str, list[Row]] = {}
        for name, row in self.keys:
            rows.setdefault(name, []).append(row)
        number = {key: index for index, key in enumerate(self.keys)}
        return [number[key] for key in self._sorted(rows)]

    def variables(self, digits: Mapping[str, Digit] = NO_DIGITS) -> tuple[Variable, ...]:
        """The variables of the task, by number; ``digits`` tells which predicates are digits of numbers."""
        spans = {(fact.predicate, fact.args): fact.span for fact in self.model.init.facts}
        made = []
        for name, row in self.keys:
            args = self.universe.args(row)
            span = spans.get((name, args)) or self.model.predicates[name].span
            external = self.model.predicates[name].external
            unknowable = self._unknowable(name, row)
            made.append(
                Variable(name, args, unknowable, digit=digits.get(name), span=span, external=external)
            )
        return tuple(made)

    def _unknowable(self, predicate: str, row: Row) -> bool:
        """Whether the atom may be unknown: in the model, or by others where its predicate may be."""
        if Truth.UNKNOWN in self._possible[predicate].get(row, _ONLY_FALSE):
            return True
        return predicate in self.reach.usage.open and self.model.predicates[predicate].three_valued

    # --- leaves ------------------------------------------------------------------------------

    def leaves(self, predicate: str, value: Truth | None, scope: Scope) -> Leaves:
        """The condition that an atom has the value (None: is known), for every atom that may be
        something else than false, and the condition for all others.

        It is constant where it is always or never so, also of an atom whose variable is not kept.
        Where only truth matters, a literal that can never be true is false, even if it can be unknown; and
        one of a variable that is not kept has no number, since only effects that matter to nothing read it.
        """
        key = (predicate, value, scope)
        if key not in self._tables:
            self._tables[key] = self._table(predicate, value, scope)
        return self._tables[key]

    def _table(self, predicate: str, value: Truth | None, scope: Scope) -> Leaves:
        numbers, other = self.numbers[predicate], TRUE if value in {Truth.FALSE, None} else FALSE
        if value is not None and value not in self._is:
            self._is[value] = [Is(number, value) for number in range(len(self.keys))]
        if scope is Scope.WORLD and predicate in self.reach.usage.open:
            known = ((row, self._open_leaf(predicate, number, value)) for row, number in numbers.items())
            return OpenLeaves(known, other, lambda row: self._asked(predicate, row, value, other))
        possible, strict = self._possible[predicate], scope is Scope.TRUTH
        lost = set[Row]()
        if not strict and self._kept is not None:
            lost = {row for row in possible if row not in numbers and self._changes(predicate, row)}
        every = (
            (row, self._leaf(numbers.get(row), values, value, strict))
            for row, values in possible.items()
            if row not in lost
        )
        if not lost:
            return Leaves(every, other)

        def make(row: Row) -> Condition:
            """What is asked for and not kept does not last, but must not be taken for a constant."""
            return self._leaf(self.number(predicate, row), possible[row], value) if row in lost else other

        return OpenLeaves(every, other, make)

    def _leaf(
        self, number: int | None, values: tuple[Truth, ...], value: Truth | None, strict: bool = False
    ) -> Condition:
        if value is None:
            if Truth.UNKNOWN not in values:
                return TRUE
            if len(values) == 1:
                return FALSE
            return Known(_NO_NUMBER if number is None else number)
        if values == (value,):
            return TRUE
        # A literal that can never be true may still be unknown, which matters unless strict.
        if value not in values and (strict or value is Truth.UNKNOWN or Truth.UNKNOWN not in values):
            return FALSE
        return Is(_NO_NUMBER, value) if number is None else self._is[value][number]

    def _open_leaf(self, predicate: str, number: int, value: Truth | None) -> Condition:
        if value is Truth.TRUE or value is Truth.FALSE:
            return self._is[value][number]
        if not self._unknowable(predicate, self.keys[number][1]):
            return TRUE if value is None else FALSE
        return Known(number) if value is None else self._is[value][number]

    def _asked(self, predicate: str, row: Row, value: Truth | None, other: Condition) -> Condition:
        """The leaf of an atom that the model never changes."""
        if value in {Truth.UNKNOWN, None} and not self._unknowable(predicate, row):
            return other
        number = self.number(predicate, row)
        return other if number is None else self._open_leaf(predicate, number, value)

    def number(self, predicate: str, row: Row) -> int | None:
        """The variable that a condition reads for an atom; None for a constant. An atom that only others can
        change gets one here, but for arguments of other types than the predicate's."""
        found = self.numbers[predicate].get(row)
        if found is not None:
            return found
        steady = self.steady[predicate]
        if row not in steady and (self._changes(predicate, row) or self._may_change(predicate, row)):
            steady[row] = len(self.keys)
            self.keys.append((predicate, row))
            for value, leaves in self._is.items():
                leaves.append(Is(steady[row], value))
        return steady.get(row)

    def _may_change(self, predicate: str, row: Row) -> bool:
        """Whether others may change an atom."""
        if predicate not in self.reach.usage.open:
            return False
        if row in self._possible[predicate]:
            return True
        if predicate not in self._well_typed:
            parameters = self.model.predicates[predicate].parameters
            self._well_typed[predicate] = [frozenset(self.universe.members(p.types)) for p in parameters]
        return all(number in fits for number, fits in zip(row, self._well_typed[predicate], strict=True))

    def can_be_true(self, condition: Condition) -> bool:
        """Whether a condition in negation normal form may be true in the model, as far as its leaves tell."""
        match condition:
            case Is(number, value):
                name, row = self.keys[number]
                return value in self._possible[name].get(row, _ONLY_FALSE)
            case Known(number):
                name, row = self.keys[number]
                return self._possible[name].get(row, _ONLY_FALSE) != (Truth.UNKNOWN,)
            case Within():
                return True  # what numbers can be is not traced
            case And(parts):
                return all(map(self.can_be_true, parts))
            case Or(parts):
                return any(map(self.can_be_true, parts))
            case Constant(value):
                return value
            case Not():
                raise AssertionError("not in normal form")
            case _:
                assert_never(condition)
