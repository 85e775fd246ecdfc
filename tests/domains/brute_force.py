"""The figures of a tree by forward propagation, written apart from :mod:`bbtc.belief`.

It shares the data classes with the package and nothing else: ticks come from the plain reading of
the semantics in ``tests/replay/reference.py``, effects are applied here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction

from bbtc.ground.task import Factor, Outcome, Task
from bbtc.replay.script import Values
from bbtc.tree.nodes import Node
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


_Count = tuple[tuple[str, int], ...]
_Run = tuple[Values, frozenset[str], _Count, _Count]
"""The values, the latches, the tries of each retry node, and the failed ones of each retry-until-success."""


def brute_force(task: Task, root: Node, cut: Fraction = Fraction(1, 10**12)) -> Totals:
    """Step by step through every run of a tree, until what still runs is improbable."""
    totals = Totals()
    runs: dict[_Run, Fraction] = {}
    for state in task.initial:
        key: _Run = (tuple(int(value) for value in state.values), frozenset(), (), ())
        runs[key] = runs.get(key, Fraction(0)) + state.probability
    while runs:
        totals.open = sum(runs.values(), Fraction(0))
        if totals.open < cut:
            break
        totals.open = Fraction(0)
        following: dict[_Run, Fraction] = {}
        for (values, finished, tries, lost), probability in runs.items():
            run = Ticking(task, values, set(finished), dict(tries), lost=dict(lost))
            status = run.tick_all(root)
            node = run.started
            if node is None:
                totals.ends[status] += probability
                continue
            latches = frozenset(run.finished | ({node.id} if node.latched else set()))
            action = task.action_by_name[node.action]
            assert value_of(action.precondition, values) == "T", "started without its precondition"
            totals.actions += probability
            for chance, sets, cost, reward in _every(action.factors, values):
                share = probability * chance
                totals.cost += share * (action.cost + cost)
                totals.reward += share * reward
                tried, failed = (tuple(sorted(each.items())) for each in (run.tries, run.lost))
                key = (_changed(values, sets), latches, tried, failed)
                following[key] = following.get(key, Fraction(0)) + share
        runs = following
    return totals


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
        for chance, sets, _, _ in _every(task.action_by_name[node.action].factors, run.values):
            after = _changed(run.values, sets)
            results[after] = results.get(after, Fraction(0)) + chance
        for after, chance in results.items():
            following = Ticking(task, after, set(finished), dict(run.tries), lost=dict(run.lost))
            waiting.append(((*history, node.action, after), following, probability * chance))
    return found


_Sets = tuple[tuple[int, int], ...]


def _every(
    factors: tuple[Factor, ...], values: Values
) -> Iterator[tuple[Fraction, _Sets, Fraction, Fraction]]:
    """Every combination of one outcome for each factor: probability, settings, cost, reward."""
    if not factors:
        yield Fraction(1), (), Fraction(0), Fraction(0)
        return
    for outcome in factors[0].outcomes:
        for p, sets, cost, reward in _every(outcome.factors + factors[1:], values):
            due = [charge for charge in outcome.charges if value_of(charge.when, values) == "T"]
            yield (
                outcome.probability * p,
                _settings(outcome, values) + sets,
                outcome.cost + cost + sum(charge.cost for charge in due),
                outcome.reward + reward + sum(charge.reward for charge in due),
            )


def _settings(outcome: Outcome, values: Values) -> _Sets:
    return tuple(
        (variable, int(value))
        for effect in outcome.effects
        if effect.when is None or value_of(effect.when, values) == "T"
        for variable, value in effect.sets
    )


def _changed(values: Values, sets: _Sets) -> Values:
    """The values after all settings at once; of two values for one variable the greater wins."""
    after = list(values)
    for variable in {variable for variable, _ in sets}:
        after[variable] = max(value for each, value in sets if each == variable)
    return tuple(after)
