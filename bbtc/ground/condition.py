"""Ground conditions: strong Kleene formulas over the variables of a task, by index."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.kleene import Truth, negate


@dataclass(frozen=True, slots=True)
class Is:
    """The variable has the value. For true and false this is the Kleene literal (unknown while
    the variable is unknown); for unknown it is the two-valued test ``(unknown p)``."""

    variable: int
    value: Truth


@dataclass(frozen=True, slots=True)
class Known:
    """The two-valued test ``(known p)``."""

    variable: int


@dataclass(frozen=True, slots=True)
class Within:
    """A number is from ``low`` to ``high``. It is written in binary digits, which are two-valued variables,
    the least first, and counted from the least value it can have (:class:`bbtc.ground.task.NumberVariable`).
    Made by :func:`within`, which knows constants."""

    digits: tuple[int, ...]
    low: int
    high: int

    @property
    def most(self) -> int:
        """What the digits can say at most."""
        return (1 << len(self.digits)) - 1


class _Compound:
    """Remembers its hash: it is often asked for, and conditions may be deep."""

    __slots__ = ("_hash",)
    _hash: int

    def __hash__(self) -> int:
        try:
            return self._hash
        except AttributeError:
            found = hash((type(self), self._within()))
            object.__setattr__(self, "_hash", found)
            return found

    def _within(self) -> object:
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class And(_Compound):
    """Kleene conjunction: the minimum."""

    parts: tuple[Condition, ...]
    __hash__ = _Compound.__hash__

    def _within(self) -> object:
        return self.parts


@dataclass(frozen=True, slots=True)
class Or(_Compound):
    """Kleene disjunction: the maximum."""

    parts: tuple[Condition, ...]
    __hash__ = _Compound.__hash__

    def _within(self) -> object:
        return self.parts


@dataclass(frozen=True, slots=True)
class Not(_Compound):
    """Kleene negation."""

    part: Condition
    __hash__ = _Compound.__hash__

    def _within(self) -> object:
        return self.part


@dataclass(frozen=True, slots=True)
class Constant:
    """Always true or always false."""

    value: bool


Condition: TypeAlias = Is | Known | Within | And | Or | Not | Constant
TRUE = Constant(True)
FALSE = Constant(False)


def within(digits: tuple[int, ...], low: int, high: int) -> Condition:
    """That a number is from ``low`` to ``high``, as far as its digits can say that."""
    most = (1 << len(digits)) - 1
    low, high = max(low, 0), min(high, most)
    if low > high:
        return FALSE
    return TRUE if (low, high) == (0, most) else Within(digits, low, high)


def in_digits(number: Within) -> Condition:
    """The same condition over the digits, one by one."""
    return _spelt(number.digits, number.low, number.high)


def _spelt(digits: tuple[int, ...], low: int, high: int) -> Condition:
    most = (1 << len(digits)) - 1
    if low > high:
        return FALSE
    if (low, high) == (0, most):
        return TRUE
    first, rest, half = digits[-1], digits[:-1], 1 << len(digits) - 1
    upper = _spelt(rest, max(low - half, 0), high - half)
    lower = _spelt(rest, low, min(high, half - 1))
    if upper == lower:
        return upper
    return disjunction(
        [
            conjunction([Is(first, Truth.TRUE), upper]),
            conjunction([Is(first, Truth.FALSE), lower]),
        ]
    )


def number_in(digits: Sequence[int], state: Sequence[int] | Mapping[int, int]) -> int:
    """What the digits of a number say in a state."""
    return sum((state[digit] >> 1) << place for place, digit in enumerate(digits))


def conjunction(parts: Iterable[Condition]) -> Condition:
    """The conjunction, flattened, without repeats and constants."""
    return _combine(And, TRUE, FALSE, parts)


def disjunction(parts: Iterable[Condition]) -> Condition:
    """The disjunction, flattened, without repeats and constants."""
    return _combine(Or, FALSE, TRUE, parts)


def _combine(
    kind: type[And] | type[Or], neutral: Constant, absorbing: Constant, parts: Iterable[Condition]
) -> Condition:
    flat: dict[Condition, None] = {}
    for part in parts:
        if part == absorbing:
            return absorbing
        if isinstance(part, kind):
            flat.update(dict.fromkeys(part.parts))
        elif part != neutral:
            flat[part] = None
    if not flat:
        return neutral
    return next(iter(flat)) if len(flat) == 1 else kind(tuple(flat))


def negation(part: Condition) -> Condition:
    """The negation, pushed to the leaves (exact in strong Kleene logic: De Morgan holds)."""
    match part:
        case Is(variable, Truth.UNKNOWN):
            return Known(variable)
        case Is(variable, value):
            return Is(variable, negate(value))
        case Known(variable):
            return Is(variable, Truth.UNKNOWN)
        case Within(digits, low, high):
            return disjunction([within(digits, 0, low - 1), within(digits, high + 1, part.most)])
        case And(parts):
            return disjunction(map(negation, parts))
        case Or(parts):
            return conjunction(map(negation, parts))
        case Not(inner):
            return inner
        case Constant(value):
            return FALSE if value else TRUE
        case _:
            assert_never(part)


def doubt(condition: Condition, leaf: Callable[[int], Condition]) -> Condition:
    """When a Kleene condition in negation normal form is unknown: it may be true (no part settles it), yet
    is not. ``leaf`` tells when a variable is unknown."""

    def not_false(part: Condition) -> Condition:
        """True where the part is true or unknown, else false or unknown."""
        return disjunction([part, doubt(part, leaf)])

    match condition:
        case Is(variable, value) if value is not Truth.UNKNOWN:
            return leaf(variable)
        case And(parts):
            some = disjunction(doubt(part, leaf) for part in parts)
            return conjunction([some, *map(not_false, parts)])
        case Or(parts):
            some = disjunction(doubt(part, leaf) for part in parts)
            return conjunction([some, *(not_false(negation(part)) for part in parts)])
        case Not(part):
            return doubt(negation(part), leaf)
        case Is() | Known() | Within() | Constant():  # never unknown
            return FALSE
        case _:
            assert_never(condition)


def conjuncts(condition: Condition) -> tuple[Condition, ...]:
    """The parts of a conjunction; a condition of another kind is its only part; true has none."""
    if isinstance(condition, And):
        return condition.parts
    return () if condition == TRUE else (condition,)


def leaves(condition: Condition) -> Iterator[Is | Known]:
    """What a condition reads, repeats included, from left to right; of a number, its digits."""
    match condition:
        case Is() | Known():
            yield condition
        case Within(digits):
            for digit in digits:
                yield Is(digit, Truth.TRUE)
        case And(parts) | Or(parts):
            for part in parts:
                yield from leaves(part)
        case Not(part):
            yield from leaves(part)
        case Constant():
            return
        case _:
            assert_never(condition)


def numbers_read(condition: Condition) -> Iterator[Within]:
    """The tests of numbers in a condition, repeats included, from left to right."""
    match condition:
        case Within():
            yield condition
        case And(parts) | Or(parts):
            for part in parts:
                yield from numbers_read(part)
        case Not(part):
            yield from numbers_read(part)
        case Is() | Known() | Constant():
            return
        case _:
            assert_never(condition)


def variables(condition: Condition) -> Iterator[int]:
    """Indices of the variables a condition reads, repeats included, from left to right."""
    return (leaf.variable for leaf in leaves(condition))


def is_test(leaf: Is | Known) -> bool:
    """Does it ask what is known of a variable, and not what it is?"""
    return isinstance(leaf, Known) or leaf.value is Truth.UNKNOWN


def replaced(
    condition: Condition,
    leaf: Callable[[Is | Known], Condition],
    numbers: Callable[[Within], Condition] | None = None,
) -> Condition:
    """The condition in negation normal form, without constants and repeats, with other leaves. Where nothing
    is said of ``numbers``, their digits are leaves."""
    match condition:
        case Is() | Known():
            return leaf(condition)
        case Within():
            return replaced(in_digits(condition), leaf) if numbers is None else numbers(condition)
        case And(parts):
            return conjunction(replaced(part, leaf, numbers) for part in parts)
        case Or(parts):
            return disjunction(replaced(part, leaf, numbers) for part in parts)
        case Not(part):
            return replaced(negation(part), leaf, numbers)
        case Constant():
            return condition
        case _:
            assert_never(condition)


def evaluate(condition: Condition, state: Sequence[int]) -> Truth:
    """The Kleene value of a condition in a state (truth values by variable index)."""
    match condition:
        case Is(variable, Truth.TRUE):
            return Truth(state[variable])
        case Is(variable, Truth.FALSE):
            return Truth(2 - state[variable])
        case Is(variable, _):
            return Truth.of(state[variable] == 1)
        case Known(variable):
            return Truth.of(state[variable] != 1)
        case Within(digits, low, high):
            return Truth.of(low <= number_in(digits, state) <= high)
        case And(parts):
            return min((evaluate(p, state) for p in parts), default=Truth.TRUE)
        case Or(parts):
            return max((evaluate(p, state) for p in parts), default=Truth.FALSE)
        case Not(part):
            return negate(evaluate(part, state))
        case Constant(value):
            return Truth.of(value)
        case _:
            assert_never(condition)


def _least(tests: list[Callable[[Sequence[int]], int]]) -> Callable[[Sequence[int]], int]:
    def least(state: Sequence[int]) -> int:
        found = 2
        for test in tests:
            value = test(state)
            if value < found:
                if not value:
                    return 0
                found = value
        return found

    return least


def _most(tests: list[Callable[[Sequence[int]], int]]) -> Callable[[Sequence[int]], int]:
    def most(state: Sequence[int]) -> int:
        found = 0
        for test in tests:
            value = test(state)
            if value > found:
                if value == 2:
                    return 2
                found = value
        return found

    return most


def compile_condition(condition: Condition) -> Callable[[Sequence[int]], int]:
    """:func:`evaluate` as a closure that returns plain ints, for states read very often."""
    match condition:
        case Is(variable, Truth.TRUE):
            return lambda state: state[variable]
        case Is(variable, Truth.FALSE):
            return lambda state: 2 - state[variable]
        case Is(variable, _):
            return lambda state: 2 if state[variable] == 1 else 0
        case Known(variable):
            return lambda state: 0 if state[variable] == 1 else 2
        case Within(digits, low, high):
            return lambda state: 2 if low <= number_in(digits, state) <= high else 0
        case And(parts):
            return _least([compile_condition(p) for p in parts])
        case Or(parts):
            return _most([compile_condition(p) for p in parts])
        case Not(part):
            test = compile_condition(part)
            return lambda state: 2 - test(state)
        case Constant(value):
            constant = 2 if value else 0
            return lambda _state: constant
        case _:
            assert_never(condition)
