"""What a planner is asked for beyond the target probability."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from bbtc.planner.best_tree import BestTree

Retries: TypeAlias = Literal["least", "unbounded"]


@dataclass(frozen=True, slots=True)
class Options:
    """``max_actions`` bounds the actions of every run; None: no bound. ``retries`` tells how often an
    action may be tried again: as often as it takes to meet the target and no more (without end where
    no number is enough), or always without end. ``guarded`` keeps the checks that matter only where
    others change the world (:mod:`bbtc.planner.guard`). ``best`` is told every better tree as it is found."""

    max_actions: int | None = None
    retries: Retries = "least"
    guarded: bool = False
    best: BestTree | None = field(default=None, compare=False, repr=False)


DEFAULTS = Options()
