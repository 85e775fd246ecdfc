"""Recovery: what a new tree attains from any state that actions can lead to, beside the best that is
possible.

The states are all that any actions of the task lead to, those behind the goal included, or a uniform sample
of them; where facts are hidden, states of what is seen and what is believed. From each, a tree that
remembers nothing is run in the undisturbed world (but for starts without precondition,
:mod:`bbtc.disturbance.execution`), and its success probability is compared with P* of that state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from random import Random

import numpy as np

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain, explore
from bbtc.belief.draws import Values
from bbtc.belief.failures import FailureFinder
from bbtc.belief.hidden import chance_of, refuse_hidden
from bbtc.belief.tick import NodeStatus
from bbtc.disturbance.execution import careful_actions
from bbtc.disturbance.intervals import Interval, score, wilson
from bbtc.ground.condition import FALSE, Condition, compile_condition, conjunction, conjuncts, evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.mdp.contraction import contracted
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.mdp.maxprob import MaxProb, max_prob
from bbtc.planner.mdp.packing import bit_test, holds
from bbtc.planner.mdp.state_space import StateSpace
from bbtc.planner.mdp.state_table import StateTable
from bbtc.tree.nodes import Node

ALL_UP_TO = 10_000
"""Of more states than that, a sample is taken unless somebody says otherwise."""
SAMPLES = 1_000
"""States of such a sample."""

_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True)
class GivenUp:
    """Where runs stop although the goal is still in reach: ``share`` of them, counted over all starts from
    which it is, in ``states`` different states, of which ``example`` is met most often. ``condition`` is what
    they lack: false, or unknown where ``status`` is running; None where a retry node has no attempts left
    (``used_up``), or no condition failed. ``node`` is the first of those that it was found at."""

    share: Fraction
    states: int
    condition: Condition | None
    status: NodeStatus
    used_up: bool
    node: str
    example: Values


@dataclass(frozen=True, slots=True)
class Worst:
    """A state in which the tree falls short of the best by most, with what it and any policy attain."""

    state: Values
    success: Fraction
    best: Fraction


@dataclass(frozen=True, slots=True)
class Recovery:
    """What a new tree attains from states that can be reached. Of ``states`` that there are, ``taken`` were
    looked at: all, or a uniform sample. From ``hopeless`` of them nothing reaches the goal; what follows is
    about the others, ``hopeful``.

    From ``attained`` of them the tree succeeds as probably as anything can; ``mean`` is the mean of its
    success probability over the best. ``lost`` is the probability, from a state drawn uniformly, that a run
    comes to where the goal is out of reach, ``missed`` that it ends in success without the goal, ``endless``
    that it never ends, and ``given_up`` are the ways to stop short of the goal, the most frequent first.
    ``exact``: P* was found in rationals; else the figures are bounds from below, within 1e-9. The 95 %
    confidence intervals are None where all states were taken."""

    states: int
    taken: int
    seed: int
    hopeless: int
    attained: int
    mean: Fraction
    worst: Worst | None
    lost: Fraction
    missed: Fraction
    endless: Fraction
    given_up: tuple[GivenUp, ...]
    exact: bool
    attained_interval: Interval | None
    mean_interval: Interval | None

    @property
    def hopeful(self) -> int:
        """How many of the states taken can reach the goal."""
        return self.taken - self.hopeless


def recovery(
    task: Task, root: Node, limits: Limits, *, samples: int | None = None, seed: int = 0
) -> Recovery:
    """The recovery of a tree from all states, or from ``samples`` of them; by default from all if there are
    no more than :data:`ALL_UP_TO`. Raises :class:`bbtc.diagnostics.LimitReached`, also where there are more
    states than the limits allow."""
    if samples is not None and samples < 1:
        raise ValueError("there must be at least one sample")
    space = explore_space(replace(task, goal=FALSE), limits)  # so that the goal ends nothing
    space.require_complete()
    space = contracted(space, limits)
    best = max_prob(space, limits, holds(space.packing, bit_test(space.packing, task.goal), space.states))
    rows = _taken(len(space.states), samples, seed)
    hopeful = [row for row in rows if best.bounds(row).upper]
    starts = _values(space, hopeful)
    known = {values: Fraction(1, len(starts)) for values in starts}
    chain = explore(task, root, limits, careful_actions(task, root, limits), known)
    return _figures(task, root, limits, _Found(space, best, rows, hopeful, chain, seed))


def _taken(count: int, samples: int | None, seed: int) -> Sequence[int]:
    wanted = samples or (count if count <= ALL_UP_TO else SAMPLES)
    return (
        range(count) if wanted >= count else sorted(Random(f"recovery:{seed}").sample(range(count), wanted))
    )


def _values(space: StateSpace, rows: Sequence[int]) -> list[Values]:
    return space.packing.values(space.states[np.array(rows, dtype=np.int64)])


@dataclass(frozen=True, slots=True)
class _Found:
    space: StateSpace
    best: MaxProb
    rows: Sequence[int]
    hopeful: Sequence[int]
    chain: Chain
    seed: int


def _figures(task: Task, root: Node, limits: Limits, found: _Found) -> Recovery:
    chain, best = found.chain, found.best
    limits.check_time("the recovery")
    absorption, goal = Absorption(chain), compile_condition(task.goal)
    _refuse_guesses(task, chain)
    won = [
        end
        for end in chain.final
        if chain.status[end] is NodeStatus.SUCCESS and goal(chain.states[end].values) == Truth.TRUE
    ]
    success = absorption.hitting(dict.fromkeys(won, _ONE))
    ratios, worst, attained = [], None, 0
    for row, (_, start) in zip(found.hopeful, chain.initial, strict=True):
        bounds = best.bounds(row)
        ratios.append(min(_ONE, success[start] / bounds.upper))
        attained += success[start] >= bounds.lower
        if ratios[-1] < 1 and (worst is None or ratios[-1] < worst.success / worst.best):
            worst = Worst(chain.states[start].values, success[start], bounds.upper)
    mean = sum(ratios, _ZERO) / len(ratios) if ratios else _ONE
    visits = absorption.visits()
    ends = {end: visits[end] or _ZERO for end in chain.final if end not in set(won)}
    missed = sum((p for end, p in ends.items() if chain.status[end] is NodeStatus.SUCCESS), _ZERO)
    failed = [end for end in ends if chain.status[end] is not NodeStatus.SUCCESS]
    reach = _in_reach(found, failed)
    sampled = len(found.rows) < len(found.space.states) and bool(ratios)
    variance = sum(((ratio - mean) ** 2 for ratio in ratios), _ZERO) / len(ratios) if ratios else _ZERO
    return Recovery(
        states=len(found.space.states),
        taken=len(found.rows),
        seed=found.seed,
        hopeless=len(found.rows) - len(found.hopeful),
        attained=attained,
        mean=mean,
        worst=worst,
        lost=sum((ends[end] for end in failed if end not in reach), _ZERO),
        missed=missed,
        endless=absorption.entering(),
        given_up=_given_up(task, root, chain, {end: ends[end] for end in failed if end in reach}),
        exact=best.exact is not None,
        attained_interval=wilson(attained, len(ratios)) if sampled else None,
        mean_interval=score(mean, max(variance, mean * (1 - mean)), len(ratios)) if sampled else None,
    )


def _refuse_guesses(task: Task, chain: Chain) -> None:
    """P* of a state is that of who stops at a goal that he knows."""
    for end in chain.final:
        values = chain.states[end].values
        if chain.status[end] is NodeStatus.SUCCESS and 0 < chance_of(task, task.goal, values) < 1:
            refuse_hidden(
                task, "started from other states by a tree that stops where it only believes its goal"
            )


def _in_reach(found: _Found, ends: Sequence[int]) -> set[int]:
    """Those of some final states of the chain from which the goal is in reach."""
    table = StateTable(found.space.packing.words)
    table.number(found.space.states)
    packing = found.space.packing
    packed = packing.split(packing.pack(found.chain.states[end].values) for end in ends)
    rows = table.number(packed).tolist()
    return {end for end, row in zip(ends, rows, strict=True) if found.best.bounds(row).upper}


def _missing(condition: Condition, values: Values) -> Condition:
    """The conjuncts of a condition that are not true in a state."""
    return conjunction(part for part in conjuncts(condition) if evaluate(part, values) is not Truth.TRUE)


def _given_up(task: Task, root: Node, chain: Chain, ends: dict[int, Fraction]) -> tuple[GivenUp, ...]:
    finder = FailureFinder(task, root)
    groups: dict[tuple[Condition | None, NodeStatus, bool], dict[int, str]] = {}
    for end, share in ends.items():
        if share:
            stop = finder.stopped(chain.states[end])
            status = chain.status[end] if stop.status is None else stop.status
            missing = None if stop.condition is None else _missing(stop.condition, chain.states[end].values)
            key = (missing, status, missing is None and stop.node is not None)
            groups.setdefault(key, {})[end] = stop.node or root.id
    made = []
    for (condition, status, used_up), nodes in groups.items():
        by_values: dict[Values, Fraction] = {}
        for end in nodes:
            values = chain.states[end].values
            by_values[values] = by_values.get(values, _ZERO) + ends[end]
        example = min(by_values, key=lambda values: (-by_values[values], values))
        share, node = sum(by_values.values(), _ZERO), next(iter(nodes.values()))
        made.append(GivenUp(share, len(by_values), condition, status, used_up, node, example))
    return tuple(sorted(made, key=lambda group: (-group.share, group.node, group.example)))
