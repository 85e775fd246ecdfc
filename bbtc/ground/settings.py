"""Settings that happen whenever their outcome does: what they come to, for many argument rows at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, pairwise, repeat
from operator import eq, lt
from typing import TypeAlias, cast

from bbtc.ground.lower import Env, Frame, Lowering
from bbtc.ground.reachability.atoms import Pair
from bbtc.ground.reachability.bulk import instances
from bbtc.ground.task import ONE, ZERO, Effect, Factor, Outcome
from bbtc.ground.universe import Row
from bbtc.kleene import Truth
from bbtc.model import effect as me

Pairs: TypeAlias = tuple[Pair, ...]
_FEW_BRANCHES = 8  # that are compared each with each, which is faster than to hash them

Numbers = Callable[[list[Row]], "list[int | None]"]


@dataclass(frozen=True, slots=True)
class _Plain:
    """An unconditional setting: the variable in an environment and in many rows, and its value."""

    predicate: str
    number: Callable[[Env], int | None]
    numbers: Numbers
    value: Truth


class Settings:
    """Unconditional settings that happen together. Those of predicates without variables do nothing."""

    def __init__(self, lowering: Lowering, leaves: Iterable[me.Set], frame: Frame) -> None:
        plain = [
            _Plain(
                leaf.predicate,
                lowering.number(leaf.predicate, leaf.args, frame),
                lowering.numbers(leaf.predicate, leaf.args, frame),
                leaf.value,
            )
            for leaf in leaves
            if lowering.atoms.numbers[leaf.predicate]
        ]
        self._pairs = lowering.atoms.pairs
        # Variables are numbered predicate by predicate: in this order most are sorted already.
        self._plain = sorted(plain, key=lambda plain: f"{plain.predicate}(")

    def columns(self) -> list[Numbers]:
        """The variables set, each as a function of many rows (None: one that never changes)."""
        return [plain.numbers for plain in self._plain]

    def numbers(self, env: Env) -> Iterator[int]:
        """The variables set in an environment, repeats included."""
        for plain in self._plain:
            number = plain.number(env)
            if number is not None:
                yield number

    def values(self, env: Env) -> dict[int, Truth]:
        """The value that each variable is set to in an environment."""
        return self._merged([plain.number(env) for plain in self._plain])

    def all(self, rows: list[Row]) -> list[Pairs]:
        """The variables set, in order, with their values, in each of many rows."""
        if not self._plain:
            return [()] * len(rows)
        columns = [plain.numbers(rows) for plain in self._plain]
        if any(None in column for column in columns):
            return list(map(self._sorted, zip(*columns, strict=True)))
        # No variable is None from here on.
        known = cast("list[list[int]]", columns)
        pairs = zip(
            *(
                map(self._pairs[plain.value].__getitem__, numbers)
                for plain, numbers in zip(self._plain, known, strict=True)
            ),
            strict=True,
        )
        if all(all(map(lt, one, other)) for one, other in pairwise(known)):
            return list(pairs)
        made = list(map(tuple, map(sorted, pairs)))
        for index, numbers in enumerate(zip(*columns, strict=True)):
            if len({*numbers}) < len(numbers):
                made[index] = self._sorted(numbers)
        return made

    def _sorted(self, numbers: Sequence[int | None]) -> Pairs:
        sets = self._merged(numbers)
        return tuple([self._pairs[sets[number]][number] for number in sorted(sets)])

    def _merged(self, numbers: Iterable[int | None]) -> dict[int, Truth]:
        sets: dict[int, Truth] = {}
        for number, plain in zip(numbers, self._plain, strict=True):
            # Rule 4 of bbtc.ground.effects.
            if number is not None and sets.get(number, -1) < plain.value:
                sets[number] = plain.value
        return sets


# --- factors of settings -------------------------------------------------------------------------


def certain(sets: list[Pairs]) -> list[tuple[Factor, ...]]:
    """For each the factor that certainly sets these variables; none where nothing is set."""
    factors = _factors([(ONE, sets)], oneof=False)
    return factors if all(sets) else [made if each else () for made, each in zip(factors, sets, strict=True)]


def drawn(branches: list[tuple[Fraction, list[Pairs]]], *, oneof: bool) -> list[tuple[Factor, ...] | None]:
    """For each row the factor that draws one of the branches, each given with its probability and what it
    sets in every row. None where branches come to the same: then they are to be merged."""
    made: list[tuple[Factor, ...] | None] = [*_factors(branches, oneof=oneof)]
    if len(branches) > _FEW_BRANCHES:
        rows = zip(*(sets for _, sets in branches), strict=True)
        return [None if len({*row}) < len(row) else each for each, row in zip(made, rows, strict=True)]
    for (_, one), (_, other) in combinations(branches, 2):
        if any(map(eq, one, other)):
            made = [None if a == b else each for a, b, each in zip(one, other, made, strict=True)]
    return made


def _factors(branches: list[tuple[Fraction, list[Pairs]]], *, oneof: bool) -> list[tuple[Factor, ...]]:
    size, zeros, none = len(branches[0][1]), repeat(ZERO), repeat(())
    outcomes = []
    for probability, sets in branches:
        effects: list[tuple[Effect, ...]] = list(zip(instances(Effect, size, repeat(None), sets)))
        if not all(sets):
            effects = [made if each else () for made, each in zip(effects, sets, strict=True)]
        outcomes.append(
            instances(
                Outcome, size, repeat(probability), effects, none, zeros, zeros, none, repeat(False), none
            )
        )
    return list(zip(instances(Factor, size, zip(*outcomes, strict=True), repeat(oneof))))
