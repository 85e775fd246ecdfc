"""The figures of a tree by forward propagation, written apart from :mod:`bbtc.belief`.

It shares the data classes with the package and nothing else: ticks come from the plain reading of
the semantics in ``tests/replay/reference.py``, effects are applied in
``tests/domains/by_bayes.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from bbtc.ground.task import Task
from bbtc.replay.script import Values
from bbtc.tree.nodes import Node
from tests.domains.by_bayes import (
    Beliefs,
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


_Count = tuple[tuple[str, int], ...]
_Run = tuple[Values, frozenset[str], _Count, _Count, Beliefs]
"""The values, the latches, the tries of each retry node, the failed ones of each retry-until-success, and
what is believed of hidden facts."""


def brute_force(task: Task, root: Node, cut: Fraction = Fraction(1, 10**12)) -> Totals:
    """Step by step through every run of a tree, until what still runs is improbable."""
    totals = Totals()
    runs: dict[_Run, Fraction] = {}
    for state in task.initial:
        given = tuple(int(value) for value in state.values)
        for chance, first, believed in first_beliefs(task, given):
            key: _Run = (first, frozenset(), (), (), believed)
            runs[key] = runs.get(key, Fraction(0)) + state.probability * chance
    while runs:
        totals.open = sum(runs.values(), Fraction(0))
        if totals.open < cut:
            break
        totals.open = Fraction(0)
        following: dict[_Run, Fraction] = {}
        for (values, finished, tries, lost, beliefs), probability in runs.items():
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
            tried, failed = (tuple(sorted(each.items())) for each in (run.tries, run.lost))
            for chance, sets, cost, reward in every(action.factors, values):
                for shown in after_changes(task, action.changes, values, beliefs):
                    share = probability * chance * shown.chance
                    totals.cost += share * (action.cost + cost + shown.cost)
                    totals.reward += share * (reward + shown.reward)
                    after = with_knowledge(task, changed(values, sets + shown.sets), shown.beliefs)
                    key = (after, latches, tried, failed, shown.beliefs)
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
        for chance, sets, _, _ in every(task.action_by_name[node.action].factors, run.values):
            after = changed(run.values, sets)
            results[after] = results.get(after, Fraction(0)) + chance
        for after, chance in results.items():
            following = Ticking(task, after, set(finished), dict(run.tries), lost=dict(run.lost))
            waiting.append(((*history, node.action, after), following, probability * chance))
    return found
