"""From a multi-policy to a decision list, a short list of rules: "if these literals hold, do this action".

Rules are tried in order. They are found greedily, the one that decides most states for its size
first (separate and conquer: Fürnkranz 1999); after each, states that no run visits any more are
forgotten, so later rules need to tell fewer states apart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from bbtc.ground.condition import Condition, Is, Known, leaves, numbers_read, within
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.transitions import Index
from bbtc.planner.synthesis.permissive import MultiPolicy


class Test(IntEnum):
    """What a literal tests of its variable; each is two-valued."""

    TRUE = 0
    FALSE = 1
    UNKNOWN = 2
    KNOWN = 3
    AT_LEAST = 4
    BELOW = 5


OPPOSITE = {
    Test.TRUE: Test.FALSE,
    Test.FALSE: Test.TRUE,
    Test.UNKNOWN: Test.KNOWN,
    Test.KNOWN: Test.UNKNOWN,
    Test.AT_LEAST: Test.BELOW,
    Test.BELOW: Test.AT_LEAST,
}
_MOST_CUTS = 1_024
"""Values of one number between which is told apart; where more are visited, so many of them."""


@dataclass(frozen=True, slots=True, order=True)
class Literal:
    """A two-valued test of one variable; or of a number, by its digits, the first of which is the variable:
    is it at least ``bound``, or below that?"""

    variable: int
    test: Test
    digits: tuple[int, ...] = ()
    bound: int = 0

    @property
    def condition(self) -> Condition:
        """As a condition; for true and false it is unknown where the variable is."""
        match self.test:
            case Test.TRUE:
                return Is(self.variable, Truth.TRUE)
            case Test.FALSE:
                return Is(self.variable, Truth.FALSE)
            case Test.UNKNOWN:
                return Is(self.variable, Truth.UNKNOWN)
            case Test.KNOWN:
                return Known(self.variable)
            case Test.AT_LEAST:
                return within(self.digits, self.bound, 1 << len(self.digits))
            case Test.BELOW:
                return within(self.digits, 0, self.bound - 1)

    @property
    def opposite(self) -> Literal:
        """What holds where it does not."""
        return replace(self, test=OPPOSITE[self.test])

    def holds(self, values: npt.NDArray[np.uint8]) -> Flags:
        """In which rows of values it holds."""
        if self.digits:
            at_least: Flags = numbers_of(values, self.digits) >= self.bound
            return at_least if self.test is Test.AT_LEAST else ~at_least
        column = values[:, self.variable]
        match self.test:
            case Test.TRUE:
                found: Flags = column == Truth.TRUE
            case Test.FALSE:
                found = column == Truth.FALSE
            case Test.UNKNOWN:
                found = column == Truth.UNKNOWN
            case _:
                found = column != Truth.UNKNOWN
        return found


def numbers_of(values: npt.NDArray[np.uint8], digits: Sequence[int]) -> npt.NDArray[np.int64]:
    """What the digits of a number say in each row of values."""
    found = np.zeros(len(values), dtype=np.int64)
    for place, digit in enumerate(digits):
        found += (values[:, digit] >> 1).astype(np.int64) << place
    return found


@dataclass(frozen=True, slots=True)
class Rule:
    """Do ``action`` (its number in the task) where all of ``tests`` hold. ``asked`` are the states
    (local numbers) in which the rule is looked at and none before it applied."""

    tests: tuple[Literal, ...]
    action: int
    asked: Index


class Learner:
    """Finds rules for a multi-policy."""

    def __init__(self, task: Task, policy: MultiPolicy, limits: Limits) -> None:
        self.task, self.policy, self.limits = task, policy, limits
        self.literals = literals_of(task, policy.values)
        columns = [literal.holds(policy.values) for literal in self.literals]
        self.holds = np.array(columns, dtype=np.bool_).T.reshape(len(policy.goal), len(self.literals))
        self.taken = np.ones(len(policy.choice_action), dtype=np.bool_)
        self.stated = Stated(task, self.literals)

    def relevant(self) -> Flags:
        """The states that runs may still visit."""
        found = np.zeros(len(self.policy.goal), dtype=np.bool_)
        found[self.policy.closure(self.policy.initial, self.taken)] = True
        return found

    def learn(self, group: Flags, avoid: Flags, *, fall_through: bool = False) -> list[Rule]:
        """Rules that decide every state of ``group`` that has choices, and apply in none of
        ``avoid`` (nor in a state of the group without choices). Choices that the rules do not take
        are dropped from :attr:`taken`. With ``fall_through`` each rule is asked anywhere, since the actions
        of those before it may be refused."""
        rules: list[Rule] = []
        decided = np.zeros(len(self.policy.goal), dtype=np.bool_)
        active = self.policy.having()
        while True:
            self.limits.check_time("the search for a small tree")
            relevant = self.relevant()
            waiting = np.flatnonzero(relevant & group & active & ~decided)
            if not len(waiting):
                return rules
            against = np.flatnonzero(relevant & ~decided & ((group & ~active & ~self.policy.idle) | avoid))
            tests, action, covered = self._best_rule(waiting, against)
            asked = np.flatnonzero(relevant & ~self.policy.goal) if fall_through else None
            rules.append(Rule(tests, action, np.concatenate([waiting, against]) if asked is None else asked))
            decided[covered] = True
            ours = np.zeros(len(decided), dtype=np.bool_)
            ours[covered] = True
            self.taken &= ~ours[self.policy.choice_state] | (self.policy.choice_action == action)

    def _best_rule(self, waiting: Index, against: Index) -> tuple[tuple[Literal, ...], int, Index]:
        """The rule that decides most of the waiting states for its size."""
        in_waiting = np.zeros(len(self.policy.goal), dtype=np.bool_)
        in_waiting[waiting] = True
        choices = np.flatnonzero(self.taken & in_waiting[self.policy.choice_state])
        actions = np.unique(self.policy.choice_action[choices])
        best: tuple[tuple[float, int], tuple[int, ...], int, Index] | None = None
        for action in actions.tolist():
            able = np.zeros(len(self.policy.goal), dtype=np.bool_)
            able[self.policy.choice_state[choices[self.policy.choice_action[choices] == action]]] = True
            wanted, others = waiting[able[waiting]], np.concatenate([waiting[~able[waiting]], against])
            # At best it decides all of them: with one test, or without any if there is nothing to tell apart.
            at_best = (-len(wanted) / 3, 1) if len(others) else (-float(len(wanted)), 0)
            if best is not None and best[0] <= at_best:
                continue
            columns, covered = self._grow(action, wanted, others)
            key = (-len(covered) / rule_size(columns), len(columns))
            if best is None or key < best[0]:
                best = key, columns, action, covered
        assert best is not None
        _, columns, action, covered = best
        return tuple(self.literals[column] for column in columns), action, covered

    def _grow(self, action: int, wanted: Index, others: Index) -> tuple[tuple[int, ...], Index]:
        """A conjunction that holds in some of the wanted states and in none of the others."""
        chosen = separating(self.holds[wanted], self.holds[others], self.stated.by(action))
        covered = wanted[self.holds[wanted][:, chosen].all(axis=1)]
        return tuple(chosen), covered


class Stated:
    """Which literals the actions' preconditions state: they read best."""

    def __init__(self, task: Task, literals: Sequence[Literal]) -> None:
        self.task, self.literals = task, literals
        self._known: dict[int, npt.NDArray[np.float64]] = {}

    def by(self, action: int) -> npt.NDArray[np.float64]:
        """For each literal 1 if an action's precondition states it, else 0."""
        if action not in self._known:
            own = frozenset(_stated(self.task.actions[action].precondition))
            self._known[action] = np.array([float(literal in own) for literal in self.literals])
        return self._known[action]


def rule_size(tests: Sequence[int]) -> int:
    """The nodes of a rule with so many tests."""
    return len(tests) + 2 if tests else 1


def separating(wanted: Flags, others: Flags, own: npt.NDArray[np.float64]) -> list[int]:
    """Literals (columns) that all hold in some of the wanted states (rows), and in none of the others. Of
    literals that do as well, one with the greater ``own`` is taken."""
    inside, outside = wanted, others
    chosen: list[int] = []
    while len(outside):
        hits, misses = inside.sum(axis=0), outside.sum(axis=0)
        useful = (hits > 0) & (misses < len(outside))
        if not useful.any():
            break  # what is believed differs, and nothing that can be read tells it
        share = np.log2(np.maximum(hits, 1) / np.maximum(hits + misses, 1))
        gain = hits * (share - np.log2(len(inside) / (len(inside) + len(outside))))
        gain = np.where(useful, gain + own * 1e-6, -np.inf)
        column = int(np.argmax(gain))
        chosen.append(column)
        inside, outside = inside[inside[:, column]], outside[outside[:, column]]
    # Drop tests that later ones made needless, the first chosen first.
    for column in list(chosen):
        rest = [c for c in chosen if c != column]
        if not others[:, rest].all(axis=1).any():
            chosen = rest
    return chosen


def literals_of(task: Task, values: npt.NDArray[np.uint8]) -> list[Literal]:
    """The literals that tell some of the states apart, one of each set that hold alike."""
    found: dict[bytes, Literal] = {}

    def add(literal: Literal) -> None:
        holds = literal.holds(values)
        if holds.any() and not holds.all():
            found.setdefault(holds.tobytes(), literal)

    for variable in range(values.shape[1]):
        if task.variables[variable].digit is not None:
            continue
        present = set(values[:, variable].tolist())
        tests = [Test.TRUE, Test.FALSE]
        if Truth.UNKNOWN in present:
            tests += [Test.UNKNOWN, Test.KNOWN]
        for test in tests:
            add(Literal(variable, test))
    for literal in cuts_of(task, values):
        add(literal)
        add(literal.opposite)
    return sorted(found.values())


def cuts_of(task: Task, values: npt.NDArray[np.uint8]) -> Iterator[Literal]:
    """For each number, tests between the values that it has in some states: where preconditions or the goal
    ask for a bound between two of them, that one. Of very many values, so many are told apart by these tests;
    then tests of single digits tell the others apart."""
    stated: dict[tuple[int, ...], set[int]] = {}
    for condition in (task.goal, *(action.precondition for action in task.actions)) if task.numbers else ():
        for read in numbers_read(condition):
            stated.setdefault(read.digits, set()).update((read.low, read.high + 1))
    for number in task.numbers:
        present = np.unique(numbers_of(values, number.digits)).tolist()
        if len(present) > _MOST_CUTS:
            present = present[:: -(-len(present) // _MOST_CUTS)]
            for digit in number.digits:
                yield Literal(digit, Test.TRUE)
        bounds = sorted(stated.get(number.digits, ()))
        for below, value in pairwise(present):
            between = next((bound for bound in bounds if below < bound <= value), value)
            yield Literal(number.digits[0], Test.AT_LEAST, number.digits, between)


def _stated(condition: Condition) -> list[Literal]:
    tests = {Truth.TRUE: Test.TRUE, Truth.FALSE: Test.FALSE, Truth.UNKNOWN: Test.UNKNOWN}
    found = [
        Literal(leaf.variable, tests[leaf.value] if isinstance(leaf, Is) else Test.KNOWN)
        for leaf in leaves(condition)
    ]
    for read in numbers_read(condition):
        if read.low:
            found.append(Literal(read.digits[0], Test.AT_LEAST, read.digits, read.low))
        if read.high < read.most:
            found.append(Literal(read.digits[0], Test.BELOW, read.digits, read.high + 1))
    return found
