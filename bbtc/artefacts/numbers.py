"""Exact numbers as text.

Two spellings, one reading. A number that was *given* (a probability, cost or reward of the task,
a target) is written as a decimal where it has a short one, ``"0.95"``, else as a fraction, ``"1/3"``.
A *figure* that was computed is written as a fraction, ``"31/32"``, because its decimals, where
they end at all, say nothing. Whole numbers are written as such in both.
"""

from __future__ import annotations

import re
from fractions import Fraction

from bbtc.rounding import CHUNK, decimal, digits, figure_text

__all__ = [
    "MAX_LENGTH", "exact", "figure_text", "given_text", "parse_number", "parse_probability", "parse_written",
]  # fmt: skip

MAX_LENGTH = 100_000
"""Characters a number may have in an artefact, so that reading one cannot take minutes."""

_MAX_DECIMALS = 18
_LONGEST_SHOWN = 25
_LONGEST_WRITTEN = 1000  # characters; a probability with more is a mistake or an attack
_LONG_EXPONENT = re.compile(r"[eE][-+]?[0-9_]{4}")  # 10 to such powers takes for ever to compute
_NUMBER = re.compile(r"(-?)(?:([0-9]+)(?:\.([0-9]+))?|([0-9]+)/([0-9]+))", re.ASCII)


def given_text(value: Fraction) -> str:
    """A number as its author would write it: ``0.95``, ``1/3``, ``2``."""
    decimals = _decimals(value.denominator)
    if not decimals:
        return figure_text(value)
    text = digits(abs(value.numerator) * 10**decimals // value.denominator).rjust(decimals + 1, "0")
    sign = "-" if value < 0 else ""
    return f"{sign}{text[:-decimals]}.{text[-decimals:]}"


def parse_number(text: str) -> Fraction:
    """The value of either spelling. Raises ``ValueError`` for any other text."""
    match = _NUMBER.fullmatch(text) if len(text) <= MAX_LENGTH else None
    if match is None:
        raise ValueError("not an exact number")
    sign, whole, decimals, numerator, denominator = match.groups()
    if denominator is not None:
        divisor = _integer(denominator)
        if not divisor:
            raise ValueError("division by zero")
        value = Fraction(_integer(numerator), divisor)
    else:
        decimals = decimals or ""
        value = Fraction(_integer(whole + decimals), 10 ** len(decimals))
    return -value if sign else value


def exact(value: Fraction) -> str:
    """A number for people: ``7/8 (0.875)``, ``1``; a number too long to read is given as a decimal
    marked ``≈``."""
    short = max(abs(value.numerator), value.denominator) < 10**_LONGEST_SHOWN
    text = str(value) if short else ""
    if short and value.denominator == 1:
        return text
    near = decimal(value, 6)
    mark = "" if Fraction(near) == value else "≈ "
    return f"{text} ({mark}{near})" if text and len(text) <= _LONGEST_SHOWN else f"≈ {near}"


def parse_probability(text: str) -> Fraction:
    """The value of an exact probability as people write it: ``0.9``, ``9/10``, ``90%``, ``1e-3``.
    Raises ``ValueError`` for any other text and for a value outside [0, 1]."""
    number = parse_written(text, "a probability such as 0.9, 9/10 or 90%")
    if not 0 <= number <= 1:
        meant = "%" not in text and 2 <= number <= 100
        hint = f"; write {text[:40]}% for a percentage" if meant else ""
        raise ValueError(f"{text[:40]} is not between 0 and 1{hint}")
    return number


def parse_written(text: str, expected: str = "a number such as 0.9, 9/10 or 90%") -> Fraction:
    """The value of a number as people write it. Raises ``ValueError`` for any other text."""
    costly = len(text) > _LONGEST_WRITTEN or _LONG_EXPONENT.search(text)
    written = "" if costly else text
    try:
        return Fraction(written[:-1]) / 100 if written.endswith("%") else Fraction(written)
    except (ValueError, ZeroDivisionError):
        raise ValueError(f"'{text[:40]}' is not {expected}") from None


def _decimals(denominator: int) -> int:
    """Decimals that a reduced fraction with this denominator needs; 0 for a whole number and for
    one that has no decimal of modest length."""
    for decimals in range(1, _MAX_DECIMALS + 1):
        if 10**decimals % denominator == 0:
            return decimals if denominator > 1 else 0
    return 0


def _integer(text: str) -> int:
    value = 0
    for start in range(0, len(text), CHUNK):
        chunk = text[start : start + CHUNK]
        value = value * 10 ** len(chunk) + int(chunk)
    return value
