"""What a change of hidden facts does in one world, and what the robot is told of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from math import lcm
from typing import NamedTuple, TypeAlias

from bbtc.belief.draws import Delta, Spend, compile_factor, product_of
from bbtc.ground.condition import TRUE, compile_condition
from bbtc.ground.task import ZERO, Change, Component, Observation
from bbtc.kleene import Truth

Told: TypeAlias = tuple[tuple[int, int], ...]
"""What the robot sees of one outcome: seen variables by local number with their new values, and below zero
the numbers of the observations with what they told."""


def local_values(component: Component, world: int, seen: bytes = b"") -> bytes:
    """The local variables of a component in a world: its facts, then the seen variables."""
    bits = (Truth.TRUE if world >> bit & 1 else Truth.FALSE for bit in range(len(component.facts)))
    return bytes(bits) + seen


class Reading(NamedTuple):
    """One thing that the robot may be told by a change: what it sees of the seen variables, by their place in
    :attr:`Change.seen`, where they change; what the observations that were made told, by number; the number
    of what is believed then; the probability, and expected cost and reward."""

    shown: Delta
    told: Delta
    belief: int
    probability: Fraction
    cost: Fraction
    reward: Fraction


class Happening(NamedTuple):
    """One of the things that a change may do in a world: what the robot is shown and told, as in
    :class:`Reading`, the world after, and the probability."""

    shown: Delta
    told: Delta
    world: int
    probability: Fraction


class Part(NamedTuple):
    """One of the things that a change may do in a world: what the robot sees, the world after, the
    probability, and what is added to cost and reward."""

    told: Told
    world: int
    probability: Fraction
    cost: Fraction
    reward: Fraction


class Kernel:
    """What a change does in one world."""

    def __init__(self, component: Component, change: Change, spend: Spend) -> None:
        self.change = change
        self._component = component
        self._drawers = [compile_factor(factor, spend) for factor in change.factors]
        self._observations = [compile_observation(observation) for observation in change.observations]
        self._spend = spend
        self._known: dict[tuple[int, bytes], list[Part]] = {}
        self._only: dict[bytes, dict[int, tuple[Told, int] | None]] = {}
        """By what is seen before, and world: what the robot sees, and the world after, if that is certain."""

    def certain(self, belief: Sequence[tuple[int, int]], seen: bytes) -> dict[Told, dict[int, int]] | None:
        """By what the robot sees, the worlds after with their weights; None where chance, or what is added to
        cost or reward, has a part in it."""
        only = self._only.setdefault(seen, {})
        found: dict[Told, dict[int, int]] = {}
        for world, weight in belief:
            if world not in only:
                parts = self.of(world, seen)
                sure = len(parts) == 1 and not parts[0].cost and not parts[0].reward
                only[world] = (parts[0].told, parts[0].world) if sure else None
            known = only[world]
            if known is None:
                return None
            mass = found.get(known[0])
            if mass is None:
                mass = found[known[0]] = {}
            mass[known[1]] = mass.get(known[1], 0) + weight
        return found

    def drawn(
        self, belief: Sequence[tuple[int, int]], seen: bytes
    ) -> tuple[dict[Told, dict[int, int]], dict[Told, tuple[Fraction, Fraction]], int]:
        """By what the robot sees, the worlds after with their weights, and what is added to cost and reward,
        with the same weights; they are whole in the unit of the last, the common denominator of all
        probabilities, since they are added and divided often."""
        parts = [(weight, part) for world, weight in belief for part in self.of(world, seen)]
        scale = lcm(*{part.probability.denominator for _, part in parts})
        found: dict[Told, dict[int, int]] = {}
        amounts: dict[Told, tuple[Fraction, Fraction]] = {}
        for weight, part in parts:
            mass = found.setdefault(part.told, {})
            added = weight * part.probability.numerator * (scale // part.probability.denominator)
            mass[part.world] = mass.get(part.world, 0) + added
            if part.cost or part.reward:
                cost, reward = amounts.get(part.told, (ZERO, ZERO))
                amounts[part.told] = cost + added * part.cost, reward + added * part.reward
        return found, amounts, scale

    def of(self, world: int, seen: bytes) -> list[Part]:
        """All that it may do in a world."""
        found = self._known.get((world, seen))
        if found is None:
            found = self._known[world, seen] = list(self._work_out(world, seen))
        return found

    def _work_out(self, world: int, seen: bytes) -> Iterator[Part]:
        for part, values in self._effects(world, seen):
            for told, chance in self._told(values):
                yield part._replace(told=(*part.told, *told), probability=part.probability * chance)

    def effects(self, world: int, seen: bytes) -> list[Part]:
        """All that it may do in a world, before anything is observed."""
        return [part for part, _ in self._effects(world, seen)]

    def _effects(self, world: int, seen: bytes) -> Iterator[tuple[Part, bytes]]:
        """Also the local values after it."""
        facts = len(self._component.facts)
        before = local_values(self._component, world, seen)
        for (delta, cost, reward), probability in product_of(before, self._drawers, self._spend).items():
            if not probability:
                continue
            values, after = bytearray(before), world
            for local, value in delta:
                values[local] = value
                if local < facts:
                    after = after | 1 << local if value == Truth.TRUE else after & ~(1 << local)
            # What is set to what it was shows nothing.
            shown = tuple(
                (local, value) for local, value in delta if local >= facts and before[local] != value
            )
            yield Part(shown, after, probability, cost, reward), bytes(values)

    def _told(self, values: bytes) -> list[tuple[Told, Fraction]]:
        """What the observations may tell."""
        found: list[tuple[Told, Fraction]] = [((), Fraction(1))]
        for number, observe in enumerate(self._observations):
            readings = observe(values)
            found = (
                [((*told, (~number, value)), chance * p) for told, chance in found for value, p in readings]
                if readings
                else found
            )
            self._spend(len(found), len(found))
        return found


def compile_observation(observation: Observation) -> Callable[[bytes], list[tuple[int, Fraction]]]:
    """What an observation may tell, with probabilities; nothing where it is not made."""
    truth = compile_condition(observation.condition)
    when = compile_condition(TRUE if observation.when is None else observation.when)

    def readings(values: bytes) -> list[tuple[int, Fraction]]:
        if when(values) != Truth.TRUE:
            return []
        true = truth(values) == Truth.TRUE
        right = observation.right(true)
        both = [(int(true), right), (int(not true), 1 - right)]
        return [(value, p) for value, p in both if p]

    return readings
