"""Physical states as bits: one bit per variable for "true", one more per three-valued variable for
"unknown", packed into 64-bit words, and conditions as tests of those bits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from typing_extensions import assert_never

from bbtc.belief.draws import PLACES, Values
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, in_digits
from bbtc.ground.task import Task
from bbtc.kleene import Truth

if TYPE_CHECKING:  # a strategy that keeps states as integers loads no NumPy
    import numpy as np
    import numpy.typing as npt

WORD = 64
BELIEF = 8 * PLACES
"""Bits that the number of a belief takes."""
_FEW_BITS = 32
Words: TypeAlias = "npt.NDArray[np.uint64]"
"""Packed states, a row each."""
Flags: TypeAlias = "npt.NDArray[np.bool_]"

_TRUE_AS_ONE = bytes(ord("1") if value == Truth.TRUE else ord("0") for value in range(256))


@dataclass(frozen=True, slots=True)
class Cube:
    """A conjunction of bit literals: holds in a state where ``state & mask == value``."""

    mask: int
    value: int


@dataclass(frozen=True, slots=True)
class Packing:
    """Where the bits of each variable stand. ``unknown[v]`` is None for a two-valued variable."""

    unknown: tuple[int | None, ...]
    words: int
    beliefs: int = 0
    """Components of hidden facts: the numbers of what is believed of them stand behind the variables."""
    stage_bits: int = 0
    """Behind these stands the stage (:mod:`bbtc.planner.mdp.passing`), 0 where something is decided."""
    _three_valued: tuple[int, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        three_valued = tuple(v for v, at in enumerate(self.unknown) if at is not None)
        object.__setattr__(self, "_three_valued", three_valued)

    @property
    def _first_belief(self) -> int:
        return len(self.unknown) + len(self._three_valued)

    def in_stage(self, stage: int) -> Cube:
        """The test for a stage."""
        at = self._first_belief + BELIEF * self.beliefs
        return Cube((1 << self.stage_bits) - 1 << at, stage << at)

    def passing(self, states: Words) -> Flags:
        """In which rows nothing is decided."""
        return ~holds(self, self.in_stage(0), states)

    @classmethod
    def of(cls, task: Task, stage_bits: int = 0) -> Packing:
        """The layout for a task: true bits first, by variable, then the unknown bits."""
        at = len(task.variables)
        beliefs = len(task.components)
        unknown: list[int | None] = []
        for variable in task.variables:
            unknown.append(at if variable.three_valued else None)
            at += variable.three_valued
        at += BELIEF * beliefs + stage_bits
        return cls(tuple(unknown), max(1, -(-at // WORD)), beliefs, stage_bits)

    def owner(self, bit: int) -> int:
        """The variable that a bit belongs to."""
        count = len(self.unknown)
        return bit if bit < count else self._three_valued[bit - count]

    def bits(self, variable: int) -> int:
        """All bits of a variable."""
        unknown = self.unknown[variable]
        return 1 << variable | (0 if unknown is None else 1 << unknown)

    def assigned(self, variable: int, value: int) -> int:
        """The bits of a variable that has a value. Raises ``ValueError`` if it cannot have it."""
        if value == Truth.TRUE:
            return 1 << variable
        if value == Truth.FALSE:
            return 0
        unknown = self.unknown[variable]
        if unknown is None:
            raise ValueError(f"variable {variable} is two-valued")
        return 1 << unknown

    def pack(self, values: Values) -> int:
        """The bits of a state."""
        count = len(self.unknown)
        packed = int(values[:count][::-1].translate(_TRUE_AS_ONE) or b"0", 2)
        if self.beliefs:
            packed |= int.from_bytes(values[count:], "big") << self._first_belief
        for variable in self._three_valued:
            if values[variable] == Truth.UNKNOWN:
                packed |= self.assigned(variable, Truth.UNKNOWN)
        return packed

    def split(self, packed: Iterable[int]) -> Words:
        """Integers of bits as rows of words."""
        import numpy as np

        rows = [p.to_bytes(self.words * 8, "little") for p in packed]
        return np.frombuffer(b"".join(rows), dtype="<u8").astype(np.uint64).reshape(len(rows), self.words)

    def bit_columns(self, states: Words) -> npt.NDArray[np.uint8]:
        """Bits (rows) by state (columns): 0 or 1."""
        import numpy as np

        octets = np.ascontiguousarray(states.astype("<u8", copy=False).T).view(np.uint8)
        by_octet = octets.reshape(self.words, len(states), 8).transpose(0, 2, 1)
        found: npt.NDArray[np.uint8] = np.empty((self.words, 8, 8, len(states)), dtype=np.uint8)
        for bit in range(8):
            np.bitwise_and(by_octet >> bit, 1, out=found[:, :, bit])
        return found.reshape(self.words * WORD, len(states))

    def unpack(self, states: Words) -> npt.NDArray[np.uint8]:
        """The truth value of every variable in each row."""
        import numpy as np

        octets = np.ascontiguousarray(states.astype("<u8")).view(np.uint8)
        bits = np.unpackbits(octets.reshape(len(states), self.words * 8), axis=1, bitorder="little")
        count = len(self.unknown)
        values: npt.NDArray[np.uint8] = bits[:, :count] * 2
        three = [v for v, at in enumerate(self.unknown) if at is not None]
        if three:
            values[:, three] += bits[:, [at for at in self.unknown if at is not None]]
        return values

    def values(self, states: Words) -> list[Values]:
        """States as the rest of the program keeps them."""
        octets, count = self.unpack(states).tobytes(), len(self.unknown)
        found = [octets[row * count : (row + 1) * count] for row in range(len(states))]
        if self.beliefs:
            return [values + self._belief_bytes(states, row) for row, values in enumerate(found)]
        return found

    def _belief_bytes(self, states: Words, row: int) -> bytes:
        bits = int.from_bytes(states[row].astype("<u8").tobytes(), "little") >> self._first_belief
        return (bits & (1 << BELIEF * self.beliefs) - 1).to_bytes(PLACES * self.beliefs, "big")

    def belief_numbers(self, states: Words) -> npt.NDArray[np.uint32]:
        """In each row, the number of what is believed of each component."""
        import numpy as np

        rows = b"".join(self._belief_bytes(states, row) for row in range(len(states) if self.beliefs else 0))
        return np.frombuffer(rows, dtype=">u4").astype(np.uint32).reshape(len(states), self.beliefs)


def set_bits(bits: int) -> Iterator[int]:
    """The numbers of the bits that are set, in order."""
    if bits.bit_count() > _FEW_BITS:  # each step below takes time with the length of the number
        text = bin(bits)[:1:-1]
        at = text.find("1")
        while at >= 0:
            yield at
            at = text.find("1", at + 1)
        return
    while bits:
        lowest = bits & -bits
        yield lowest.bit_length() - 1
        bits ^= lowest


# --- conditions ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class All:
    """A conjunction of tests."""

    parts: tuple[BitTest, ...]


@dataclass(frozen=True, slots=True)
class Any:
    """A disjunction of tests."""

    parts: tuple[BitTest, ...]


BitTest: TypeAlias = Cube | All | Any
ALWAYS = Cube(0, 0)
NEVER = Any(())


def bit_test(packing: Packing, condition: Condition, value: bool = True) -> BitTest:
    """When the Kleene value of a condition is true (false with ``value`` False), as a test."""
    match condition:
        case Is(variable, Truth.UNKNOWN):
            return _is_unknown(packing, variable, value)
        case Known(variable):
            return _is_unknown(packing, variable, not value)
        case Is(variable, wanted):
            true = value == (wanted is Truth.TRUE)
            return Cube(packing.bits(variable), 1 << variable if true else 0)
        case Within():
            return bit_test(packing, in_digits(condition), value)
        case And(parts) if value:
            return every(bit_test(packing, part, True) for part in parts)
        case Or(parts) if not value:
            return every(bit_test(packing, part, False) for part in parts)
        case And(parts) | Or(parts):
            return _any([bit_test(packing, part, value) for part in parts])
        case Not(part):
            return bit_test(packing, part, not value)
        case Constant(constant):
            return ALWAYS if constant == value else NEVER
        case _:
            assert_never(condition)


def _is_unknown(packing: Packing, variable: int, value: bool) -> BitTest:
    at = packing.unknown[variable]
    if at is None:
        return NEVER if value else ALWAYS
    return Cube(1 << at, 1 << at if value else 0)


def every(parts: Iterable[BitTest]) -> BitTest:
    """That all of some tests hold."""
    mask = bits = 0
    rest: list[BitTest] = []
    for part in parts:
        if part == NEVER:
            return NEVER
        if isinstance(part, Cube):
            if (bits ^ part.value) & mask & part.mask:
                return NEVER
            mask, bits = mask | part.mask, bits | part.value
        else:
            rest.append(part)
    if not rest:
        return Cube(mask, bits)
    return All((*([Cube(mask, bits)] if mask else []), *rest))


def _any(parts: Sequence[BitTest]) -> BitTest:
    if ALWAYS in parts:
        return ALWAYS
    kept = tuple(dict.fromkeys(part for part in parts if part != NEVER))
    return kept[0] if len(kept) == 1 else Any(kept)


def cubes(test: BitTest, most: int) -> list[Cube] | None:
    """The test as a disjunction of cubes; None if that takes more than ``most`` of them."""
    match test:
        case Cube():
            return [test]
        case Any(parts):
            found: dict[Cube, None] = {}
            for part in parts:
                inner = cubes(part, most)
                if inner is None:
                    return None
                found.update(dict.fromkeys(inner))
            return list(found) if len(found) <= most else None
        case All(parts):
            product = [ALWAYS]
            for part in parts:
                inner = cubes(part, most)
                if inner is None:
                    return None
                joined = [every((a, b)) for a in product for b in inner]
                product = list(dict.fromkeys(cube for cube in joined if isinstance(cube, Cube)))
                if len(product) > most:
                    return None
            return product
        case _:
            assert_never(test)


def holds(packing: Packing, test: BitTest, states: Words) -> Flags:
    """In which rows the test holds."""
    import numpy as np

    match test:
        case Cube(mask, value):
            found = np.ones(len(states), dtype=np.bool_)
            for word in range(packing.words):
                part = mask >> word * WORD & (1 << WORD) - 1
                if part:
                    bits = np.uint64(value >> word * WORD & (1 << WORD) - 1)
                    found &= (states[:, word] & np.uint64(part)) == bits
            return found
        case All(parts):
            found = np.ones(len(states), dtype=np.bool_)
            for inner in parts:
                found &= holds(packing, inner, states)
            return found
        case Any(parts):
            found = np.zeros(len(states), dtype=np.bool_)
            for inner in parts:
                found |= holds(packing, inner, states)
            return found
        case _:
            assert_never(test)
