"""What a planner is asked for beyond the target probability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

Retries: TypeAlias = Literal["least", "unbounded"]


@dataclass(frozen=True, slots=True)
class Options:
    """``max_actions`` bounds the actions of every run; None: no bound. ``retries`` tells how often an
    action may be tried again: as often as it takes to meet the target and no more (without end where
    no number is enough), or always without end. ``guarded`` keeps the checks that matter only where
    others change the world (:mod:`bbtc.plan.guard`)."""

    max_actions: int | None = None
    retries: Retries = "least"
    guarded: bool = False


DEFAULTS = Options()
