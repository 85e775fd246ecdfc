"""Scenarios: the single runs a tree can take, the most probable first; and sampled ones."""

from __future__ import annotations

import heapq
import itertools
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.chain import Chain
from bbtc.belief.draws import Values
from bbtc.belief.tick import NodeStatus
from bbtc.limits import Limits
from bbtc.markov import distribution, reachable
from bbtc.tree.nodes import ActionNode


@dataclass(frozen=True, slots=True)
class ScenarioStep:
    """An action that was started, and the values of the variables after its outcome."""

    node: ActionNode
    values: Values


@dataclass(frozen=True, slots=True)
class Scenario:
    """One run: where it starts, what it does, how it ends (running: blocked)."""

    probability: Fraction
    initial: Values
    steps: tuple[ScenarioStep, ...]
    status: NodeStatus
    end: int
    """The state of the chain that it ends in."""
    visited: tuple[int, ...] = ()
    """All of them, in order."""

    @property
    def final(self) -> Values:
        """The values of the variables at the end."""
        return self.steps[-1].values if self.steps else self.initial


_LOOK = 8  # steps between two looks at the clock: probabilities may have very many digits
_LISTING = "the listing of runs"

_Path = tuple[int, "_Path | None"]  # last state, and the path before it


def scenarios(chain: Chain, limits: Limits, *, failing: bool = False) -> Iterator[Scenario]:
    """Every scenario in order of decreasing probability (ties in breadth-first order of the
    states). Endless where the chain has loops: take as many as needed. Runs that never end are none.
    ``failing``: only those that end without success, however rare they are among the others (ties depth
    first, so that the first of many comes soon).

    Raises :class:`bbtc.diagnostics.LimitReached` past the limits on states (here: of steps in runs) and
    time: of an action that nearly always fails and is tried again, each run is nearly as probable as the
    one before.
    """
    ends = [end for end in chain.final if not failing or chain.status[end] is not NodeStatus.SUCCESS]
    best = _best_ends(chain, ends, limits) if failing else dict.fromkeys(_ending(chain, ends), Fraction(1))
    # By the best that a beginning may still become; of all runs, by what it is: each soon comes to an end.
    queue: list[tuple[Fraction, int, Fraction, _Path]] = []
    order = itertools.count(0, -1 if failing else 1)
    for probability, state in chain.initial:
        if state in best and probability:
            heapq.heappush(queue, (-probability * best[state], next(order), probability, (state, None)))
    for step in itertools.count():
        if not queue:
            return
        if step % _LOOK == 0:
            limits.check_time(_LISTING, step)
        if step > limits.states:
            limits.check_states(step, _LISTING)
        _, _, reached, path = heapq.heappop(queue)
        if not chain.edges[path[0]]:
            yield _scenario(chain, reached, path)
        for successor, probability in _merged(chain, path[0]).items():
            if successor in best:
                now = reached * probability
                heapq.heappush(queue, (-now * best[successor], next(order), now, (successor, path)))


def _merged(chain: Chain, state: int) -> dict[int, Fraction]:
    """Where a step leads: results that differ in cost or reward only are one."""
    return distribution((edge.successor, edge.result.probability) for edge in chain.edges[state])


def _best_ends(chain: Chain, ends: Sequence[int], limits: Limits) -> dict[int, Fraction]:
    """The probability of the most probable way to one of the ends, for each state that has one (Dijkstra,
    from the ends back)."""
    before: list[list[tuple[int, Fraction]]] = [[] for _ in chain.states]
    for state in range(len(chain.states)):
        for successor, probability in _merged(chain, state).items():
            before[successor].append((state, probability))
    best: dict[int, Fraction] = {}
    queue = [(Fraction(-1), end) for end in ends]
    heapq.heapify(queue)
    while queue:
        negative, state = heapq.heappop(queue)
        if state in best:
            continue
        if len(best) % _LOOK == 0:
            limits.check_time(_LISTING)
        best[state] = -negative
        for earlier, probability in before[state]:
            if earlier not in best and probability:
                heapq.heappush(queue, (negative * probability, earlier))
    return best


def _ending(chain: Chain, ends: Sequence[int]) -> set[int]:
    """The states from which a run may come to one of the ends."""
    before: list[list[int]] = [[] for _ in chain.states]
    for state, edges in enumerate(chain.edges):
        for edge in edges:
            before[edge.successor].append(state)
    return reachable(ends, before.__getitem__)


def _scenario(chain: Chain, probability: Fraction, path: _Path) -> Scenario:
    visited = []
    at: _Path | None = path
    while at is not None:
        visited.append(at[0])
        at = at[1]
    visited.reverse()
    return Scenario(
        probability=probability,
        initial=chain.states[visited[0]].values,
        steps=tuple(
            ScenarioStep(chain.actions[chain.action[before]], chain.states[after].values)
            for before, after in itertools.pairwise(visited)
        ),
        status=chain.status[visited[-1]],
        end=visited[-1],
        visited=tuple(visited),
    )


@dataclass(frozen=True, slots=True)
class Sampling:
    """Result of a Monte Carlo run: how many of ``samples`` runs succeeded."""

    samples: int
    seed: int
    successes: int
    cut: int
    """Runs stopped after ``max_steps`` actions without an end."""


def sample(chain: Chain, samples: int, seed: int, limits: Limits, max_steps: int = 100_000) -> Sampling:
    """Simulate ``samples`` runs with a seeded generator; the same seed gives the same result. Raises
    :class:`bbtc.diagnostics.LimitReached` when the time is over."""
    generator = random.Random(seed)
    successes = cut = 0
    starts = _cumulative(chain.initial)
    moves = [_cumulative([(e.result.probability, e.successor) for e in edges]) for edges in chain.edges]
    for _ in range(samples):
        limits.check_time("sampling")
        state = _draw(generator, starts)
        for step in range(max_steps):
            if step % 1024 == 1023:
                limits.check_time("sampling")
            if not moves[state]:
                successes += chain.status[state] is NodeStatus.SUCCESS
                break
            state = _draw(generator, moves[state])
        else:
            cut += 1
    return Sampling(samples, seed, successes, cut)


def _cumulative(pairs: Sequence[tuple[Fraction, int]]) -> list[tuple[Fraction, int]]:
    total = Fraction(0)
    cumulative = []
    for probability, value in pairs:
        total += probability
        cumulative.append((total, value))
    return cumulative


def _draw(generator: random.Random, cumulative: list[tuple[Fraction, int]]) -> int:
    point = Fraction(generator.getrandbits(64), 1 << 64)
    for bound, value in cumulative:
        if point < bound:
            return value
    return cumulative[-1][1]
