"""Bounds of grounding, so that no input hangs or fills the memory."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GroundLimits:
    """``actions``: ground actions and templates. ``facts``: everything the Datalog program derives.
    ``seconds``: wall-clock time of the whole grounding (None: no bound). ``memory``: bytes the
    Datalog engine may take (None: no bound). ``initial_states``: states a probabilistic ``:init``
    is spelled out into."""

    actions: int = 2_000_000
    facts: int = 10_000_000
    seconds: float | None = 600.0
    memory: int | None = 4 << 30
    initial_states: int = 256


DEFAULT_LIMITS = GroundLimits()
