"""The states of a program, one by one, and what can happen in each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, TypeAlias

from typing_extensions import assert_never

from bbtc.limits import Limits
from bbtc.verifier.program import (
    AllOf,
    AnyOf,
    Branch,
    Choose,
    Command,
    Compare,
    Count,
    Expression,
    Increment,
    Literally,
    Negation,
    Program,
    Use,
)

State: TypeAlias = tuple[int, ...]
"""The value of every cell."""


class Step(NamedTuple):
    """A possible successor of a state: its number, the probability, and the rewards on the way."""

    successor: int
    probability: Fraction
    rewards: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True)
class Space:
    """What a program can do. ``choices[s]`` are the commands enabled in state s, each with the steps
    it makes; where a command leaves all as it is, there are no steps. ``labels`` hold, by name, the
    states they name. State 0 is the initial one."""

    choices: tuple[tuple[tuple[Command, tuple[Step, ...]], ...], ...]
    labels: dict[str, frozenset[int]]


def explore(program: Program, limits: Limits) -> Space:
    """Every state that can be reached. Raises ``LimitReached`` past the limits on states and time.

    In a Markov chain exactly one command must be enabled in every state, and every value must be in
    its range; anything else is a bug here and raises ``AssertionError``.
    """
    reader = _Reader(program)
    guards = [(reader.compile(command.guard), command) for command in program.commands]
    labels = [(name, reader.compile(expression)) for name, expression in program.labels]
    branches = [[_compile(reader, branch) for branch in command.branches] for command in program.commands]
    initial = tuple(cell.initial for cell in program.cells)
    highest = [cell.highest for cell in program.cells]
    states, number = [initial], {initial: 0}
    named: dict[str, list[int]] = {name: [] for name, _ in labels}
    choices = []
    for index, state in enumerate(states):  # grows while it is read: breadth first
        limits.check_states(len(states), "the recomputation")
        reader.look_at(state)
        enabled = []
        for (guard, command), compiled in zip(guards, branches, strict=True):
            if not guard(state):
                continue
            steps = []
            for branch, after_of, rewards_of in compiled:
                after = after_of(state)
                assert all(map(int.__le__, after, highest)), "a value is out of its range"
                successor = number.setdefault(after, len(states))
                if successor == len(states):
                    states.append(after)
                steps.append(Step(successor, branch.probability, rewards_of(state)))
            stays = all(step.successor == index for step in steps) and command.action is None
            enabled.append((command, () if stays else tuple(steps)))
        assert program.kind == "mdp" or len(enabled) == 1, f"{len(enabled)} commands are enabled"
        choices.append(tuple(enabled))
        for name, holds in labels:
            if holds(state):
                named[name].append(index)
    return Space(tuple(choices), {name: frozenset(found) for name, found in named.items()})


_Test: TypeAlias = Callable[[State], bool]
_Rewards: TypeAlias = tuple[Fraction, ...]


def _compile(
    reader: _Reader, branch: Branch
) -> tuple[Branch, Callable[[State], State], Callable[[State], _Rewards]]:
    choosers: list[tuple[int, list[tuple[_Test, int]]]] = []
    counters: list[int] = []
    counts: list[tuple[Count, list[tuple[_Test, bool, int]]]] = []
    for update in branch.updates:
        match update:
            case Choose(cell, cases):
                choosers.append((cell, [(reader.compile(condition), value) for condition, value in cases]))
            case Increment(cell):
                counters.append(cell)
            case Count(_, _, count_cases):
                compiled = [(reader.compile(when), kind == "add", n) for when, kind, n in count_cases]
                counts.append((update, compiled))
            case _:
                assert_never(update)

    def after(state: State) -> State:
        cells = list(state)
        for cell, cases in choosers:
            for condition, value in cases:
                if condition(state):
                    cells[cell] = value
                    break
        for cell in counters:
            cells[cell] = state[cell] + 1
        for update, compiled in counts:
            for condition, adds, amount in compiled:
                if condition(state):
                    cells[update.cell] = update.assigned((state[update.source] if adds else 0) + amount)
                    break
        return tuple(cells)

    return branch, after, _compile_rewards(reader, branch)


def _compile_rewards(reader: _Reader, branch: Branch) -> Callable[[State], _Rewards]:
    if not branch.charges:
        return lambda _: branch.rewards
    charges = [(reader.compile(charge.when), charge.rewards) for charge in branch.charges]

    def rewards(state: State) -> _Rewards:
        due = [added for holds, added in charges if holds(state)]
        return tuple(sum(amounts, Fraction(0)) for amounts in zip(branch.rewards, *due, strict=True))

    return rewards


class _Reader:
    """Compiles expressions; a formula is computed once for each state looked at."""

    def __init__(self, program: Program) -> None:
        self._values: list[bool | None] = []
        self._formulas: list[_Test] = []
        for formula in program.formulas:
            self._formulas.append(self.compile(formula.expression))
        self._blank: list[bool | None] = [None] * len(self._formulas)

    def look_at(self, state: State) -> None:
        """From now on this is the state: forget what the formulas are."""
        del state
        self._values[:] = self._blank

    def compile(self, expression: Expression) -> _Test:
        """The expression as a function of the state looked at."""
        match expression:
            case Compare(cell, "=", value):
                return lambda state: state[cell] == value
            case Compare(cell, _, value):
                return lambda state: state[cell] < value
            case AllOf(parts):
                every = [self.compile(part) for part in parts]
                return lambda state: all(test(state) for test in every)
            case AnyOf(parts):
                some = [self.compile(part) for part in parts]
                return lambda state: any(test(state) for test in some)
            case Negation(part):
                inner = self.compile(part)
                return lambda state: not inner(state)
            case Literally(value):
                return lambda _: value
            case Use(formula):
                return self._use(formula)
            case _:
                assert_never(expression)

    def _use(self, formula: int) -> _Test:
        values, test = self._values, self._formulas[formula]

        def value(state: State) -> bool:
            known = values[formula]
            if known is None:
                known = values[formula] = test(state)
            return known

        return value
