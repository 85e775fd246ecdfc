"""Bounds on time and size that every long computation honours."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from bbtc.diagnostics import Diagnostic, LimitReached


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds for one run; ``None`` means no bound.

    ``seconds`` counts from the moment the object is made. ``states`` bounds the physical states
    of one simulation, ``nodes`` the nodes of a tree. Of reading, ``file_bytes`` bounds the size of
    a file, and ``depth`` how deep its parentheses are nested. Of grounding, ``actions`` bounds the ground
    actions and templates, ``facts`` everything that the reachability analysis derives,
    ``bindings`` the objects that quantifiers are tried with,
    ``memory`` the bytes its engine may take, ``initial_states`` what a draw in ``:init`` is spelled
    out into.
    """

    seconds: float | None = None
    states: int = 1_000_000
    nodes: int = 10_000
    actions: int = 2_000_000
    facts: int = 10_000_000
    bindings: int = 100_000_000
    memory: int | None = 4 << 30
    initial_states: int = 256
    file_bytes: int = 64 << 20
    depth: int = 100
    _start: float = field(default_factory=time.monotonic, compare=False, repr=False)

    @property
    def remaining(self) -> float | None:
        """Seconds left, not below 0; None without a bound."""
        if self.seconds is None:
            return None
        return max(0.0, self._start + self.seconds - time.monotonic())

    def check_time(self, doing: str) -> None:
        """Raise :class:`LimitReached` once the time is over."""
        if self.seconds is not None and time.monotonic() - self._start > self.seconds:
            raise self.reached(f"the time limit of {self.seconds:g} s ended {doing}", "--time-limit")

    def check_states(self, count: int, doing: str) -> None:
        """Raise :class:`LimitReached` if ``count`` states are too many, or the time is over."""
        if count > self.states:
            raise self.reached(f"the limit of {self.states} states ended {doing}", "--max-states")
        if count % 256 == 0:
            self.check_time(doing)

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
