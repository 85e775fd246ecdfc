"""Bounds on time, memory and size that every long computation honours, and how it tells where it is."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from bbtc.diagnostics import Diagnostic, LimitReached


@dataclass(frozen=True, slots=True)
class Stage:
    """What a long computation is doing: the number of states seen so far, and what is known of the
    best success probability, where it has that."""

    doing: str
    states: int | None = None
    bounds: tuple[float, float] | None = None


Watcher: TypeAlias = Callable[[Stage], None]

MOST_WORLDS = 4096
"""So many worlds of a component of hidden facts are listed, and a draw of the start has so many results."""

MOST_NODES = 100_000
"""So many nodes of decision diagrams are made to write down what is thought of a component at the start."""

PLANNING_SECONDS = 60.0
"""The time that planning may take unless somebody says otherwise."""


@dataclass(slots=True)
class Effort:
    """How often a computation may still look at the clock: a bound on work that is the same on every machine,
    unlike one on time."""

    looks: int


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds for one run; ``None`` means no bound.

    ``seconds`` counts from the moment the object is made; those of a command count from the start of its
    process. ``states`` bounds the physical states of one simulation, ``nodes`` the nodes of a tree. Of
    reading, ``file_bytes`` bounds the size of a file, and ``depth`` how deep its parentheses are nested. Of
    grounding, ``actions`` bounds the ground actions and templates, ``facts`` everything that the
    reachability analysis derives, ``bindings`` the objects that quantifiers are tried with,
    ``initial_states`` what a draw in ``:init`` is spelled out into, ``worlds`` those of a component that are
    listed one by one, and ``diagram_nodes`` the decision diagrams where they are not. ``memory`` bounds the
    bytes that this process may take (its resident set), and those of the engine that grounding runs beside
    it.

    ``watcher`` is told what is being done whenever time is looked at. ``until`` is the moment (of
    ``time.monotonic``) at which a part of the work has to end, ``effort`` another bound on such a part.
    """

    seconds: float | None = None
    states: int = 1_000_000
    nodes: int = 10_000
    actions: int = 2_000_000
    facts: int = 10_000_000
    bindings: int = 100_000_000
    memory: int | None = 4 << 30
    initial_states: int = 256
    worlds: int = MOST_WORLDS
    diagram_nodes: int = MOST_NODES
    file_bytes: int = 64 << 20
    depth: int = 100
    watcher: Watcher | None = field(default=None, compare=False, repr=False)
    until: float | None = field(default=None, compare=False, repr=False)
    effort: Effort | None = field(default=None, compare=False, repr=False)
    _start: float = field(default_factory=time.monotonic, compare=False, repr=False)

    def afresh(self) -> Limits:
        """The same bounds, with the time counted from now."""
        return replace(self, _start=time.monotonic())

    def since(self, start: float) -> Limits:
        """The same bounds, with the time counted from a moment of ``time.monotonic``."""
        return replace(self, _start=start)

    @property
    def remaining(self) -> float | None:
        """Seconds left, not below 0; None without a bound."""
        ends = [] if self.seconds is None else [self._start + self.seconds]
        if self.until is not None:
            ends.append(self.until)
        return max(0.0, min(ends) - time.monotonic()) if ends else None

    def part(self, share: float) -> Limits:
        """The same limits for a part of the work that may take a share of the time left."""
        remaining = self.remaining
        return self if remaining is None else replace(self, until=time.monotonic() + share * remaining)

    def within(self, seconds: float) -> Limits:
        """The same limits for a part of the work that must end after so many seconds at the latest."""
        until = time.monotonic() + seconds
        return replace(self, until=until if self.until is None else min(until, self.until))

    def but_for(self, share: float) -> Limits:
        """The same limits for a part of the work that leaves a share of the whole time to what comes next."""
        if self.seconds is None:
            return self
        until = self._start + (1 - share) * self.seconds
        return replace(self, until=until if self.until is None else min(until, self.until))

    def overtime(self, seconds: float) -> Limits:
        """The same limits for what comes after the end of the time: it has so many seconds more."""
        return replace(self, seconds=None, until=time.monotonic() + seconds)

    @property
    def met(self) -> bool:
        """Is the time over, or the memory used up?"""
        left = self.memory_left
        return self.remaining == 0 or (left is not None and left < 0)

    def tell(self, doing: str, states: int | None = None, bounds: tuple[float, float] | None = None) -> None:
        """Tell the watcher, if there is one, what is being done."""
        if self.watcher is not None:
            self.watcher(Stage(doing, states, bounds))

    def check_time(self, doing: str, states: int | None = None) -> None:
        """Raise :class:`LimitReached` once the time is over or the memory is used up, and tell the
        watcher what is being done."""
        self.tell(doing, states)
        if self.remaining == 0:
            seconds = "" if self.seconds is None else f" of {self.seconds:g} s"
            raise self.reached(f"the time limit{seconds} ended {doing}", "--time-limit")
        if self.effort is not None:
            self.effort.looks -= 1
            if self.effort.looks < 0:
                raise self.reached(f"a second opinion ended {doing}", "--time-limit")
        self.check_memory(doing)

    @property
    def memory_left(self) -> int | None:
        """Bytes that this process may still take; None without a bound, or where it cannot be told."""
        taken = None if self.memory is None else resident_memory()
        return None if self.memory is None or taken is None else self.memory - taken

    def check_memory(self, doing: str, more: int = 0) -> None:
        """Raise :class:`LimitReached` if this process takes too much memory, or would with so many
        bytes more. Where the system does not tell what it takes, nothing is raised."""
        left = self.memory_left
        if self.memory is not None and left is not None and left < more:
            raise self.reached(
                f"the limit of {self.memory >> 20} MiB of memory ended {doing}", "--max-memory"
            )

    def check_states(self, count: int, doing: str) -> None:
        """Raise :class:`LimitReached` if ``count`` states are too many, or time or memory is used up."""
        if count > self.states:
            raise self.reached(f"the limit of {self.states} states ended {doing}", "--max-states")
        if count % 256 == 0:
            self.check_time(doing, count)

    def check_nodes(self, count: int) -> None:
        """Raise :class:`LimitReached` if a tree of ``count`` nodes is too large."""
        if count > self.nodes:
            raise self.reached(f"the limit of {self.nodes} tree nodes ended planning", "--max-nodes")

    def check_actions(self, count: int) -> None:
        """Raise :class:`LimitReached` if ``count`` ground actions and templates are too many."""
        if count > self.actions:
            raise self.reached(f"the limit of {self.actions} ground actions was met", "--max-ground-actions")

    def check_facts(self, count: int) -> None:
        """Raise :class:`LimitReached` if ``count`` derived facts are too many."""
        if count > self.facts:
            raise self.reached(f"the limit of {self.facts} derived facts ended grounding", "--max-facts")

    def check_bindings(self, count: int) -> None:
        """Raise :class:`LimitReached` if ``count`` bindings of quantifiers are too many."""
        if count > self.bindings:
            raise self.reached(f"the limit of {self.bindings} quantifier bindings was met", "--max-bindings")

    @staticmethod
    def reached(message: str, option: str) -> LimitReached:
        """The exception for a limit that ``option`` raises."""
        return LimitReached([Diagnostic("BBT0007", message, hint=f"raise it with {option}")])


_PAUSE = 0.001
"""Seconds in which a process takes little memory, and asking costs more than what was done."""


@dataclass(slots=True)
class _Told:
    """What the system told of memory, and when."""

    moment: float = -math.inf
    taken: int | None = None


_last = _Told()


def resident_memory() -> int | None:
    """The bytes of this process in memory, now or a thousandth of a second ago; None where the system does
    not tell. Without ``/proc`` it is the most that they ever were."""
    now = time.monotonic()
    if now - _last.moment >= _PAUSE:
        _last.moment, _last.taken = now, _resident_memory()
    return _last.taken


def _resident_memory() -> int | None:
    try:
        with open("/proc/self/statm", "rb") as file:  # noqa: PTH123 (called often)
            pages = int(file.read().split()[1])
    except OSError:
        pass
    else:
        import resource

        return pages * resource.getpagesize()
    try:
        import resource
    except ImportError:  # Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else most << 10
