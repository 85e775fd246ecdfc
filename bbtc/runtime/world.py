"""The outcome model of a simulated world, copied into the modules that bbtc writes."""

from __future__ import annotations

import argparse
import math
import random
from collections.abc import Callable
from fractions import Fraction
from typing import TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bbtc.runtime.nodes import Fact, in_words, run

State = dict[Fact, bool | None]
T = TypeVar("T")


class When:
    """Changes that happen if a condition is True in the state before the action."""

    def __init__(self, condition: Callable[[State], bool | None], changes: State) -> None:
        self.condition = condition
        self.changes = changes


class Outcome:
    """One thing that may happen, with its probability: changes, and independent choices that
    follow."""

    def __init__(
        self, probability: str, changes: State, *conditional: When, then: list[Factor] | None = None
    ) -> None:
        self.probability = probability
        self.changes = changes
        self.conditional = conditional
        self.then = then or []


Factor = list[Outcome]


def draw(rng: random.Random, choices: list[tuple[str, T]]) -> T:
    """One of the values, with exactly the given probabilities."""
    weights = [Fraction(probability) for probability, _ in choices]
    whole = math.lcm(*(weight.denominator for weight in weights))
    point = rng.randrange(whole)
    for weight, (_, value) in zip(weights, choices, strict=True):
        point -= int(weight * whole)
        if point < 0:
            return value
    return choices[-1][1]


def happen(rng: random.Random, factors: list[Factor], before: State) -> State:
    """What an action changes: one outcome of every factor. All conditions are read before any
    change; where changes clash, True wins over None (unknown), and None over False."""
    changes: State = {}
    strength = {False: 0, None: 1, True: 2}
    for factor in factors:
        outcome = draw(rng, [(outcome.probability, outcome) for outcome in factor])
        drawn = [part.changes for part in outcome.conditional if part.condition(before)]
        for part in [outcome.changes, *drawn, happen(rng, outcome.then, before)]:
            for fact, value in part.items():
                if fact not in changes or strength[value] > strength[changes[fact]]:
                    changes[fact] = value
    return changes


class World:
    """A world that behaves as the domain says, by chance. The outcome of an action applies at
    once; the tree looks at it in the next tick."""

    def __init__(
        self,
        initial: list[tuple[str, State]],
        actions: dict[Fact, list[Factor]],
        rng: random.Random,
        report: Callable[[str], None],
    ) -> None:
        start: State = draw(rng, initial)
        self._state = dict(start)
        self._actions = actions
        self._rng = rng
        self._report = report

    def cancel(self, action: str) -> None:
        """Nothing to do: no action here runs for longer than a tick."""

    def _value(self, *fact: str) -> bool | None:
        return self._state[fact]

    def _act(self, *action: str) -> Status:
        changes = happen(self._rng, self._actions[action], self._state)
        self._state.update(changes)
        words = {True: "true", False: "false", None: "unknown"}
        told = ", ".join(f"{in_words(fact)} {words[value]}" for fact, value in changes.items())
        self._report(f"{in_words(action)}: {told or 'no change'}")
        return Status.SUCCESS


def simulate(make: Callable[[random.Random, Callable[[str], None]], Behaviour]) -> None:
    """Run trees in the simulated world as the command line says; ``make`` makes one."""
    parser = argparse.ArgumentParser(description="Run the tree in a simulated world.")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers (default: 0)")
    parser.add_argument("--runs", type=int, default=1, help="with more than one, count successes")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    if options.runs == 1:
        status = run(make(rng, print))
        print(f"The tree returned {status.value}.")
    else:
        ends = [run(make(rng, lambda _: None)) for _ in range(options.runs)]
        print(f"{ends.count(Status.SUCCESS)} of {options.runs} runs succeeded.")
