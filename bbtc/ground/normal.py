"""Lifted effects in normal form: single settings with their quantifiers and guard, beside the
chances they are drawn with. Quantifiers and ``when`` have been pushed inwards."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.model import effect as me
from bbtc.model.formula import Formula, conjoin
from bbtc.model.types import Parameter


@dataclass(frozen=True, slots=True)
class Item:
    """For every binding of ``parameters``: the leaf, where ``guard`` (None: always) is true."""

    parameters: tuple[Parameter, ...]
    guard: Formula | None
    leaf: me.Set | me.Add


@dataclass(frozen=True, slots=True)
class Chance:
    """For every binding of ``parameters``, independently: one of the branches. Probabilities are
    positive and sum to 1."""

    parameters: tuple[Parameter, ...]
    branches: tuple[tuple[Fraction, Block], ...]
    oneof: bool


@dataclass(frozen=True, slots=True)
class Block:
    """All items and one branch of each chance, at once."""

    items: tuple[Item, ...] = ()
    chances: tuple[Chance, ...] = ()


def normalise(effect: me.Effect) -> Block:
    """The normal form. Branches of probability 0 are gone, and a chance of one branch is no chance."""
    return _walk(effect, (), None)


def _walk(effect: me.Effect, parameters: tuple[Parameter, ...], guard: Formula | None) -> Block:
    match effect:
        case me.Set() | me.Add():
            return Block((Item(parameters, guard, effect),))
        case me.Together(parts):
            blocks = [_walk(part, parameters, guard) for part in parts]
            return Block(
                tuple(item for block in blocks for item in block.items),
                tuple(chance for block in blocks for chance in block.chances),
            )
        case me.When(condition, inner):
            return _walk(inner, parameters, conjoin(guard, condition))
        case me.ForEach(more, inner):
            return _walk(inner, parameters + more, guard)
        case me.Choice(branches, oneof):
            possible = [branch for branch in branches if branch.probability > 0]
            if len(possible) == 1:
                return _walk(possible[0].effect, parameters, guard)
            # The quantifiers stay outside: every binding is a draw of its own.
            drawn = tuple((branch.probability, _walk(branch.effect, (), guard)) for branch in possible)
            return Block((), (Chance(parameters, drawn, oneof),))
        case _:
            assert_never(effect)
