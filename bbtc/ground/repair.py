"""The cheapest repair of something that nothing can bring about: which facts, if they were given, would
put it within reach.

Who could bring a fact about are alternatives, what one of them needs stands together: an AND-OR graph with
loops. A fact on the way can also be given outright, which costs more than any way down that ends in facts
that nobody brings about. Where the way goes in a circle, as of a battery that is empty and of a charger that
is out of reach without it, the fact that it comes back to is the root.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

from bbtc.limits import Limits

F = TypeVar("F", bound=Hashable)

_MOST_FACTS = 2000
"""So many facts are followed at most; those beyond count as given."""
_Cost: TypeAlias = tuple[int, float]
"""Whether a fact has to be given that something could bring about, and what all else takes. Several parts
that need one have mostly the same in mind: it counts once."""
_GIVEN: _Cost = (1, 0.0)
_DEEPER: _Cost = (1, 2.5)
"""A way down is told rather than that a fact on it should be given, if it takes no more than this."""
_NEVER: _Cost = (2, 0.0)


@dataclass(frozen=True, slots=True)
class Every(Generic[F]):
    """All of them are needed."""

    parts: tuple[Need[F], ...]


@dataclass(frozen=True, slots=True)
class Some(Generic[F]):
    """One of them is enough; without parts, nothing is."""

    parts: tuple[Need[F], ...]


Need: TypeAlias = F | Every[F] | Some[F]


@dataclass(frozen=True, slots=True)
class Way(Generic[F]):
    """Something that would bring a fact about, were it not for what it needs."""

    by: str
    need: Need[F]


@dataclass(frozen=True, slots=True)
class Root(Generic[F]):
    """A fact that is missing, and what needs it (None: what was asked for itself). ``setters`` could bring it
    about, but are out of reach themselves, mostly for want of it."""

    what: F
    by: str | None
    setters: tuple[str, ...] = ()


def every(needs: Iterable[Need[F] | None]) -> Need[F] | None:
    """What is needed together; None (nothing) where each part is None, and no more than a part without an
    alternative, if there is one: all the rest would not help."""
    found = [need for need in needs if need is not None]
    if Some(()) in found:
        return Some(())
    return None if not found else found[0] if len(found) == 1 else Every(tuple(found))


def some(needs: Iterable[Need[F] | None]) -> Need[F] | None:
    """What is needed of alternatives: nothing if one of them needs nothing."""
    found: list[Need[F]] = []
    for need in needs:
        if need is None:
            return None
        found.append(need)
    return found[0] if len(found) == 1 else Some(tuple(found))


class Repairs(Generic[F]):
    """Finds the cheapest repairs in one graph: ``ways`` tells who could bring a fact about, ``cost`` what it
    takes to give one that nobody does."""

    def __init__(
        self, ways: Callable[[F], Iterable[Way[F]]], cost: Callable[[F], float], limits: Limits
    ) -> None:
        self._ways_to = ways
        self._cost_of = cost
        self._limits = limits
        self._ways: dict[F, list[Way[F]]] = {}
        self._costs: dict[F, _Cost] = {}

    def roots(self, need: Need[F] | None) -> tuple[Root[F], ...]:
        """The facts of the cheapest repair, nearest first; of equal ones, those of the alternatives named
        first. Empty where nothing is needed, or nothing helps. Raises
        :class:`bbtc.diagnostics.LimitReached`."""
        if need is None:
            return ()
        self._explore(need)
        self._spread(set(_facts(need)))
        return tuple(self._cheapest(need))

    def _explore(self, need: Need[F]) -> None:
        todo = list(_facts(need))
        for fact in todo:  # grows while it is read: breadth first
            if fact in self._ways:
                continue
            self._limits.check_time("the search for what is missing")
            self._ways[fact] = list(self._ways_to(fact)) if len(self._ways) < _MOST_FACTS else []
            for way in self._ways[fact]:
                todo.extend(_facts(way.need))

    def _spread(self, asked: set[F]) -> None:
        """The cost of each fact, the least that fits all ways: later facts first, until nothing changes. What
        was asked for itself is no explanation, if there are ways to it."""
        order = [*reversed(self._ways)]
        self._costs = {fact: _GIVEN if self._ways[fact] else (0, self._cost_of(fact)) for fact in order}
        self._costs.update((fact, _NEVER) for fact in asked if self._ways[fact])
        changed = True
        while changed:
            self._limits.check_time("the search for what is missing")
            changed = False
            for fact in order:
                least = min((self._cost(way.need) for way in self._ways[fact]), default=_NEVER)
                if least < self._costs[fact]:
                    self._costs[fact] = least
                    changed = True

    def _cost(self, need: Need[F]) -> _Cost:
        if isinstance(need, Every):
            costs = [self._cost(part) for part in need.parts]
            return max(given for given, _ in costs), sum(cost for _, cost in costs)
        if isinstance(need, Some):
            return min(map(self._cost, need.parts), default=_NEVER)
        return self._costs[need]

    def _cheapest(self, need: Need[F]) -> Iterator[Root[F]]:
        above: dict[F, F | None] = {}
        told: set[F] = set()
        todo: list[tuple[Need[F], str | None, F | None]] = [(need, None, None)]
        needed_by: dict[F, str | None] = {}
        for each, by, parent in todo:  # grows while it is read: breadth first
            self._limits.check_time("the search for what is missing")
            if isinstance(each, Every):
                todo.extend((part, by, parent) for part in each.parts)
                continue
            if isinstance(each, Some):
                todo.extend((part, by, parent) for part in sorted(each.parts, key=self._cost)[:1])
                continue
            ways = self._ways[each]
            best = min(ways, key=lambda way: self._cost(way.need), default=None)
            circle = each in above and _is_above(above, each, parent)
            if each in above and not circle:
                continue
            if not circle:
                above[each] = parent
                needed_by[each] = by
                if best is not None and self._cost(best.need) <= max(self._costs[each], _DEEPER):
                    todo.append((best.need, best.by, each))
                    continue
            if each not in told:
                told.add(each)
                yield Root(each, needed_by[each], tuple(dict.fromkeys(way.by for way in ways)))


def _is_above(above: dict[F, F | None], fact: F, at: F | None) -> bool:
    """Whether the way down to ``at`` went through the fact."""
    while at is not None and at != fact:
        at = above[at]
    return at is not None


def _facts(need: Need[F]) -> Iterator[F]:
    todo = [need]
    for each in todo:
        if isinstance(each, (Every, Some)):
            todo.extend(each.parts)
        else:
            yield each
