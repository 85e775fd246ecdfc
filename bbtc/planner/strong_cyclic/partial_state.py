"""Partial states: what must be known of a state for something to hold.

A state is an integer of bits (:class:`bbtc.planner.mdp.packing.Packing`), and a partial state a conjunction
of literals over these bits: a mask of those that matter, and their values. Everything here tells of a
concrete state *why* something holds in it, as a partial state that the state satisfies and that is enough.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from typing_extensions import assert_never

from bbtc.ground.condition import Condition, Is, Known
from bbtc.kleene import Truth
from bbtc.planner.mdp.packing import All, Any, BitTest, Cube, Packing, set_bits

PartialState = Cube
"""Holds in a state where ``state & mask == value``."""

ANY_STATE = PartialState(0, 0)


def contains(partial: PartialState, state: int) -> bool:
    """Does a state satisfy it?"""
    return state & partial.mask == partial.value


def entails(one: PartialState, other: PartialState) -> bool:
    """Does every state that satisfies ``one`` satisfy ``other``, too?"""
    return one.mask & other.mask == other.mask and (one.value ^ other.value) & other.mask == 0


def contradict(one: PartialState, other: PartialState) -> bool:
    """Do they differ in a bit, so that no state satisfies both?"""
    return (one.value ^ other.value) & one.mask & other.mask != 0


def united(one: PartialState, other: PartialState) -> PartialState:
    """Both together, where they do not contradict one another."""
    return PartialState(one.mask | other.mask, one.value | other.value)


def satisfied(test: BitTest, state: int) -> bool:
    """Does a test hold in a state?"""
    match test:
        case Cube(mask, value):
            return state & mask == value
        case All(parts):
            return all(satisfied(part, state) for part in parts)
        case Any(parts):
            return any(satisfied(part, state) for part in parts)
        case _:
            assert_never(test)


@dataclass(frozen=True, slots=True)
class Reasons:
    """Reasons why tests hold and do not hold in a state, small ones where there is a choice."""

    packing: Packing

    def why(self, test: BitTest, state: int, known: int = 0) -> PartialState:
        """Enough for a test that holds in the state; bits of the mask ``known`` cost nothing."""
        match test:
            case Cube():
                return test
            case All(parts):
                found = ANY_STATE
                for part in parts:
                    found = united(found, self.why(part, state, known | found.mask))
                return found
            case Any(parts):
                ways = [self.why(part, state, known) for part in parts if satisfied(part, state)]
                return min(ways, key=lambda way: (way.mask & ~known).bit_count())
            case _:
                assert_never(test)

    def why_not(self, test: BitTest, state: int, known: int = 0) -> PartialState:
        """Enough for a test that does not hold in the state to hold in none that satisfies it."""
        match test:
            case Cube():
                return self.differs(test, state, known)
            case All(parts):
                ways = [self.why_not(part, state, known) for part in parts if not satisfied(part, state)]
                return min(ways, key=lambda way: (way.mask & ~known).bit_count())
            case Any(parts):
                found = ANY_STATE
                for part in parts:
                    found = united(found, self.why_not(part, state, known | found.mask))
                return found
            case _:
                assert_never(test)

    def differs(self, cube: PartialState, state: int, known: int = 0) -> PartialState:
        """One literal of the state that contradicts a partial state: one that is known already, else one
        that says that something is true, else the first."""
        wrong = (state ^ cube.value) & cube.mask
        chosen = wrong & known or wrong & state or wrong
        bit = (chosen & -chosen).bit_length() - 1
        variable = self.packing.owner(bit)
        unknown = self.packing.unknown[variable]
        if unknown is not None and cube.mask & cube.value >> unknown & 1:
            return PartialState(1 << unknown, 0)  # it would have to be unknown, and is not
        return self.literal(variable, state)

    def literal(self, variable: int, state: int) -> PartialState:
        """The value of a variable in a state."""
        bits = self.packing.bits(variable)
        unknown = self.packing.unknown[variable]
        if unknown is not None and state >> unknown & 1:
            return PartialState(1 << unknown, 1 << unknown)
        return PartialState(bits, state & bits)


def literals(packing: Packing, partial: PartialState) -> list[PartialState]:
    """Its literals, by variable."""
    owners = sorted({packing.owner(bit) for bit in set_bits(partial.mask)})
    return [restricted(partial, packing.bits(variable)) for variable in owners]


def restricted(partial: PartialState, mask: int) -> PartialState:
    """What it says of some bits."""
    return PartialState(partial.mask & mask, partial.value & mask)


def without(partial: PartialState, mask: int) -> PartialState:
    """What it says of all but some bits."""
    return PartialState(partial.mask & ~mask, partial.value & ~mask)


def as_conditions(packing: Packing, partial: PartialState) -> Iterable[Condition]:
    """Its literals as conditions, by variable. True and false ones are unknown where the variable is."""
    for literal in literals(packing, partial):
        variable = packing.owner((literal.mask & -literal.mask).bit_length() - 1)
        unknown = packing.unknown[variable]
        if literal.mask >> variable & 1:
            yield Is(variable, Truth.TRUE if literal.value >> variable & 1 else Truth.FALSE)
        elif unknown is not None and literal.value >> unknown & 1:
            yield Is(variable, Truth.UNKNOWN)
        else:
            yield Known(variable)
