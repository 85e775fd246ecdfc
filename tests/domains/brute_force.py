"""The figures of a tree by forward propagation, written apart from :mod:`bbtc.belief`.

It shares the data classes with the package and nothing else: ticks come from the plain reading of
the semantics in ``tests/replay/reference.py``, effects are applied in
``tests/domains/by_bayes.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import cast

from bbtc.ground.task import GroundAction, GroundEvent, Task
from bbtc.replay.script import Values
from bbtc.tree.nodes import Node
from tests.domains.by_bayes import (
    Beliefs,
    Sets,
    after_changes,
    changed,
    every,
    first_beliefs,
    with_knowledge,
)
from tests.replay.reference import Ticking, value_of


@dataclass
class Totals:
    """Probabilities of the three ends, and what a run costs and does on average."""

    ends: dict[str, Fraction] = field(
        default_factory=lambda: {"success": Fraction(0), "failure": Fraction(0), "running": Fraction(0)}
    )
    cost: Fraction = Fraction(0)
    actions: Fraction = Fraction(0)
    reward: Fraction = Fraction(0)
    open: Fraction = Fraction(0)
    """Probability of the runs that were cut."""


# --- what happens by itself ------------------------------------------------------------------

_Found = dict[tuple[Values, Fraction, Fraction], Fraction]
"""Values, cost and reward so far, with their probability."""


def _through_events(task: Task, action: GroundAction, values: Values) -> _Found:
    """What the rounds of events make of some values, one after the other."""
    found: _Found = {(values, Fraction(0), Fraction(0)): Fraction(1)}
    for events in task.rounds(action):
        found = _after_round(events, found)
    return found


def _outcomes(
    task: Task, action: GroundAction, values: Values
) -> Iterator[tuple[Fraction, Values, Sets, Fraction, Fraction]]:
    """What an action may do: its probability, the values it is done with, what it sets then, cost and reward.
    An action with a condition to go on is done with what events left, or given up."""
    before: _Found = {(values, Fraction(0), Fraction(0)): Fraction(1)}
    if action.during is not None:
        before = _through_events(task, action, values)
    for (now, cost, reward), probability in before.items():
        goes_on = action.during is None or value_of(action.during, now) == "T"
        for chance, sets, more_cost, more_reward in every(
            action.factors if goes_on else action.on_abort, now
        ):
            yield probability * chance, now, sets, cost + more_cost, reward + more_reward


def _afterwards(task: Task, action: GroundAction, values: Values) -> _Found:
    """What events make of what an action left."""
    if action.during is not None:
        return {(values, Fraction(0), Fraction(0)): Fraction(1)}
    return _through_events(task, action, values)


def _after_round(events: Sequence[GroundEvent], before: _Found) -> _Found:
    found: _Found = {}
    for (values, cost, reward), probability in before.items():
        due = [event for event in events if value_of(event.precondition, values) == "T"]
        factors = tuple(factor for event in due for factor in event.factors)
        for chance, sets, more_cost, more_reward in every(factors, values):
            key = (changed(values, sets), cost + more_cost, reward + more_reward)
            found[key] = found.get(key, Fraction(0)) + probability * chance
    return found


# --- runs of a tree --------------------------------------------------------------------------


_Count = tuple[tuple[str, int], ...]
_Run = tuple[Values, frozenset[str], _Count, _Count, Beliefs]
"""The values, the latches, the tries of each retry node, the failed ones of each retry-until-success, and
what is believed of hidden facts."""


@dataclass(frozen=True)
class _Step:
    """What one action makes of a run: every run after it, and what it costs and brings on average."""

    following: dict[_Run, Fraction]
    cost: Fraction
    reward: Fraction


def brute_force(task: Task, root: Node, cut: Fraction = Fraction(1, 10**12)) -> Totals:
    """Step by step through every run of a tree, until what still runs is improbable; in floating point where
    events take place by the second."""
    totals = Totals()
    runs: dict[_Run, Fraction] = {}
    for state in task.initial:
        given = tuple(int(value) for value in state.values)
        for chance, first, believed in first_beliefs(task, given):
            key: _Run = (first, frozenset(), (), (), believed)
            runs[key] = runs.get(key, Fraction(0)) + state.probability * chance
    number: Callable[[Fraction], Fraction] = Fraction
    if task.moves_by_time:  # whose probabilities have twelve digits each, and more with every step
        number = cast("Callable[[Fraction], Fraction]", float)
    steps: dict[_Run, _Step | str] = {}
    while runs:
        totals.open = sum(runs.values(), Fraction(0))
        if totals.open < cut:
            break
        totals.open = Fraction(0)
        following: dict[_Run, Fraction] = {}
        for run, probability in runs.items():
            step = steps.get(run)
            if step is None:
                step = steps[run] = _step(task, root, run, number)
            if isinstance(step, str):
                totals.ends[step] += probability
                continue
            totals.actions += probability
            totals.cost += probability * step.cost
            totals.reward += probability * step.reward
            for after, chance in step.following.items():
                following[after] = following.get(after, Fraction(0)) + probability * chance
        runs = following
    return totals


def _step(task: Task, root: Node, before: _Run, number: Callable[[Fraction], Fraction]) -> _Step | str:
    """What a run does next, or how it ends."""
    values, finished, tries, lost, beliefs = before
    run = Ticking(task, values, set(finished), dict(tries), lost=dict(lost))
    status = run.tick_all(root)
    node = run.started
    if node is None:
        return status
    latches = frozenset(run.finished | ({node.id} if node.latched else set()))
    action = task.action_by_name[node.action]
    assert value_of(action.precondition, values) == "T", "started without its precondition"
    tried, failed = (tuple(sorted(each.items())) for each in (run.tries, run.lost))
    following: dict[_Run, Fraction] = {}
    total_cost, total_reward = action.cost, Fraction(0)
    for chance, now, sets, cost, reward in _outcomes(task, action, values):
        for shown in after_changes(task, action.changes, now, beliefs):
            share = chance * shown.chance
            done = with_knowledge(task, changed(now, sets + shown.sets), shown.beliefs)
            for (after, more_cost, more_reward), by_itself in _afterwards(task, action, done).items():
                total_cost += share * by_itself * (cost + shown.cost + more_cost)
                total_reward += share * by_itself * (reward + shown.reward + more_reward)
                key = (after, latches, tried, failed, shown.beliefs)
                following[key] = following.get(key, Fraction(0)) + share * by_itself
    chances = {each: number(chance) for each, chance in following.items()}
    return _Step(chances, number(total_cost), number(total_reward))


History = tuple[object, ...]
"""A run: the values at the start, an action and the values after it, again and again, and how it ended
(missing where it was cut)."""


def runs_of(task: Task, root: Node, most: int) -> dict[History, Fraction]:
    """Every run of any tree with its probability, cut after so many actions."""
    found: dict[History, Fraction] = {}
    waiting: list[tuple[History, Ticking, Fraction]] = []
    for state in task.initial:
        values = tuple(int(value) for value in state.values)
        waiting.append(((values,), Ticking(task, values), state.probability))
    while waiting:
        history, run, probability = waiting.pop()
        if not probability:
            continue
        status = run.tick_all(root)
        node = run.started_now()
        if node is None or len(history) > 2 * most:
            end = (*history, status) if node is None else history
            found[end] = found.get(end, Fraction(0)) + probability
            continue
        finished = run.finished | {node.id} if node.latched else run.finished
        results: dict[Values, Fraction] = {}
        for chance, sets, _, _ in every(task.action_by_name[node.action].factors, run.values):
            after = changed(run.values, sets)
            results[after] = results.get(after, Fraction(0)) + chance
        for after, chance in results.items():
            following = Ticking(task, after, set(finished), dict(run.tries), lost=dict(run.lost))
            waiting.append(((*history, node.action, after), following, probability * chance))
    return found
