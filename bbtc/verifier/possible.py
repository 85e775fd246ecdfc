"""Which worlds a robot may come to hold possible, and how what it is told leads from some to others: a table
for every action that changes something hidden."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import NamedTuple, NoReturn, TypeAlias

from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Condition, conjuncts, evaluate, variables
from bbtc.ground.task import Change, Task
from bbtc.kleene import Truth
from bbtc.limits import MOST_WORLDS, Limits
from bbtc.verifier.happenings import (
    Outcome,
    Possible,
    Shown,
    is_weighed,
    known_of,
    outcomes_of_change,
    possible_worlds,
    prior_worlds,
)

MOST_ROWS = 20_000
"""Lines that the tables of a component may have together."""

_ZERO = Fraction(0)
_Values: TypeAlias = tuple[int, ...]
Test: TypeAlias = tuple[str, int]
"""What a line asks: ``before`` or ``after`` the change, and a place in :attr:`Change.seen`; or ``told``, and
the number of an observation."""


class Row(NamedTuple):
    """Where the robot held the worlds of number ``possible`` to be possible, and what is asked has these
    ``values``: what is possible then."""

    possible: int
    values: tuple[int | None, ...]
    then: int


@dataclass(frozen=True, slots=True)
class Table:
    """What a change makes of what is held possible. Lines ask ``tests``; their values are those of variables,
    and of observations 0 for no, 2 for yes, None where it was not made."""

    change: Change
    tests: tuple[Test, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables of a component: of what is told at ``first``, and of actions. ``possible`` has by number
    what is held possible; what is so before anything is told comes first."""

    possible: tuple[Possible, ...]
    first: Table | None
    of_action: Mapping[str, Table]


def tables_of(task: Task, component: int, limits: Limits) -> Tables:
    """The tables of a component, for all that may come to be held possible whatever is done. Raises
    :class:`BbtcError` (BBT0430) where that is too much, and ``LimitReached``."""
    return _Explorer(task, component, limits).tables()


class _Explorer:
    def __init__(self, task: Task, component: int, limits: Limits) -> None:
        self._task, self._limits = task, limits
        self._component = task.components[component]
        self._weighed = is_weighed(self._component)
        self._changes = [
            (action, change)
            for action in task.actions
            for change in action.changes
            if change.component == component
        ]
        self._first = Change(component, self._component.seen, (), self._component.first)
        self._numbers: dict[Possible, int] = {}
        self._kernels: dict[tuple[Change, int, _Values], list[Outcome]] = {}
        self._spent = 0

    def tables(self) -> Tables:
        """See :func:`tables_of`."""
        if self._component.diagram is not None:
            self._refuse(f"more than {MOST_WORLDS:,} worlds")
        waiting = [prior_worlds(self._component.prior, self._weighed)]
        self._numbers[waiting[0]] = 0
        first: dict[tuple[int, _Values], dict[Shown, int]] = {}
        if self._component.first:
            for state in self._task.initial:
                seen = tuple(int(state.values[variable]) for variable in self._first.seen)
                first[0, seen] = self._after(self._first, waiting[0], seen, waiting)
        every: list[dict[tuple[int, _Values], dict[Shown, int]]] = [{} for _ in self._changes]
        for possible in waiting:  # grows while it is read
            number, known = self._numbers[possible], dict(known_of(self._component, possible))
            for (action, change), found in zip(self._changes, every, strict=True):
                for seen in self._cases(change, action.precondition, known):
                    found[number, seen] = self._after(change, possible, seen, waiting)
        of_action = {
            action.name: _table(change, found)
            for (action, change), found in zip(self._changes, every, strict=True)
        }
        at_first = _table(self._first, first) if self._component.first else None
        return Tables(tuple(self._numbers), at_first, of_action)

    def _cases(self, change: Change, asked: Condition, known: Mapping[int, int]) -> Iterator[_Values]:
        """The values that the seen variables of a change may have where the action starts, as far as is
        plain."""
        own = {*change.seen, *known}
        parts = [
            part
            for part in conjuncts(asked)
            if own.issuperset(variables(part)) and any(True for _ in variables(part))
        ]
        values = [0] * len(self._task.variables)
        for variable, value in known.items():
            values[variable] = value
        choices = [
            (known[variable],)
            if variable in known
            else tuple(map(int, self._task.variables[variable].values))
            for variable in change.seen
        ]
        for seen in product(*choices):
            self._spend()
            for variable, value in zip(change.seen, seen, strict=True):
                values[variable] = value
            if all(evaluate(part, values) is Truth.TRUE for part in parts):
                yield seen

    def _after(
        self, change: Change, possible: Possible, seen: _Values, waiting: list[Possible]
    ) -> dict[Shown, int]:
        """By what is shown and told, the number of what is possible then; new ones are added to those that
        wait."""
        left: dict[Shown, dict[int, Fraction]] = {}
        for world, weight in possible:
            key = change, world, seen
            if key not in self._kernels:
                self._kernels[key] = list(outcomes_of_change(self._component, change, world, seen))
            for each in self._kernels[key]:
                mass = left.setdefault(each.told, {})
                mass[each.world] = mass.get(each.world, _ZERO) + weight * each.probability
        found = {}
        for shown, mass in left.items():
            self._spend()
            then = possible_worlds(mass, self._weighed)
            if then not in self._numbers:
                self._numbers[then] = len(self._numbers)
                waiting.append(then)
            found[shown] = self._numbers[then]
        return found

    def _spend(self) -> None:
        self._spent += 1
        if self._spent % 256 == 0:
            self._limits.check_time("writing down what may be known")
        if self._spent > MOST_ROWS:
            self._refuse(f"more than {MOST_ROWS:,} lines")

    def _refuse(self, much: str) -> NoReturn:
        raise BbtcError.single(
            "BBT0430",
            f"what may be known of {self._component.facts[0]}, and what depends on it, takes {much}",
            hint="`bbtc plan --bounds` needs no list of it",
        )


def _table(change: Change, found: Mapping[tuple[int, _Values], Mapping[Shown, int]]) -> Table:
    """The table that asks no more than tells what is possible then."""
    tests: list[Test] = [
        *(("before", at) for at in range(len(change.seen))),
        *(("after", at) for at in range(len(change.seen))),
        *(("told", at) for at in range(len(change.observations))),
    ]
    lines: dict[tuple[int, tuple[int | None, ...]], int] = {}
    for (possible, seen), each in found.items():
        for (after, told), then in each.items():
            said = (None if value is None else 2 * value for value in told)
            lines[possible, (*seen, *after, *said)] = then
    for at in reversed(range(len(tests))):
        fewer = _without(lines, at)
        if fewer is not None:
            lines, tests = fewer, [*tests[:at], *tests[at + 1 :]]
    rows = (Row(possible, values, then) for (possible, values), then in lines.items())
    return Table(change, tuple(tests), tuple(rows))


def _without(
    lines: Mapping[tuple[int, tuple[int | None, ...]], int], at: int
) -> dict[tuple[int, tuple[int | None, ...]], int] | None:
    """The lines without one test, if they tell what is possible then all the same."""
    found: dict[tuple[int, tuple[int | None, ...]], int] = {}
    for (possible, values), then in lines.items():
        if found.setdefault((possible, (*values[:at], *values[at + 1 :])), then) != then:
            return None
    return found
