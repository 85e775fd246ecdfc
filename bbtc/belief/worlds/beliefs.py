"""The beliefs of a component of hidden facts that were met, by number: lists of worlds with weights."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, lcm
from typing import NamedTuple, TypeAlias

from bbtc.belief.draws import Delta, Draw, Spend
from bbtc.belief.worlds.kernel import Kernel, Told, local_values
from bbtc.ground.condition import Condition, compile_condition
from bbtc.ground.task import ONE, ZERO, Change, Component, Knowledge
from bbtc.kleene import Truth
from bbtc.markov import distribution

Belief: TypeAlias = tuple[tuple[int, int], ...]
"""Worlds still possible, in order, with weights: positive integers without a common divisor."""

_Draws: TypeAlias = dict[tuple[int, bytes], dict[Draw, Fraction]]


class Update(NamedTuple):
    """One thing that the robot may be told by a change, the number of what is believed then, the probability,
    and expected cost and reward."""

    told: Told
    belief: int
    probability: Fraction
    cost: Fraction
    reward: Fraction


@dataclass
class Beliefs(ABC):
    """The beliefs of a component that were met, by number, and what is known in each."""

    component: Component
    _known: list[Delta] = field(default_factory=list, init=False)
    _chances: dict[tuple[int, Condition], Fraction] = field(default_factory=dict, init=False)
    _draws: dict[tuple[int, int], tuple[Change, _Draws]] = field(default_factory=dict, init=False)

    def __getstate__(self) -> dict[str, object]:
        """What comes of changes stays in this process, as these are known by where they are."""
        return {**self.__dict__, "_draws": {}}

    def draws_of(self, change: Change, first: int) -> _Draws:
        """What was found to come of a change, by what decides over it, in tasks that have the number of what
        is believed at ``first``: whoever compiles the change adds to it."""
        known = self._draws.get((id(change), first))
        if known is None or known[0] is not change:
            known = self._draws[id(change), first] = change, {}
        return known[1]

    def known(self, number: int) -> Delta:
        """The task's variables that tell what is known, and their values in a belief."""
        return self._known[number]

    def chance(self, number: int, condition: Condition) -> Fraction:
        """How probable a condition over the facts is in a belief."""
        found = self._chances.get((number, condition))
        if found is None:
            found = self._chances[number, condition] = self._chance(number, condition)
        return found

    def believed(self, number: int, knowledge: Knowledge) -> Truth:
        """What is believed of something in a belief."""
        chance = self.chance(number, knowledge.condition)
        return knowledge.value(chance.numerator, chance.denominator)

    @property
    @abstractmethod
    def prior(self) -> int:
        """The number of what is believed before anything is told."""

    @abstractmethod
    def _chance(self, number: int, condition: Condition) -> Fraction: ...

    @abstractmethod
    def joint(self, number: int, known: Sequence[Knowledge]) -> dict[Delta, Fraction]:
        """The values that some conditions have in the world, and how probable they are in a belief."""

    @abstractmethod
    def pick(self, number: int, point: Fraction) -> int:
        """The world at a point from 0 to below 1, where those of a belief stand in a row, each as long as it
        is likely."""

    @abstractmethod
    def updates(self, kernel: Kernel, number: int, seen: bytes, spend: Spend) -> Iterator[Update]:
        """What the robot may be told by a change where this was believed, and the seen variables had these
        values."""


@dataclass
class ListedBeliefs(Beliefs):
    """Beliefs as lists of worlds."""

    by_number: list[Belief] = field(default_factory=list, init=False)
    _numbers: dict[Belief, int] = field(default_factory=dict, init=False)
    _true: dict[int, tuple[int, ...]] = field(default_factory=dict, init=False)
    """By world: which of the conditions of :attr:`Component.known` are true."""

    @property
    def prior(self) -> int:
        """The number of what is believed before anything is told."""
        prior = self.component.prior
        scale = lcm(*(probability.denominator for _, probability in prior))
        return self.number({world: int(probability * scale) for world, probability in prior})

    def number(self, weights: Mapping[int, int]) -> int:
        """The number of the belief with these weights of worlds, none of them 0."""
        common = gcd(*weights.values())
        if common > 1:
            weights = {world: weight // common for world, weight in weights.items()}
        belief = tuple(sorted(weights.items()))
        found = self._numbers.get(belief)
        if found is None:
            found = self._numbers[belief] = len(self.by_number)
            self.by_number.append(belief)
            self._known.append(self._known_in(belief))
        return found

    def _known_in(self, belief: Belief) -> Delta:
        true = [0] * len(self.component.known)
        for world, weight in belief:
            for at in self._true_in(world):
                true[at] += weight
        total = sum(weight for _, weight in belief)
        return tuple(
            (knowledge.variable, int(knowledge.value(weight, total)))
            for knowledge, weight in zip(self.component.known, true, strict=True)
        )

    def _true_in(self, world: int) -> tuple[int, ...]:
        found = self._true.get(world)
        if found is None:
            local = local_values(self.component, world)
            values = (compile_condition(knowledge.condition)(local) for knowledge in self.component.known)
            found = tuple(at for at, value in enumerate(values) if value == Truth.TRUE)
            self._true[world] = found
        return found

    def _chance(self, number: int, condition: Condition) -> Fraction:
        belief, holds = self.by_number[number], compile_condition(condition)
        true = sum(w for world, w in belief if holds(local_values(self.component, world)) == Truth.TRUE)
        return Fraction(true, sum(weight for _, weight in belief))

    def joint(self, number: int, known: Sequence[Knowledge]) -> dict[Delta, Fraction]:
        """The values that some conditions have in the world, and how probable they are in a belief."""
        belief = self.by_number[number]
        total = sum(weight for _, weight in belief)
        tests = [(each.variable, compile_condition(each.condition)) for each in known]

        def truths(world: int) -> Delta:
            local = local_values(self.component, world)
            return tuple((variable, test(local)) for variable, test in tests)

        return distribution((truths(world), Fraction(weight, total)) for world, weight in belief)

    def pick(self, number: int, point: Fraction) -> int:
        """The world at a point of a row."""
        belief = self.by_number[number]
        point *= sum(weight for _, weight in belief)
        for world, weight in belief:
            point -= weight
            if point < 0:
                return world
        return belief[-1][0]

    def updates(self, kernel: Kernel, number: int, seen: bytes, spend: Spend) -> Iterator[Update]:
        """What the robot may be told by a change."""
        belief = self.by_number[number]
        by_told = kernel.certain(belief, seen)
        amounts: dict[Told, tuple[Fraction, Fraction]] = {}
        scale = 1
        if by_told is None:
            by_told, amounts, scale = kernel.drawn(belief, seen)
        total = scale * sum(weight for _, weight in belief)
        spend(len(belief), len(by_told))
        for told, mass in by_told.items():
            whole = sum(mass.values())
            cost, reward = amounts.get(told, (ZERO, ZERO))
            yield Update(
                told,
                self.number(mass),
                ONE if whole == total else Fraction(whole, total),
                cost / whole if cost else ZERO,
                reward / whole if reward else ZERO,
            )
