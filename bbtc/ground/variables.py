"""The variables of a ground task: ground predicates, and the binary digits of numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from bbtc.kleene import Truth
from bbtc.source import Span


def ground_name(symbol: str, args: tuple[str, ...]) -> str:
    """``symbol(arg,…)``: the name of a ground predicate, action or template."""
    return f"{symbol}({','.join(args)})"


def split_name(name: str) -> tuple[str, tuple[str, ...]]:
    """Symbol and arguments of a ground name, as far as the name alone tells: what it says of one
    that :func:`ground_name` made of words with commas or brackets in them need not be right."""
    symbol, _, rest = name.partition("(")
    inner = rest.removesuffix(")")
    return symbol, tuple(inner.split(",")) if inner else ()


def unused_name(name: str, taken: Collection[str]) -> str:
    """The name, made longer if it is taken."""
    while name in taken:
        name += "-"
    return name


@dataclass(frozen=True, slots=True)
class Digit:
    """Which binary digit of which number a variable is: that of the value 2 to the ``place``, counted from
    ``low``, the least value of ``function`` for the variable's arguments."""

    function: str
    place: int
    low: int
    high: int
    blocks: bool = False


@dataclass(frozen=True, slots=True)
class NumberVariable:
    """A whole number from ``low`` to ``high``, kept in ``digits``: two-valued variables, the least first,
    which count from ``low``. Actions that may leave the range do not start where it ``blocks``; else it
    stays at its bounds."""

    function: str
    args: tuple[str, ...]
    low: int
    high: int
    blocks: bool
    digits: tuple[int, ...]

    @property
    def name(self) -> str:
        """``function(arg,…)``."""
        return ground_name(self.function, self.args)


@dataclass(frozen=True, slots=True)
class Variable:
    """One ground predicate. ``three_valued`` if anything in the task can make it unknown; ``external`` if
    others change it, of whom the task knows nothing. Of a number it is a ``digit``, which is true where it
    is 1."""

    predicate: str
    args: tuple[str, ...]
    three_valued: bool
    hidden: bool = False
    digit: Digit | None = None
    span: Span | None = field(default=None, compare=False, repr=False)
    external: bool = False

    @property
    def name(self) -> str:
        """``predicate(arg,…)``."""
        return ground_name(self.predicate, self.args)

    @property
    def values(self) -> tuple[Truth, ...]:
        """The values it can take."""
        return (Truth.TRUE, Truth.FALSE, Truth.UNKNOWN) if self.three_valued else (Truth.TRUE, Truth.FALSE)


def numbers_of(variables: Sequence[Variable]) -> tuple[NumberVariable, ...]:
    """The numbers that some variables are the digits of, in the order of their first digits."""
    found: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for index, variable in enumerate(variables):
        if variable.digit is not None:
            found.setdefault((variable.digit.function, variable.args), []).append(index)
    made = []
    for (function, args), indices in found.items():
        placed = sorted((digit.place, index, digit) for index, digit in _digits(variables, indices))
        _, _, digit = placed[0]
        digits = tuple(index for _, index, _ in placed)
        made.append(NumberVariable(function, args, digit.low, digit.high, digit.blocks, digits))
    return tuple(made)


def digit_name(function: str, place: int) -> str:
    """The predicate of a digit of the numbers of a function; no file can name it."""
    return f"{function} digit {place}"


def _digits(variables: Sequence[Variable], indices: Iterable[int]) -> Iterator[tuple[int, Digit]]:
    for index in indices:
        digit = variables[index].digit
        if digit is not None:
            yield index, digit
