"""What a planner is asked for beyond the target probability."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from bbtc.planner.best_tree import BestTree

Retries: TypeAlias = Literal["least", "unbounded"]
Prefer: TypeAlias = Literal["success", "cost", "size"]


@dataclass(frozen=True, slots=True)
class Options:
    """``max_actions`` bounds the actions of every run; None: no bound. ``retries`` tells how often an
    action may be tried again: without end, or as often as it takes to meet the target and no more (without
    end where no number is enough). ``prefer`` tells which of the trees that meet the target is best
    (:mod:`bbtc.planner.objective`). In a ``closed_world`` nobody else changes anything: what matters only
    where others do is left out (:mod:`bbtc.planner.guard`). With ``allow_guess``, a tree may succeed where
    the goal is not known to be true (:mod:`bbtc.planner.stopping`). ``best`` is told every better tree as it
    is found."""

    max_actions: int | None = None
    retries: Retries = "unbounded"
    prefer: Prefer = "success"
    closed_world: bool = False
    allow_guess: bool = False
    best: BestTree | None = field(default=None, compare=False, repr=False)


DEFAULTS = Options()
