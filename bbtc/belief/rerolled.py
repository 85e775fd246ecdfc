"""Noisy readings that a tree makes again although nothing that they tell of has changed: its figures take
them to be drawn anew each time, and errors that stay would change them."""

from __future__ import annotations

from collections.abc import Iterator

from bbtc.belief.chain import Chain
from bbtc.ground.condition import variables
from bbtc.ground.task import Observation, Task, effects_of
from bbtc.markov import reachable


def rerolled(task: Task, chain: Chain) -> tuple[str, ...]:
    """The actions that tell something noisy which a run of a tree may do again, before any action that may
    change what it tells of; in the order of their names."""
    names = [chain.actions[number].action if number >= 0 else "" for number in chain.action]
    found = []
    for action in sorted({*names} - {""}):
        for component, noisy in _noisy(task, action):
            read = {
                each for each in variables(noisy.condition) if each < len(task.components[component].facts)
            }
            fresh = {name for name in {*names} - {""} if _changes(task, name, component, read)}
            if action not in fresh and _again(chain, names, action, fresh):
                found.append(action)
                break
    return tuple(found)


def _noisy(task: Task, action: str) -> Iterator[tuple[int, Observation]]:
    for change in task.action_by_name[action].changes:
        for observation in change.observations:
            if observation.noisy:
                yield change.component, observation


def _changes(task: Task, action: str, component: int, read: set[int]) -> bool:
    """May an action change some of the facts of a component?"""
    return any(
        variable in read
        for change in task.action_by_name[action].changes
        if change.component == component
        for effect in effects_of(change.factors)
        for variable, _ in effect.sets
    )


def _again(chain: Chain, names: list[str], action: str, fresh: set[str]) -> bool:
    """May an action be started again, with none of the ``fresh`` ones between?"""
    started = [state for state, name in enumerate(names) if name == action]
    after = {edge.successor for state in started for edge in chain.edges[state]}
    seen = reachable(
        after,
        lambda state: [] if names[state] in fresh else [edge.successor for edge in chain.edges[state]],
    )
    return any(names[state] == action for state in seen)
