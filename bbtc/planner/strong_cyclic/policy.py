"""Policies over partial states: what to do where, and what not to do where."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from bbtc.planner.mdp.packing import set_bits
from bbtc.planner.strong_cyclic.partial_state import PartialState, contains, entails


@dataclass(frozen=True, slots=True)
class Pair:
    """Start ``action`` (its number in the task) in states that satisfy ``partial``: then one of its outcomes
    leads to where a pair of ``distance`` less 1 applies, and from distance 1 to the goal."""

    partial: PartialState
    action: int
    distance: int


@dataclass(slots=True)
class _Index:
    """Numbered partial states, each under one of its bits that must be set."""

    under: dict[int, list[tuple[int, int, int]]] = field(default_factory=dict)
    bits: int = 0
    other: list[tuple[int, int, int]] = field(default_factory=list)

    def add(self, number: int, partial: PartialState) -> None:
        entry = (partial.mask, partial.value, number)
        if not partial.value:
            self.other.append(entry)
            return
        # The bit under which the fewest stand.
        pivot = min(set_bits(partial.value), key=lambda bit: (len(self.under.get(bit, ())), bit))
        self.under.setdefault(pivot, []).append(entry)
        self.bits |= 1 << pivot

    def satisfied(self, state: int) -> list[int]:
        """The numbers of those that a state satisfies."""
        found = [number for mask, value, number in self.other if state & mask == value]
        for bit in set_bits(state & self.bits):
            found.extend(number for mask, value, number in self.under[bit] if state & mask == value)
        return found

    def entailed(self, partial: PartialState) -> list[int]:
        """The numbers of those that a partial state entails."""
        known = partial.mask
        return [
            number
            for mask, value, number in self._near(partial.value)
            if known & mask == mask and partial.value & mask == value
        ]

    def _near(self, state: int) -> Iterator[tuple[int, int, int]]:
        yield from self.other
        for bit in set_bits(state & self.bits):
            yield from self.under[bit]


class Forbidden:
    """Pairs of partial state and action that a policy must not use: the action may lead to a dead end."""

    def __init__(self) -> None:
        self.of_action: dict[int, list[PartialState]] = {}
        self.everywhere: set[int] = set()
        self.count = 0

    def add(self, partial: PartialState, action: int) -> bool:
        """Forbid an action where something holds; False if it was forbidden there already."""
        if action in self.everywhere:
            return False
        if not partial.mask:
            self.everywhere.add(action)
            self.of_action[action] = [partial]
            self.count += 1
            return True
        known = self.of_action.get(action, [])
        if any(entails(partial, each) for each in known):
            return False
        self.of_action[action] = [*(each for each in known if not entails(each, partial)), partial]
        self.count += 1
        return True

    def forbids(self, state: int, action: int) -> PartialState | None:
        """Why an action is forbidden in a state, if it is."""
        for partial in self.of_action.get(action, ()):
            if contains(partial, state):
                return partial
        return None


class Policy:
    """Pairs, asked by state: of those that apply, one of the least distance is followed."""

    def __init__(self, forbidden: Forbidden) -> None:
        self.forbidden = forbidden
        self.pairs: list[Pair] = []
        self.kept: set[int] = set()
        """The numbers of those that have not been dropped."""
        self._known: dict[tuple[PartialState, int], int] = {}
        self._index = _Index()

    def add(self, pair: Pair) -> None:
        """One more pair, unless it is known with no greater distance."""
        key = (pair.partial, pair.action)
        known = self._known.get(key)
        if known is not None and self.pairs[known].distance <= pair.distance:
            return
        self._known[key] = len(self.pairs)
        self._index.add(len(self.pairs), pair.partial)
        self.kept.add(len(self.pairs))
        self.pairs.append(pair)

    def keep(self, numbers: set[int]) -> None:
        """Drop all others."""
        self.kept = numbers
        self._known, self._index = {}, _Index()
        for number in sorted(numbers):
            pair = self.pairs[number]
            self._known[pair.partial, pair.action] = number
            self._index.add(number, pair.partial)

    def order(self, number: int) -> tuple[int, int]:
        """Sort key of a pair, the first to follow first."""
        return self.pairs[number].distance, number

    def decide(self, state: int) -> int | None:
        """The number of the pair that is followed in a state, if any is."""
        best: int | None = None
        for number in self._index.satisfied(state):
            if best is not None and self.order(best) <= self.order(number):
                continue
            if self.forbidden.forbids(state, self.pairs[number].action) is None:
                best = number
        return best

    def __iter__(self) -> Iterator[int]:
        """The numbers of the pairs, in the order in which they are followed."""
        return iter(sorted(self.kept, key=self.order))


class Covers:
    """Partial states of which something is known, asked by state."""

    def __init__(self) -> None:
        self.partials: list[PartialState] = []
        self._index = _Index()

    def add(self, partial: PartialState) -> None:
        """One more."""
        self._index.add(len(self.partials), partial)
        self.partials.append(partial)

    def entailed(self, partial: PartialState) -> list[int]:
        """The numbers of those that a partial state entails."""
        return self._index.entailed(partial)

    def number(self, state: int) -> int | None:
        """The number of the first of them that a state satisfies."""
        return min(self._index.satisfied(state), default=None)

    def first(self, state: int) -> PartialState | None:
        """The first of them that a state satisfies."""
        found = self.number(state)
        return None if found is None else self.partials[found]
