"""Exact numbers as text and as floats, however large they are."""

from __future__ import annotations

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal
from fractions import Fraction

LARGEST = 1e150
"""So large :func:`rounded` floats get: the product of two of them is still a float."""

CHUNK = 1000
"""Digits converted at a time: Python refuses to convert more than 4300 at once."""

_MOST_BITS = 12_000

_SMALLEST = 1e-300


def too_long(value: Fraction) -> bool:
    """Has the number more digits (some 3600) than one of a task may have? All that is computed from
    these is much longer, and Python itself refuses to write whole numbers of more than 4300."""
    return value.numerator.bit_length() + value.denominator.bit_length() > _MOST_BITS


def figure_text(value: Fraction) -> str:
    """A computed number: ``31/32``, ``0``, ``1``."""
    sign = "-" if value < 0 else ""
    numerator = f"{sign}{digits(abs(value.numerator))}"
    return numerator if value.denominator == 1 else f"{numerator}/{digits(value.denominator)}"


def short_text(value: Fraction) -> str:
    """A number as a decimal fraction, ``0.95``, where it is one; else as it is, ``2/3``."""
    rest = value.denominator
    for factor in (2, 5):
        while rest % factor == 0:
            rest //= factor
    if rest > 1:
        return figure_text(value)
    count = 0
    while (value * 10**count).denominator > 1:
        count += 1
    return decimal(value, count)


def digits(value: int) -> str:
    """A whole number from 0 on."""
    chunks: list[str] = []
    base = 10**CHUNK
    while value >= base:
        value, rest = divmod(value, base)
        chunks.append(str(rest).rjust(CHUNK, "0"))
    return "".join([str(value), *reversed(chunks)])


def rounded(value: Fraction) -> float:
    """The nearest float from ``-LARGEST`` to ``LARGEST``: for what need not be exact, as estimates."""
    try:
        return max(-LARGEST, min(LARGEST, float(value)))
    except OverflowError:
        return LARGEST if value > 0 else -LARGEST


def decimal(value: Fraction, places: int) -> str:
    """The number with so many significant digits at most: ``0.333333``, ``1e-06``, ``2.5e+400``."""
    try:
        near = float(value)
    except OverflowError:
        near = 0.0
    if not value or abs(near) > _SMALLEST:
        return f"{near:.{places}g}"
    context = Context(prec=places, Emax=MAX_EMAX, Emin=MIN_EMIN)
    quotient = context.divide(Decimal(value.numerator), Decimal(value.denominator))
    return f"{quotient.normalize(context):.{places}g}"


def brief(value: Fraction, digits: int = 25) -> str:
    """A probability that somebody may want to compare: a fraction where its denominator has no more digits,
    else twelve decimals marked ``≈``."""
    return str(value) if value.denominator < 10**digits else f"≈ {decimal(value, 12)}"
