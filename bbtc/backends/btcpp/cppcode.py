"""Text for C++ files. Names from a domain enter only as identifiers and values that
:mod:`bbtc.backends.names` made, and as words in comments, which :func:`comment` cleans."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import lcm

from bbtc.backends.names import Namer

_WORDS = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t
    class co_await co_return co_yield compl concept const const_cast consteval constexpr constinit continue
    decltype default delete do double dynamic_cast else enum explicit export extern false final float for
    friend goto if import inline int long module mutable namespace new noexcept not not_eq nullptr operator
    or or_eq override private protected public register reinterpret_cast requires return short signed sizeof
    static static_assert static_cast struct switch template this thread_local throw true try typedef typeid
    typename union unsigned using virtual void volatile wchar_t while xor xor_eq
    alloca assert errno i386 isfinite isinf isnan isnormal linux major makedev minor offsetof setjmp
    signbit stderr stdin stdout unix va_arg va_copy va_end va_start
"""

RESERVED = frozenset(_WORDS.split())
"""Keywords, and macros in lower case that standard headers may define."""

_EXACT = 2**63
_ROUNDED = 2**53


def parameters(names: Sequence[str]) -> tuple[str, ...]:
    """Identifiers for the parameters of a function, and for fields of ROS messages: the names of ports,
    with ``arg_`` before what C++ reserves."""
    taken = Namer([name for name in names if name not in RESERVED])
    return tuple(taken.take(f"arg_{name}", seed=name) if name in RESERVED else name for name in names)


def comment(text: str) -> str:
    """Any text as part of a one-line comment: printable ASCII without backslashes, not too long."""
    return "".join(c if c.isascii() and c.isprintable() and c != "\\" else "?" for c in text[:100])


def fill(text: str, **words: str) -> str:
    """A text with words in it replaced, all at once: what is put in for one is not searched for others."""
    return re.sub(rf"\b(?:{'|'.join(words)})\b", lambda found: words[found.group()], text)


def literal(text: str) -> str:
    """A string literal, of the bytes of the text in UTF-8."""
    plain = {byte for byte in range(0x20, 0x7F) if byte not in b'"\\?'}
    # Three octal digits: a longer escape would swallow what follows.
    return '"' + "".join(chr(b) if b in plain else f"\\{b:03o}" for b in text.encode(errors="replace")) + '"'


def weights(probabilities: Iterable[Fraction]) -> list[int]:
    """Whole numbers in proportion to probabilities that sum to 1; where their denominators are too large
    together, rounded to multiples of 2 to the power of -53, but never to 0."""
    listed = list(probabilities)
    whole = lcm(*(p.denominator for p in listed))
    if whole < _EXACT:
        return [int(p * whole) for p in listed]
    return [max(1, round(p * _ROUNDED)) for p in listed]
