"""Lists of rules, of which the first that applies decides, and how they get shorter.

Rules that were learnt one by one decide well all together, but each was learnt without those after it. What
these made needless is taken out, as in reduced error pruning (Fürnkranz and Widmer, "Incremental reduced
error pruning", 1994), only that nothing may get worse here:

1. rules, the last first, and then the tests of the others, one after another, until each is needed;
2. the second of two rules of one action, which is put together with the first, in either place;
3. the order: rules that come nearer to the goal stand first, wherever no state tells neighbours apart.

In each step all states are decided anew. Wherever there is hope, a rule has to apply, and its action must be
one that may be taken: one of the best where runs come by then. From everywhere some way has to lead to the
goal, and where runs end since there is no hope, no rule may apply.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bbtc.diagnostics import LimitReached
from bbtc.limits import Limits
from bbtc.planner.mdp.graph import Floats, Graph
from bbtc.planner.mdp.packing import Flags

_DIGITS = 9
"""Costs that differ by less are equal."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Start ``action`` (its number in the task) where its precondition and all tests of one of ``ways`` hold;
    tests are numbers of literals."""

    ways: tuple[tuple[int, ...], ...]
    action: int


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What decides whether rules will do: where literals hold (a row for each state), where the precondition
    of an action is not false, where there is hope, where rules are asked, and which choices may be taken
    where runs come by (``best``) and elsewhere (``near``). ``costs`` is the least expected cost of each
    state."""

    graph: Graph
    holds: Flags
    may_start: Callable[[int], Flags]
    hopeful: Flags
    asked: Flags
    best: Flags
    near: Flags
    costs: Floats

    def applies(self, rule: Rule) -> Flags:
        """Where a rule has its action started, if it is asked."""
        found = np.zeros(len(self.hopeful), dtype=np.bool_)
        for tests in rule.ways:
            found |= self.holds[:, tests].all(axis=1)
        found &= self.may_start(rule.action)
        return found


def shortened(setting: Setting, rules: Sequence[Rule], limits: Limits) -> list[Rule]:
    """The rules, made shorter until a limit says stop."""
    work = _Work(setting, list(rules), [setting.applies(rule) for rule in rules], limits)
    if work.will_do(work.rules, work.where):
        try:
            while work.dropped() or work.merged():
                pass
        except LimitReached:
            pass  # what was done before stays
    return work.rules


def nearest_first(setting: Setting, rules: Sequence[Rule]) -> list[Rule]:
    """The rules that come nearer to the goal first, where their order decides nothing: by the least cost of
    the states that they decide."""
    left = setting.hopeful.copy()
    found = []
    for rule in rules:
        applies = setting.applies(rule) & setting.hopeful
        own = applies & left
        nearest = round(float(setting.costs[own].min(initial=np.inf)), _DIGITS)
        found.append((nearest, applies, rule))
        left &= ~applies
    for end in range(1, len(found)):
        at = end
        while at and found[at][0] < found[at - 1][0] and not _told_apart(found, at):
            found[at - 1], found[at] = found[at], found[at - 1]
            at -= 1
    return [rule for *_, rule in found]


def _told_apart(found: Sequence[tuple[float, Flags, Rule]], at: int) -> bool:
    """Is there a state that a rule and the one before it would decide differently?"""
    both = found[at - 1][1] & found[at][1]
    for _, applies, _ in found[: at - 1]:
        if not both.any():
            return False
        both = both & ~applies
    return bool(both.any())


@dataclass(slots=True)
class _Work:
    """Rules that will do, and where each applies."""

    setting: Setting
    rules: list[Rule]
    where: list[Flags]
    limits: Limits

    def dropped(self) -> bool:
        """Drop rules and tests; were there any to drop?"""
        before = len(self.rules), self._tests()
        for at in reversed(range(len(self.rules))):
            self._try(at, at + 1, [])
        for at in range(len(self.rules)):
            for number, tests in enumerate(self.rules[at].ways):
                for test in tests:
                    ways = list(self.rules[at].ways)
                    ways[number] = tuple(each for each in ways[number] if each != test)
                    self._try(at, at + 1, [replace(self.rules[at], ways=tuple(ways))])
        return before != (len(self.rules), self._tests())

    def merged(self) -> bool:
        """Put two rules of one action together; were there any?"""
        for at, rule in enumerate(self.rules):
            for later in range(at + 1, len(self.rules)):
                if self.rules[later].action == rule.action:
                    between = self.rules[at + 1 : later]
                    both = replace(rule, ways=rule.ways + self.rules[later].ways)
                    if self._try(at, later + 1, [both, *between]) or self._try(
                        at, later + 1, [*between, both]
                    ):
                        return True
        return False

    def _tests(self) -> int:
        return sum(len(tests) for rule in self.rules for tests in rule.ways)

    def _try(self, start: int, end: int, instead: list[Rule]) -> bool:
        """Put other rules where some stand, if all together still will do; do they?"""
        self.limits.check_time("the search for a tree that recovers")
        known = dict(zip(self.rules[start:end], self.where[start:end], strict=True))
        new = [known[rule] if rule in known else self.setting.applies(rule) for rule in instead]
        where = [*self.where[:start], *new, *self.where[end:]]
        rules = [*self.rules[:start], *instead, *self.rules[end:]]
        if not self.will_do(rules, where):
            return False
        self.rules, self.where = rules, where
        return True

    def will_do(self, rules: Sequence[Rule], where: Sequence[Flags]) -> bool:
        """Do rules that apply there decide well everywhere?"""
        setting, space = self.setting, self.setting.graph.space
        decided = np.full(len(setting.hopeful), -1, dtype=np.int64)
        for rule, applies in zip(reversed(rules), reversed(where), strict=True):
            decided[applies] = rule.action
        taken = (space.choice_action == decided[space.choice_state]) & setting.hopeful[space.choice_state]
        if taken.sum() < setting.hopeful.sum() or not (setting.best | setting.near)[taken].all():
            return False
        visited = np.zeros(len(decided), dtype=np.bool_)
        visited[space.closure(space.start, taken)] = True
        if not np.where(visited[space.choice_state], setting.best, setting.near)[taken].all():
            return False
        ends = visited & ~setting.hopeful & ~space.goal & setting.asked
        if (decided[ends] >= 0).any():
            return False
        return bool(setting.graph.reach(space.goal, taken).found[setting.hopeful].all())
