"""Conditions about the world made conditions on what is known: each is true, or false, where it is so in
every world still possible.

Kleene logic on the parts of a condition is exact where no component stands in two of them, since components
are independent; and what is true of a conjunction is what is true of its parts. Parts that share a
component become one formula with a variable of its own, after visible facts are settled by cases.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import (
    FALSE,
    TRUE,
    And,
    Condition,
    Constant,
    Is,
    Known,
    Not,
    Or,
    Within,
    conjunction,
    disjunction,
    doubt,
    is_test,
    leaves,
    negation,
    replaced,
)
from bbtc.ground.hidden.groups import Groups
from bbtc.ground.hidden.parts import facts_read
from bbtc.ground.task import Variable
from bbtc.kleene import Truth

_MOST_CASES = 8
"""So many visible facts are settled by cases in one formula."""

_Combine: TypeAlias = Callable[[list[Condition]], Condition]


class TooManyCases(Exception):
    """A condition mixes too many visible facts with hidden ones of one component."""


class KnownConditions:
    """Makes conditions on what is known. Components that one formula needs are joined in ``groups``, and
    ``joined`` tells that there were such: then all has to be made anew."""

    def __init__(
        self, groups: Groups, known: Sequence[Variable], tests: Mapping[int, Condition] | None = None
    ) -> None:
        """Formulas get variables behind those that are ``known``. ``tests`` are variables of which conditions
        ask whether they are known, and what they stand for."""
        self.groups = groups
        self.joined = False
        self.formulas: dict[Condition, int] = {}
        self._variables, self._first = known, len(known)
        self._tests = tests or {}
        self._made: dict[tuple[Condition, bool], Condition] = {}

    def known(self, condition: Condition, *, truth: bool) -> Condition:
        """The condition on what is known that has the value of ``condition`` where it is the same in all
        worlds, and else is unknown. With ``truth``, it only has to be true where that is."""
        key = condition, truth
        found = self._made.get(key)
        if found is None:
            found = self._made[key] = self._known(condition, truth)
        return found

    def _known(self, condition: Condition, truth: bool) -> Condition:
        match condition:
            case Is(variable) | Known(variable) if variable in self._tests:
                unknown = doubt(self.known(self._tests[variable], truth=False), self._unknown)
                return negation(unknown) if isinstance(condition, Known) else unknown
            case Is() | Known() | Within() | Constant():
                return condition
            case Not(part):
                return self.known(negation(part), truth=truth)
            case And(parts) if truth:
                return conjunction(self.known(part, truth=True) for part in parts)
            case And(parts):
                return self._together(parts, conjunction, truth)
            case Or(parts):
                return self._together(parts, disjunction, truth)
            case _:
                assert_never(condition)

    def _unknown(self, variable: int) -> Condition:
        """Where a variable of what is known, or of what is seen, is unknown."""
        seen = variable not in self.groups and variable < self._first
        never = seen and not self._variables[variable].three_valued
        return FALSE if never else Is(variable, Truth.UNKNOWN)

    def _together(self, parts: tuple[Condition, ...], combine: _Combine, truth: bool) -> Condition:
        clusters: list[tuple[set[int], list[Condition]]] = []
        for part in parts:
            read = {self.groups.of(fact) for fact in facts_read(part) if fact in self.groups}
            mine = [part]
            apart: list[tuple[set[int], list[Condition]]] = []
            for components, others in clusters:
                if components & read:
                    read, mine = read | components, [*others, *mine]
                else:
                    apart.append((components, others))
            clusters = [*apart, (read, mine)]
        return combine([self._cluster(components, mine, combine, truth) for components, mine in clusters])

    def _cluster(
        self, components: set[int], parts: list[Condition], combine: _Combine, truth: bool
    ) -> Condition:
        if len(parts) == 1:
            return self.known(parts[0], truth=truth)
        if self.groups.join(components):
            self.joined = True
        return self._formula(combine(parts), truth)

    def _formula(self, condition: Condition, truth: bool) -> Condition:
        """What is known of a condition on the facts of one component, and on what is visible."""
        seen = [leaf for leaf in leaves(condition) if is_test(leaf) or leaf.variable not in self.groups]
        if not seen:
            return self._variable(condition)
        if len({(leaf.variable, is_test(leaf)) for leaf in seen}) > _MOST_CASES:
            raise TooManyCases
        read = seen[0]
        cases = []
        for holds in (True, False):
            test = _test(read, holds)
            rest = replaced(condition, lambda leaf, holds=holds: _settled(leaf, read, holds))  # type: ignore[misc]
            cases.append(conjunction([test, self.known(rest, truth=truth)]))
        return disjunction(cases)

    def _variable(self, condition: Condition) -> Condition:
        if isinstance(condition, Is | Constant):
            return condition
        denied = self.formulas.get(negation(condition))
        if denied is not None:
            return Is(denied, Truth.FALSE)
        return Is(self.formulas.setdefault(condition, self._first + len(self.formulas)), Truth.TRUE)


def _test(leaf: Is | Known, holds: bool) -> Condition:
    return leaf if holds else negation(leaf)


def _settled(leaf: Is | Known, read: Is | Known, holds: bool) -> Condition:
    if leaf == read:
        return TRUE if holds else FALSE
    if leaf == negation(read):
        return FALSE if holds else TRUE
    return leaf
