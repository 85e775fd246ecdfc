"""What a robot works out of its readings where facts are hidden: a table that a tree takes along."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from bbtc.ground.task import Observation
from bbtc.kleene import Truth

FIRST = ""
"""Stands in the place of an action for what the robot is told before its first one."""


@dataclass(frozen=True, slots=True)
class Row:
    """Where ``belief`` was believed, and the seen variables of the move had the values ``before``: what may
    be told (unknown: an observation was not made), with their values ``after``; and what is believed then."""

    belief: int
    before: tuple[Truth, ...]
    told: tuple[Truth, ...]
    after: tuple[Truth, ...]
    then: int


@dataclass(frozen=True, slots=True)
class Move:
    """What an action may tell: ``seen`` are the task's variables behind :attr:`Row.before` and
    :attr:`Row.after`, ``readings`` the observations behind :attr:`Row.told`, by name."""

    action: str
    seen: tuple[int, ...]
    readings: tuple[str, ...]
    rows: tuple[Row, ...]


@dataclass(frozen=True, slots=True)
class Part:
    """The table for one component. ``values`` has for each belief, by number, what is known then of each of
    the task's variables ``known``. It begins with the belief ``start``."""

    known: tuple[int, ...]
    values: tuple[tuple[Truth, ...], ...]
    start: int
    moves: tuple[Move, ...]


@dataclass(frozen=True, slots=True)
class Telling:
    """An observation of an action: its name, and what it tells of the variables of the task that holds what
    is true."""

    action: str
    name: str
    observation: Observation


@dataclass(frozen=True, slots=True)
class Sets:
    """Variables set with a probability."""

    probability: Fraction
    sets: tuple[tuple[int, Truth], ...]


@dataclass(frozen=True, slots=True)
class Turn:
    """A draw of the variable at ``level`` of a walk, and the turns that follow if it is false, or true: -1
    where all that comes later is as likely as not."""

    level: int
    true: Fraction
    if_false: int
    if_true: int


@dataclass(frozen=True, slots=True)
class Walk:
    """Variables that are drawn one after the other, beginning with the last of ``turns``. Those that no turn
    draws are true with probability 1/2."""

    variables: tuple[int, ...]
    turns: tuple[Turn, ...]


@dataclass(frozen=True)
class Monitor:
    """What a robot needs to know what it knows, as far as the runs of a tree lead; and for the worlds that it
    is tried in, what is true at the start, drawn for each of ``priors`` and ``walks``, and what its actions
    tell."""

    parts: tuple[Part, ...]
    priors: tuple[tuple[Sets, ...], ...]
    tellings: tuple[Telling, ...]
    walks: tuple[Walk, ...] = ()

    @cached_property
    def known(self) -> frozenset[int]:
        """The variables that it tells."""
        return frozenset(variable for part in self.parts for variable in part.known)

    @cached_property
    def seen(self) -> frozenset[int]:
        """The variables that it asks for."""
        return frozenset(variable for move in self.moves for variable in move.seen)

    @property
    def moves(self) -> Iterator[Move]:
        """What every action may tell of every component."""
        return (move for part in self.parts for move in part.moves)

    @cached_property
    def drawn(self) -> frozenset[int]:
        """The variables that are drawn at the start."""
        drawn = {variable for prior in self.priors for variable, _ in prior[0].sets}
        return frozenset(drawn.union(*(walk.variables for walk in self.walks)))

    @cached_property
    def readings(self) -> dict[str, tuple[str, ...]]:
        """By action that tells anything, if only that it was done: the names of its observations."""
        found: dict[str, dict[str, None]] = {}
        for move in self.moves:
            found.setdefault(move.action, {}).update(dict.fromkeys(move.readings))
        return {action: tuple(names) for action, names in found.items()}
