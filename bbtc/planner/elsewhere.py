"""A task that begins elsewhere, too: in states that others may leave it in.

A tree that was planned from there goes on where it is not expected to be. In one of these states, one fact of
an initial state, or one group of facts that exclude one another, such as the places of a robot, has changed
(:mod:`bbtc.planner.changing_facts`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TypeVar

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain
from bbtc.belief.draws import Values
from bbtc.belief.state import initial_belief
from bbtc.belief.tick import NodeStatus
from bbtc.ground.task import InitialState, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.objective import Elsewhere

_T = TypeVar("_T")

MOST_VISITED = 40
"""States in which all that may change is looked at."""

MOST_STARTS = 100
"""So many other initial states are considered."""

_SHARE = Fraction(1, 1000)
_LOOK = 100  # states between two looks at the clock


def elsewhere_of(chain: Chain, own: Chain | None) -> Elsewhere:
    """What becomes of the runs of a chain that begins in such states; ``own`` is the tree's own chain."""
    expected = set() if own is None else {own.states[number].values for number in own.final}
    visits = Absorption(chain).visits()
    success = given_up = Fraction(0)
    for number in chain.final:
        match chain.status[number]:
            case NodeStatus.SUCCESS:
                success += visits[number] or 0
            case NodeStatus.FAILURE if chain.states[number].values not in expected:
                given_up += visits[number] or 0
            case _:
                pass
    return Elsewhere(success, given_up)


def starts_elsewhere(task: Task, limits: Limits, visited: Iterable[Values] = ()) -> list[tuple[Truth, ...]]:
    """Initial states that the task does not have, :data:`MOST_STARTS` of them at most: what one change makes
    of its own, and of those visited. Raises ``LimitReached``."""
    facts = ChangingFacts.of(task, limits)
    own = initial_belief(task)
    states = spread([*dict.fromkeys([*own, *visited])], MOST_VISITED)
    found = [values for values in changed(facts, states, limits) if values not in own]
    return [tuple(map(Truth, values)) for values in spread(found, MOST_STARTS)]


def changed(facts: ChangingFacts, states: Iterable[Values], limits: Limits) -> list[Values]:
    """Where one change leads from some states. Raises ``LimitReached``."""
    found: dict[Values, None] = {}
    for number, values in enumerate(states):
        if number % _LOOK == 0:
            limits.check_time("the search for a tree that recovers")
        found.update(dict.fromkeys(facts.changed(values)))
    return [*found]


def spread(states: Sequence[_T], most: int) -> Sequence[_T]:
    """So many of them at most, from all over."""
    return states[:: max(1, -(-len(states) // most))]


def only_at(task: Task, starts: Sequence[tuple[Truth, ...]]) -> Task:
    """The task, beginning in one of these states, all equally likely."""
    share = Fraction(1, len(starts))
    return replace(task, initial=tuple(InitialState(share, values) for values in starts))


def also_at(task: Task, starts: Sequence[tuple[Truth, ...]]) -> Task:
    """The task, with a small share of the runs beginning in these states."""
    own = tuple(replace(each, probability=each.probability * (1 - _SHARE)) for each in task.initial)
    share = _SHARE / len(starts)
    return replace(task, initial=(*own, *(InitialState(share, values) for values in starts)))
