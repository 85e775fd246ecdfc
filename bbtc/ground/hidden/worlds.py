"""The worlds of a component: everything that the start allows, found by propagation and backtracking."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from bbtc.ground.condition import (
    FALSE,
    TRUE,
    Condition,
    Is,
    Known,
    Or,
    compile_condition,
    evaluate,
    negation,
    replaced,
    variables,
)
from bbtc.ground.hidden.physical import Draw
from bbtc.kleene import Truth
from bbtc.limits import Limits

_MOST_STEPS = 100
"""So many steps are taken to find a world."""

Branches: TypeAlias = tuple[tuple[Fraction, frozenset[int]], ...]


class TooManyWorlds(Exception):
    """A component has more worlds than are listed, or they are too hard to find."""


class Worlds:
    """Finds the worlds of some facts: those of ``draws`` and those that are drawn one by one; ``given`` are
    certain. ``clauses`` read no other variables."""

    def __init__(
        self,
        facts: Sequence[int],
        given: Mapping[int, bool],
        draws: Sequence[Draw],
        clauses: Sequence[Condition],
        limits: Limits,
    ) -> None:
        self._place = {fact: place for place, fact in enumerate(facts)}
        self._given = given
        self._limits = limits
        self._draws = [self._local(draw) for draw in draws]
        places = [replaced(clause, self._leaf) for clause in clauses if not _always(clause)]
        self._clauses = [(compile_condition(each), sorted(set(variables(each)))) for each in places]
        self._of_fact: list[tuple[list[int], list[int]]] = [([], []) for _ in facts]
        for number, (atoms, _) in enumerate(self._draws):
            for place in atoms:
                self._of_fact[place][0].append(number)
        for number, (_, read) in enumerate(self._clauses):
            for place in read:
                self._of_fact[place][1].append(number)

    def _local(self, draw: Draw) -> tuple[tuple[int, ...], Branches]:
        merged: dict[frozenset[int], Fraction] = {}
        for weight, true in draw.branches:
            if weight:
                local = frozenset(self._place[variable] for variable in true)
                merged[local] = merged.get(local, Fraction(0)) + weight
        atoms = tuple(self._place[variable] for variable in draw.variables)
        return atoms, tuple((weight, true) for true, weight in merged.items())

    def _leaf(self, leaf: Is | Known) -> Condition:
        assert isinstance(leaf, Is)  # tests are refused
        return Is(self._place[leaf.variable], leaf.value)

    def all(self) -> dict[int, Fraction]:
        """Every world, as a bit mask, with its probability; none where all contradict. Raises
        :class:`TooManyWorlds`."""
        found: dict[int, Fraction] = {}
        for world, weight in self._listed():
            found[world] = found.get(world, Fraction(0)) + weight
            if len(found) > self._limits.worlds:
                raise TooManyWorlds
        whole = sum(found.values(), Fraction(0))
        return {world: weight / whole for world, weight in sorted(found.items())}

    def contradict(self) -> bool:
        """Is there no world at all? Raises :class:`TooManyWorlds` where that is hard to tell."""
        return next(self._listed(), None) is None

    def _listed(self) -> Iterator[tuple[int, Fraction]]:
        alone = [place for place, (draws, clauses) in enumerate(self._of_fact) if not draws and not clauses]
        if 2 ** (len(alone) - len(self._given)) > self._limits.worlds:
            raise TooManyWorlds
        values = bytearray([Truth.UNKNOWN]) * len(self._place)
        active = [branches for _, branches in self._draws]
        certain = [(self._place[fact], value) for fact, value in self._given.items()]
        for number, branches in enumerate(active):
            certain += self._agreed(number, branches)
        stack = [(values, active)] if all(active) and self._assign(values, active, certain) else []
        for number in range(len(self._clauses)):
            forced = self._forced(values, number) if stack else None
            if forced is None or not self._assign(values, active, forced):
                stack = []
        steps = 0
        while stack:
            values, active = stack.pop()
            steps += 1
            if steps > _MOST_STEPS * self._limits.worlds:
                raise TooManyWorlds
            if steps % 256 == 0:
                self._limits.check_time("listing worlds")
            choices = self._choices(values, active)
            if not choices:
                weight = Fraction(1)
                for ((part, _),) in active:
                    weight *= part
                yield sum(1 << place for place, value in enumerate(values) if value == Truth.TRUE), weight
            for choice in choices:
                after, left = bytearray(values), list(active)
                if self._assign(after, left, choice):
                    stack.append((after, left))

    def _choices(self, values: bytearray, active: list[Branches]) -> list[list[tuple[int, bool]]]:
        """What may be the case of something that is open; nothing where all is settled."""
        open_ = [(len(branches), number) for number, branches in enumerate(active) if len(branches) > 1]
        if open_:
            _, number = min(open_)
            atoms, _ = self._draws[number]
            return [[(place, place in true) for place in atoms] for _, true in active[number]]
        for check, read in self._clauses:
            if check(values) == Truth.UNKNOWN:
                place = next(place for place in read if values[place] == Truth.UNKNOWN)
                return [[(place, True)], [(place, False)]]
        place = values.find(Truth.UNKNOWN)
        return [] if place < 0 else [[(place, True)], [(place, False)]]

    def _assign(self, values: bytearray, active: list[Branches], wanted: Iterable[tuple[int, bool]]) -> bool:
        """Settle some facts and what follows from them; tells whether nothing contradicts."""
        waiting = list(wanted)
        while waiting:
            place, value = waiting.pop()
            if values[place] != Truth.UNKNOWN:
                if (values[place] == Truth.TRUE) is not value:
                    return False
                continue
            values[place] = Truth.TRUE if value else Truth.FALSE
            draws, clauses = self._of_fact[place]
            for number in draws:
                before = active[number]
                left = tuple(branch for branch in before if (place in branch[1]) is value)
                if not left:
                    return False
                if len(left) < len(before):
                    active[number] = left
                    waiting += self._agreed(number, left)
            for number in clauses:
                forced = self._forced(values, number)
                if forced is None:
                    return False
                waiting += forced
        return True

    def _agreed(self, number: int, branches: Branches) -> list[tuple[int, bool]]:
        """What all branches of a draw that are left say."""
        if not branches:
            return []
        atoms, _ = self._draws[number]
        if len(branches) == 1:
            return [(place, place in branches[0][1]) for place in atoms]
        some = frozenset().union(*(true for _, true in branches))
        every = branches[0][1].intersection(*(true for _, true in branches[1:]))
        return [(place, False) for place in atoms if place not in some] + [(place, True) for place in every]

    def _forced(self, values: bytearray, number: int) -> list[tuple[int, bool]] | None:
        """What a clause leaves no choice about; None where it is false."""
        check, read = self._clauses[number]
        value = check(values)
        if value != Truth.UNKNOWN:
            return [] if value == Truth.TRUE else None
        open_ = [place for place in read if values[place] == Truth.UNKNOWN]
        if len(open_) > 1:
            return []
        (place,) = open_
        possible = []
        for truth in (Truth.TRUE, Truth.FALSE):
            values[place] = truth
            if check(values) == Truth.TRUE:
                possible.append((place, truth is Truth.TRUE))
        values[place] = Truth.UNKNOWN
        return possible if len(possible) == 1 else None if not possible else []


def _always(clause: Condition) -> bool:
    """Does a clause hold whatever is the case, as `(or (p) (not (p)))` does?"""
    return isinstance(clause, Or) and any(negation(part) in clause.parts for part in clause.parts)


def given_true(condition: Condition, start: Sequence[Truth], hidden: frozenset[int]) -> Condition:
    """A condition of the start over hidden facts alone."""

    def leaf(read: Is | Known) -> Condition:
        if read.variable in hidden:
            return read
        return TRUE if evaluate(read, start) is Truth.TRUE else FALSE

    return replaced(condition, leaf)
