"""What a planner is asked for beyond the target probability."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Options:
    """``max_actions`` bounds the actions of every run; None: no bound."""

    max_actions: int | None = None


DEFAULTS = Options()
