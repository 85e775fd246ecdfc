"""The beliefs of a component with too many worlds to be listed, as decision diagrams.

What an action does reads and sets few of the facts: each case of these is worked out as in one world, and the
diagram of the other facts goes with it. What is told divides a diagram by that of what it tells of.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import lcm
from typing import NamedTuple

from bbtc.belief.draws import Delta, Spend
from bbtc.belief.worlds.beliefs import Beliefs, Update
from bbtc.belief.worlds.kernel import Kernel, Part, Told
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.diagrams import NOTHING, TooManyNodes, Weighted
from bbtc.ground.condition import (
    TRUE,
    Condition,
    Constant,
    Is,
    Known,
    compile_condition,
    is_test,
    replaced,
    variables,
)
from bbtc.ground.condition_diagram import MOST_NODES_OF_BELIEFS, diagrams_of
from bbtc.ground.hidden.parts import facts_of
from bbtc.ground.task import ZERO, Knowledge
from bbtc.kleene import Truth


class _Piece(NamedTuple):
    """What the robot is told, and what is added to cost and reward, in some worlds."""

    told: Told
    cost: Fraction
    reward: Fraction


@dataclass
class DiagramBeliefs(Beliefs):
    """Beliefs as nodes of diagrams."""

    _nodes: list[int] = field(default_factory=list, init=False)
    _numbers: dict[int, int] = field(default_factory=dict, init=False)
    _conditions: dict[tuple[Condition, bytes], Condition] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self._of = diagrams_of(self.component)
        self._diagrams = self._of.diagrams

    @property
    def prior(self) -> int:
        """The number of what is believed before anything is told."""
        return self._number(self._of.prior)

    def _number(self, node: int) -> int:
        found = self._numbers.get(node)
        if found is None:
            found = self._numbers[node] = len(self._nodes)
            self._nodes.append(node)
            self._known.append(tuple(self._known_in(node)))
        return found

    def _known_in(self, node: int) -> Iterator[tuple[int, int]]:
        sure = self._diagrams.sure(node)
        for each in self.component.known:
            match each.condition:
                case Is(place, Truth.TRUE) if each.at_least == 1:
                    true, false = (places >> place & 1 for places in sure)
                    yield each.variable, int(Truth.TRUE if true else Truth.FALSE if false else Truth.UNKNOWN)
                case condition:
                    weight, total = self._of.share(node, condition)
                    yield each.variable, int(each.value(weight, total))

    def _chance(self, number: int, condition: Condition) -> Fraction:
        return Fraction(*self._of.share(self._nodes[number], condition))

    def joint(self, number: int, known: Sequence[Knowledge]) -> dict[Delta, Fraction]:
        """The values that some conditions have in the world, and how probable they are in a belief."""
        whole = Weighted(1, self._nodes[number])
        parts: list[tuple[Delta, Weighted]] = [((), whole)]
        for each in known:
            true = self._of.node(each.condition)
            both = (Truth.TRUE, true), (Truth.FALSE, self._diagrams.complement(true))
            parts = [
                ((*delta, (each.variable, int(value))), self._diagrams.times(part, node))
                for delta, part in parts
                if part.weight
                for value, node in both
            ]
        total = self._diagrams.total(whole)
        return {delta: Fraction(self._diagrams.total(part), total) for delta, part in parts if part.weight}

    def pick(self, number: int, point: Fraction) -> int:
        """The world at a point of a row."""
        return self._diagrams.pick(self._nodes[number], point)

    def updates(self, kernel: Kernel, number: int, seen: bytes, spend: Spend) -> Iterator[Update]:
        """What the robot may be told by a change."""
        try:
            yield from self._updates(kernel, number, seen, spend)
        except TooManyNodes:
            message = (
                f"what is known of {self.component.facts[0]} and the facts that depend on it takes more than "
                f"{MOST_NODES_OF_BELIEFS:,} nodes of decision diagrams"
            )
            hint = "a domain in which fewer facts depend on each other may be planned for"
            raise LimitReached([Diagnostic("BBT0007", message, hint=hint)]) from None

    def _updates(self, kernel: Kernel, number: int, seen: bytes, spend: Spend) -> Iterator[Update]:
        whole = Weighted(1, self._nodes[number])
        pieces, scale = self._moved(kernel, whole, seen, spend)
        for at in range(len(kernel.change.observations)):
            pieces, more = self._told(kernel, at, pieces, seen)
            scale *= more
            spend(len(pieces), len(pieces))
        by_told: dict[Told, list[tuple[_Piece, Weighted]]] = {}
        for piece, mass in pieces.items():
            by_told.setdefault(piece.told, []).append((piece, mass))
        total = scale * self._diagrams.total(whole)
        for told, parts in by_told.items():
            mass = NOTHING
            cost = reward = ZERO
            for piece, part in parts:
                mass = self._diagrams.sum(mass, part)
                weight = self._diagrams.total(part)
                cost += weight * piece.cost
                reward += weight * piece.reward
            found = self._diagrams.total(mass)
            yield Update(told, self._number(mass.node), Fraction(found, total), cost / found, reward / found)

    def _moved(
        self, kernel: Kernel, whole: Weighted, seen: bytes, spend: Spend
    ) -> tuple[dict[_Piece, Weighted], int]:
        """What the effects lead to, and the factor of all weights."""
        if not kernel.change.factors:
            return {_Piece((), ZERO, ZERO): whole}, 1
        facts = len(self.component.facts)
        read = [at for at in set().union(*map(facts_of, kernel.change.factors)) if at < facts]
        cases: list[tuple[Weighted, list[Part]]] = []
        for bits, left in self._diagrams.cases(whole, read):
            spend(1, len(cases))
            cases.append((left, kernel.effects(bits, seen)))
        scale = lcm(*{part.probability.denominator for _, parts in cases for part in parts})
        pieces: dict[_Piece, Weighted] = {}
        for left, parts in cases:
            for part in parts:
                cube = self._diagrams.cube((at, bool(part.world >> at & 1)) for at in read)
                mass = self._diagrams.times(left, cube)
                weight = mass.weight * part.probability.numerator * (scale // part.probability.denominator)
                piece = _Piece(part.told, part.cost, part.reward)
                pieces[piece] = self._diagrams.sum(pieces.get(piece, NOTHING), Weighted(weight, mass.node))
            spend(len(parts), len(pieces))
        return pieces, scale

    def _told(
        self, kernel: Kernel, at: int, pieces: dict[_Piece, Weighted], seen: bytes
    ) -> tuple[dict[_Piece, Weighted], int]:
        """What an observation tells of each piece, and the factor of all weights."""
        observation, diagrams = kernel.change.observations[at], self._diagrams
        scale = lcm(*(observation.right(true).denominator for true in (True, False)))
        right = [int(observation.right(true) * scale) for true in (False, True)]
        found: dict[_Piece, Weighted] = {}

        def add(piece: _Piece, told: Told, factor: int, mass: Weighted) -> None:
            if factor and mass.weight:
                key = piece._replace(told=(*piece.told, *told))
                found[key] = diagrams.sum(found.get(key, NOTHING), Weighted(factor * mass.weight, mass.node))

        for piece, mass in pieces.items():
            after = self._seen_after(piece.told, seen)
            made = self._of.node(self._settled(observation.when or TRUE, after))
            true = self._of.node(self._settled(observation.condition, after))
            add(piece, (), scale, diagrams.times(mass, diagrams.complement(made)))
            asked = diagrams.times(mass, made)
            if asked.weight:
                for value, node in ((1, true), (0, diagrams.complement(true))):
                    part = diagrams.times(asked, node)
                    add(piece, ((~at, value),), right[value], part)
                    add(piece, ((~at, 1 - value),), scale - right[value], part)
        return found, scale

    def _seen_after(self, told: Told, seen: bytes) -> bytes:
        after = bytearray(seen)
        for local, value in told:
            if local >= 0:
                after[local - len(self.component.facts)] = value
        return bytes(after)

    def _settled(self, condition: Condition, seen: bytes) -> Condition:
        """A condition on facts alone, for these values of what is seen."""
        facts = len(self.component.facts)
        if all(variable < facts for variable in variables(condition)):
            return condition
        found = self._conditions.get((condition, seen))
        if found is None:

            def leaf(read: Is | Known) -> Condition:
                if read.variable < facts and not is_test(read):
                    return read
                value = seen[read.variable - facts]
                moved = replace(read, variable=0)
                return Constant(compile_condition(moved)(bytes([value])) == Truth.TRUE)

            found = self._conditions[condition, seen] = replaced(condition, leaf)
        return found
