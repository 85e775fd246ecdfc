"""A disturbed world as plainly as it can be written: the exact Markov chain of a tree in it, solved by value
iteration over floats, and facts that exclude each other found among all states that can be reached.

Ticks are those of ``tests/replay/reference.py``. Nothing of :mod:`bbtc.disturbance` or :mod:`bbtc.belief` is
used but what one change may lead to, which has tests of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction

import numpy as np

from bbtc.ground.task import Factor, GroundAction, Outcome, Task
from bbtc.tree.nodes import Node
from tests.replay.reference import Ticking, value_of

State = tuple[int, ...]
Counts = tuple[tuple[str, int], ...]
Key = tuple[State, tuple[str, ...], Counts, Counts]
"""Values, finished latches, and attempts made."""
After = list[tuple[float, float, Key]]
"""Chances, costs, and where they lead."""
Changes = Callable[[State], Iterable[tuple[Fraction, State]]]


def _flattened(outcome: Outcome) -> Iterator[tuple[Fraction, list[Outcome]]]:
    for picked in _picks(outcome.factors):
        yield picked[0] * outcome.probability, [outcome, *picked[1]]


def _picks(factors: tuple[Factor, ...]) -> Iterator[tuple[Fraction, list[Outcome]]]:
    ways = [[each for outcome in factor.outcomes for each in _flattened(outcome)] for factor in factors]
    for combination in itertools.product(*ways):
        chance = Fraction(1)
        for p, _ in combination:
            chance *= p
        yield chance, [outcome for _, outcomes in combination for outcome in outcomes]


def outcomes_in(action: GroundAction, state: State) -> dict[tuple[State, Fraction], Fraction]:
    """States and costs that an action leads to, and how probably."""
    found: dict[tuple[State, Fraction], Fraction] = {}
    for chance, outcomes in _picks(action.factors):
        new: dict[int, int] = {}
        cost = action.cost
        for outcome in outcomes:
            cost += outcome.cost
            cost += sum(charge.cost for charge in outcome.charges if value_of(charge.when, state) == "T")
            for effect in outcome.effects:
                if effect.when is None or value_of(effect.when, state) == "T":
                    for variable, value in effect.sets:
                        new[variable] = max(int(value), new.get(variable, 0))
        after = tuple(new.get(variable, old) for variable, old in enumerate(state))
        if chance:
            found[after, cost] = found.get((after, cost), Fraction(0)) + chance
    return found


def reachable(task: Task, most: int = 3000) -> set[State] | None:
    """All states that actions lead to; None if they are too many."""
    found = {tuple(map(int, initial.values)) for initial in task.initial if initial.probability}
    waiting = list(found)
    while waiting:
        state = waiting.pop()
        for action in task.actions:
            if value_of(action.precondition, state) == "T":
                for after, _ in outcomes_in(action, state):
                    if after not in found:
                        found.add(after)
                        waiting.append(after)
        if len(found) > most:
            return None
    return found


def best_chances(task: Task, states: set[State], sweeps: int = 3000) -> dict[State, float]:
    """The best probability of ever reaching the goal from each state, by value iteration."""
    choices = {
        state: [
            [(after, float(chance)) for (after, _), chance in outcomes_in(action, state).items()]
            for action in task.actions
            if value_of(action.precondition, state) == "T"
        ]
        for state in states
    }
    values = {state: float(value_of(task.goal, state) == "T") for state in states}
    for _ in range(sweeps):
        change = 0.0
        for state, ways in choices.items():
            best = max((sum(p * values[after] for after, p in way) for way in ways), default=0.0)
            if best > values[state]:
                change, values[state] = max(change, best - values[state]), best
        if change < 1e-13:
            break
    return values


def best_next(task: Task, state: State, values: dict[State, float]) -> float:
    """The best that one action makes of the values of the states that it leads to; 0 without any."""
    ready = (action for action in task.actions if value_of(action.precondition, state) == "T")
    ways = (outcomes_in(action, state).items() for action in ready)
    totals = (sum(float(chance) * values[after] for (after, _), chance in way) for way in ways)
    return max(totals, default=0.0)


class Exact:
    """The chances of a tree in a world that changes with a rate before each tick, within a number of
    ticks."""

    def __init__(self, task: Task, root: Node, rate: float, changes: Changes) -> None:
        self.task, self.root, self.rate, self.changes = task, root, rate, changes
        self._seen: dict[Key, tuple[str, After]] = {}

    def chances(self, ticks: int, start: State | None = None) -> dict[str, float]:
        """How probably runs end in each way, and the expected starts, unready starts and cost; from a state,
        or from the initial belief."""
        belief: dict[Key, float] = {}
        for initial in self.task.initial:
            key: Key = (tuple(map(int, initial.values)) if start is None else start, (), (), ())
            belief[key] = belief.get(key, 0.0) + float(initial.probability)
        found = dict.fromkeys(("success", "missed", "failure", "blocked", "starts", "unready", "cost"), 0.0)
        self.stops: dict[State, float] = {}
        for _ in range(ticks):
            changed: dict[Key, float] = {}
            for (state, *memory), p in belief.items():
                ways = [(float(q), after) for q, after in self.changes(state)] or [(1.0, state)]
                for q, after in [(1 - self.rate, state), *((self.rate * q, after) for q, after in ways)]:
                    key = (after, *memory)  # type: ignore[assignment]
                    changed[key] = changed.get(key, 0.0) + p * q
            belief = {}
            for key, p in changed.items():
                kind, results = self.ticked(key)
                if kind not in ("ready", "unready"):
                    found[kind] += p
                    if kind in ("failure", "blocked"):
                        self.stops[key[0]] = self.stops.get(key[0], 0.0) + p
                    continue
                found["starts"] += p
                found["unready"] += p * (kind == "unready")
                for q, cost, successor in results:
                    found["cost"] += p * q * cost
                    belief[successor] = belief.get(successor, 0.0) + p * q
        return found | {"cut": sum(belief.values())}

    def ever(self, states: Iterable[State]) -> dict[State, float]:
        """How probably runs from states ever end in success, in a world that nobody else changes, however
        long they take; of a tree without memory, and states that nothing leads out of."""
        numbers = {state: number for number, state in enumerate(states)}
        onward = np.zeros((len(numbers), len(numbers)))
        done = np.zeros(len(numbers))
        for state, number in numbers.items():
            kind, after = self.ticked((state, (), (), ()))
            done[number] = kind == "success"
            for p, _, (successor, *memory) in after:
                assert not any(memory)
                onward[number, numbers[successor]] += p
        hopeful = done > 0
        while (more := hopeful | (onward @ hopeful > 0)).sum() > hopeful.sum():
            hopeful = more
        # What never succeeds is left out, so that the system has one solution.
        going = np.flatnonzero(hopeful & (done == 0))
        values = done.copy()
        inner = np.eye(len(going)) - onward[np.ix_(going, going)]
        values[going] = np.linalg.solve(inner, onward[going] @ done)
        return {state: float(values[number]) for state, number in numbers.items()}

    def ticked(self, key: Key) -> tuple[str, After]:
        """What a tick comes to, ``ready`` or ``unready`` where it starts an action, and where that leads."""
        if key in self._seen:
            return self._seen[key]
        state, finished, tries, lost = key
        run = Ticking(self.task, state, set(finished), dict(tries), lost=dict(lost))
        status = run.tick_all(self.root)
        after: After = []
        if run.started is None:
            goal = value_of(self.task.goal, state) == "T"
            kind = {"success": "success" if goal else "missed", "running": "blocked"}.get(status, "failure")
        else:
            latched = {run.started.id} if run.started.latched else set()
            counts = tuple(sorted(run.tries.items())), tuple(sorted(run.lost.items()))
            memory = tuple(sorted(run.finished | latched)), *counts
            action = self.task.action_by_name[run.started.action]
            kind = "ready" if value_of(action.precondition, state) == "T" else "unready"
            if kind == "ready":
                for (values, cost), chance in outcomes_in(action, state).items():
                    after.append((float(chance), float(cost), (values, *memory)))
            else:
                after.append((1.0, float(action.cost), (state, *memory)))
        self._seen[key] = kind, after
        return kind, after
