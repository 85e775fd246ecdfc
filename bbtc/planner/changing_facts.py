"""What may change by itself in the world of a task, and what else has to change with it.

A change moves one fact, or one group of facts of which at most one is true (a robot's place), to another
value. Groups are those of :mod:`bbtc.planner.mutexes`. A fact moves in one group at most, the largest
first, as in Helmert, "Concise finite-domain representations for PDDL planning tasks" (2009), section 6; the
other groups still bound what is possible: what a move contradicts gives way, with as few facts as can be, so
that a can that falls from the gripper leaves it empty.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.belief.draws import Values
from bbtc.ground.task import Task, apparent_factors, effects_of
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mutexes import Group, exclusive_groups

_MOST_GIVING_WAY = 6  # facts that change besides those that move
_MOST_TRIED = 2000  # sets of such facts

_Sets = Mapping[int, Truth]


@dataclass(frozen=True, slots=True)
class Movable:
    """What moves as one: a single variable with its values, or two or more variables of a group, of which one
    is true, or none where ``emptied``."""

    variables: tuple[int, ...]
    values: tuple[Truth, ...] = ()
    emptied: bool = False

    def moves(self, state: Values) -> Iterator[_Sets]:
        """What it may move to from a state, each as what it sets."""
        if len(self.variables) == 1:
            (variable,) = self.variables
            for value in self.values:
                if value != state[variable]:
                    yield {variable: value}
            return
        left = {v: Truth.FALSE for v in self.variables if state[v] == Truth.TRUE}
        for variable in self.variables:
            if variable not in left:
                yield left | {variable: Truth.TRUE}
        if self.emptied and left:
            yield dict.fromkeys(self.variables, Truth.FALSE)


@dataclass(frozen=True, slots=True)
class ChangingFacts:
    """Everything that may change by itself in a task. Every variable of a task may: what is fixed is none."""

    movables: tuple[Movable, ...]
    groups: tuple[Group, ...]
    _around: Mapping[int, tuple[int, ...]]
    """The numbers of the groups that each variable is in."""
    _fixed: frozenset[int] = frozenset()
    """Variables that stay as they are."""

    @classmethod
    def of(cls, task: Task, limits: Limits) -> ChangingFacts:
        """Raises :class:`bbtc.diagnostics.LimitReached` when the time is over. Numbers change by actions
        alone."""
        digits = {variable for number in task.numbers for variable in number.digits}
        groups = [each for each in exclusive_groups(task, limits) if digits.isdisjoint(each.members)]
        taken: set[int] = set()
        movables: list[Movable] = []
        for group in sorted(groups, key=lambda each: (not each.always, -len(each.members), each.members)):
            own = tuple(v for v in group.members if v not in taken)
            if len(own) > 1:
                taken.update(own)
                # What is left of a group may be empty, since the one that is true may stand in another.
                movables.append(Movable(own, emptied=not group.always or len(own) < len(group.members)))
        values = _values(task)
        movables.extend(
            Movable((variable,), values[variable])
            for variable in range(len(values))
            if variable not in taken and variable not in digits
        )
        movables.sort(key=lambda each: each.variables)
        around: dict[int, tuple[int, ...]] = {}
        for number, group in enumerate(groups):
            for member in group.members:
                around[member] = (*around.get(member, ()), number)
        return cls(tuple(movables), tuple(groups), around)

    def but(self, fixed: Iterable[int]) -> ChangingFacts:
        """The same, but that some variables never change: what would take them along does not happen."""
        found = frozenset(fixed)
        left = tuple(each for each in self.movables if not found.issuperset(each.variables))
        return replace(self, movables=left, _fixed=found)

    def changes(self, state: Values) -> tuple[tuple[Fraction, Values], ...]:
        """Where one change may lead from a state, and how probably: whatever may move is as likely to do so,
        then each of the values that it may take, then each way for other facts to give way. Empty where
        nothing can move."""
        ways = self._ways(state)
        merged: dict[Values, Fraction] = {}
        for moves in ways:
            for after in moves:
                for values in after:
                    chance = Fraction(1, len(ways) * len(moves) * len(after))
                    merged[values] = merged.get(values, Fraction(0)) + chance
        return tuple((chance, values) for values, chance in sorted(merged.items()))

    def changed(self, state: Values) -> list[Values]:
        """The states of :meth:`changes`, in the same order."""
        return sorted({values for moves in self._ways(state) for after in moves for values in after})

    def _ways(self, state: Values) -> list[list[list[Values]]]:
        """For each fact or group that may move, the states after each of its moves."""
        holding = [[v for v in group.members if state[v] == Truth.TRUE] for group in self.groups]
        ways: list[list[list[Values]]] = []
        for movable in self.movables:
            found = [self._settled(state, sets, holding) for sets in movable.moves(state)]
            if self._fixed:
                found = [[after for after in each if self._keeps(state, after)] for each in found]
            ways.append([each for each in found if each])
        return [each for each in ways if each]

    def _keeps(self, state: Values, after: Values) -> bool:
        return all(after[variable] == state[variable] for variable in self._fixed)

    def _settled(self, state: Values, sets: _Sets, holding: Sequence[Sequence[int]]) -> list[Values]:
        """The states after a move with the fewest other facts changed, so that no group is contradicted; none
        if that takes too many."""
        if self._around.keys().isdisjoint(sets):
            return [_with(state, sets)]
        waiting: dict[tuple[tuple[int, Truth], ...], None] = {tuple(sorted(sets.items())): None}
        tried = 0
        for _ in range(_MOST_GIVING_WAY + 1):
            found: list[Values] = []
            further: dict[tuple[tuple[int, Truth], ...], None] = {}
            for fixed in waiting:
                tried += 1
                if tried > _MOST_TRIED:
                    return []
                now = dict(fixed)
                more = self._lacking(now, holding)
                if more is None:
                    found.append(_with(state, now))
                    continue
                for variable, value in more:
                    further[tuple(sorted((now | {variable: value}).items()))] = None
            if found:
                return found
            waiting = further
        return []

    def _lacking(
        self, fixed: dict[int, Truth], holding: Sequence[Sequence[int]]
    ) -> list[tuple[int, Truth]] | None:
        """What could change next to mend the first group that is contradicted; None if none is. ``holding``
        are the members of each group that are true before."""
        for number in sorted({number for variable in fixed for number in self._around.get(variable, ())}):
            group = self.groups[number]
            still = [v for v in holding[number] if v not in fixed]
            true = sum(
                value == Truth.TRUE and number in self._around.get(v, ()) for v, value in fixed.items()
            )
            if true + len(still) > 1:
                return [(v, Truth.FALSE) for v in still[:1]]
            if group.always and not true and not still:
                return [(v, Truth.TRUE) for v in group.members if v not in fixed]
        return None


def _with(state: Values, sets: _Sets) -> Values:
    after = bytearray(state)
    for variable, value in sets.items():
        after[variable] = value
    return bytes(after)


def _values(task: Task) -> list[tuple[Truth, ...]]:
    """The values that each variable can take: at the start and by effects. A variable that nothing in the
    task changes is one that others do, and can take all."""
    found: list[set[Truth]] = [set() for _ in task.variables]
    for initial in task.initial:
        for own, value in zip(found, initial.values, strict=True):
            own.add(value)
    for each in task.occurrences:
        for effect in effects_of(apparent_factors(task, each)):
            for variable, value in effect.sets:
                found[variable].add(value)
    return [
        tuple(value for value in variable.values if value in own) if len(own) > 1 else variable.values
        for variable, own in zip(task.variables, found, strict=True)
    ]
