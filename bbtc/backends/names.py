"""Identifiers for the names of a domain: injective, stable, and harmless in any output.

A *plain* name is made of ASCII letters and digits in words that ``-`` or ``_`` separate, and begins
with a letter. It becomes ``LightOn`` (camel) or ``light_on`` (snake), as does nearly every name:

1. A predicate that shares its identifier with an action, or has a reserved one, gets the prefix
   ``Is``/``is_``, and so a number ``Get``/``get_``; an action with a reserved one ``Do``/``do_``; a parameter
   ``arg_``.
2. A name that is not plain, too long, or still shares its identifier (``at-a``, ``at_a``, ``At_a``;
   letter case does not tell identifiers apart) gets ``_`` and the first digits of its SHA-256.

An identifier depends on other names only where they would collide with it.
"""

from __future__ import annotations

import hashlib
import keyword
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from typing_extensions import assert_never

_LONGEST = 60
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9]*(?:[-_][A-Za-z0-9]+)*")
_SAFE_VALUE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]*")
_WORDS = re.compile(r"[A-Za-z0-9]+")

PYTHON_RESERVED = frozenset(keyword.kwlist) | {"self", "bool", "str", "cancel", "setup", "heard_of"}
"""Names that a method of a generated interface cannot have, whatever the letter case."""

_ROS_PORTS = ("action_name", "service_name", "topic_name")  # ports that leaves of behaviortree_ros2 have

Kind = Literal["predicate", "function", "action", "parameter"]
Style = Literal["camel", "snake"]


@dataclass(frozen=True, slots=True, order=True)
class Symbol:
    """What gets an identifier. Uses of one predicate or schema with different numbers of arguments
    are different symbols."""

    kind: Kind
    name: str
    arity: int


def identifiers(symbols: Iterable[Symbol], style: Style, reserved: Collection[str]) -> dict[Symbol, str]:
    """An identifier for every symbol by the rules above; no two are equal, even ignoring case."""
    ordered = sorted(set(symbols))
    sharing: dict[str, list[Symbol]] = {}
    for symbol in ordered:
        sharing.setdefault(_base(symbol.name, style).casefold(), []).append(symbol)
    banned = {word.casefold() for word in reserved}
    ranked = []
    for symbol in ordered:
        base = _base(symbol.name, style)
        peers = sharing[base.casefold()]
        alone = sum(peer.kind == symbol.kind for peer in peers) == 1
        if not _is_plain(symbol.name) or not alone:
            rank = 2
        elif base.casefold() in banned or (symbol.kind != "action" and len(peers) > 1):
            rank = 1
        else:
            rank = 0
        ranked.append((rank, symbol))
    names = Namer(reserved)
    return {
        symbol: names.take(*_candidates(symbol, style)[rank:], seed=symbol.name)
        for rank, symbol in sorted(ranked)
    }


def possible_identifiers(symbol: Symbol, style: Style) -> tuple[str, ...]:
    """The identifiers that :func:`identifiers` gives a symbol, whatever stands beside it, the usual one
    first. (Where even the last is taken, it gets a longer digest.)"""
    return _candidates(symbol, style)


@lru_cache(maxsize=4096)  # a reader asks at every leaf
def parameter_names(names: tuple[str, ...]) -> tuple[str, ...]:
    """Snake-case identifiers for the parameters of one symbol: ports and Python arguments."""
    symbols = [Symbol("parameter", name, 0) for name in names]
    if len(set(names)) < len(names):
        return parameter_names(tuple(f"arg{position}" for position, _ in enumerate(names, 1)))
    table = identifiers(symbols, "snake", {"name", "id", "robot", *_ROS_PORTS, *PYTHON_RESERVED})
    return tuple(table[symbol] for symbol in symbols)


def port_values(names: Iterable[str]) -> dict[str, str]:
    """Object names as attribute values: themselves, unless they hold a character that an engine
    reads as syntax (braces, quotes, control characters…); then words and a digest."""
    ordered = sorted(set(names))
    taken = Namer()
    table = {name: taken.take(name, seed=name, fold=False) for name in ordered if _SAFE_VALUE.fullmatch(name)}
    for name in ordered:
        if name not in table:
            table[name] = taken.take(_with_digest(_base(name, "snake"), name, 8), seed=name, fold=False)
    return table


def camel(text: str) -> str:
    """A CamelCase identifier for any text, not injective."""
    return _base(text, "camel")


_TAKEN_MODULES = frozenset(
    {"argparse", "bbtc", "collections", "fractions", "math", "py_trees", "random", "time", "typing", "urllib"}
)


def module_name(text: str) -> str:
    """A snake-case name for a Python module, or a part of one. Names that are not plain get a digest,
    keywords and what generated modules import themselves the prefix ``tree_``."""
    base = _base(text, "snake")
    if not _is_plain(text):
        return _with_digest(base, text, 8)
    return f"tree_{base}" if base in PYTHON_RESERVED | _TAKEN_MODULES else base


def interface_header(interface: str) -> str:
    """The file name that ROS 2 derives from the name of an interface: ``LightOn`` is ``light_on``."""
    spaced = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", interface)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", spaced).lower()


def snake(text: str) -> str:
    """A snake_case identifier for any text, not injective."""
    return _base(text, "snake")


class Namer:
    """Hands out names, never the same twice."""

    def __init__(self, reserved: Collection[str] = ()) -> None:
        self._taken = {word.casefold() for word in reserved}

    def take(self, *candidates: str, seed: str, fold: bool = True) -> str:
        """The first candidate that is free, or the last with a digest of ``seed`` that makes it so.
        ``fold`` takes names that differ in letter case only for equal."""
        for candidate in candidates:
            key = candidate.casefold() if fold else candidate
            if key not in self._taken:
                self._taken.add(key)
                return candidate
        for length in range(8, 65):
            longer = _with_digest(candidates[-1], seed, length)
            key = longer.casefold() if fold else longer
            if key not in self._taken:
                self._taken.add(key)
                return longer
        return self.take(f"{candidates[-1]}_{len(self._taken)}", seed=f"{seed}.", fold=fold)


def _candidates(symbol: Symbol, style: Style) -> tuple[str, str, str]:
    base = _base(symbol.name, style)
    match symbol.kind:
        case "predicate":
            prefix = "is"
        case "function":
            prefix = "get"
        case "action":
            prefix = "do"
        case "parameter":
            prefix = "arg"
        case _:
            assert_never(symbol.kind)
    prefixed = prefix.capitalize() + base if style == "camel" else f"{prefix}_{base}"
    return base, prefixed, _with_digest(base, f"{symbol.name}/{symbol.arity}", 8)


def _is_plain(name: str) -> bool:
    return len(name) <= _LONGEST and _PLAIN.fullmatch(name) is not None


def _base(name: str, style: Style) -> str:
    words = _WORDS.findall(name[: 4 * _LONGEST])
    if style == "camel":
        text = "".join(word[0].upper() + word[1:] for word in words)
    else:
        text = "_".join(words).lower()
    if not text or not text[0].isalpha():
        text = ("X" if style == "camel" else "x_") + text
    return text[:_LONGEST].rstrip("_")


def _with_digest(base: str, seed: str, length: int) -> str:
    return f"{base}_{hashlib.sha256(seed.encode('utf-8', 'surrogatepass')).hexdigest()[:length]}"
