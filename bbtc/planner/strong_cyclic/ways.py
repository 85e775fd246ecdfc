"""What a search for a weak plan comes to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from bbtc.planner.strong_cyclic.determinised import Step


class Taken(NamedTuple):
    """A step of a plan: the state before, the action, the outcome."""

    state: int
    action: int
    step: Step


@dataclass(frozen=True, slots=True)
class WeakPlan:
    """The steps, and the state that they lead to."""

    steps: tuple[Taken, ...]
    end: int


@dataclass(frozen=True, slots=True)
class Exhausted:
    """There is no weak plan. ``seen`` are all states that can be reached, in order, but for what follows
    dead ends of the relaxation, which are ``dead``."""

    seen: tuple[int, ...]
    dead: tuple[int, ...]


def traced(parent: dict[int, Taken | None], end: int) -> WeakPlan:
    """The plan that led to a state, by the step that led to each."""
    steps: list[Taken] = []
    taken = parent[end]
    while taken is not None:
        steps.append(taken)
        taken = parent[taken.state]
    return WeakPlan(tuple(reversed(steps)), end)
