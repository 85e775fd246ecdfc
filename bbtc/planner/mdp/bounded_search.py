"""Bounds on P* that close by expanding only the states that matter.

Bounded search in the spirit of LAO* (Hansen and Zilberstein 2001) and bounded real-time dynamic
programming (Brázdil et al. 2014). The part of the space that was expanded is solved twice: with the
fringe states lost, which gives a lower bound and a policy that attains it, and with those won that are
not dead ends for sure, which gives an upper bound. End components are merged by the solver, so both are
sound and close whatever loops there are.

What to expand is found by a depth-first search first (:mod:`bbtc.planner.mdp.guided_search`), and the part
solved whenever it has become twice as large, and at the end. Where so many states do not do, whole batches
are expanded:

1. Solve. 2. Stop when the bounds have met. 3. Find the fringe states that runs of the optimistic policy
end in; among the choices that are equally good by the bounds it prefers what is solved, then the way
to the goal that the heuristic thinks short. 4. Expand them, the most probable first, and from there
greedily after the heuristic, a share of what was expanded before; repeat.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.mdp.explore import Choices, Explorer
from bbtc.planner.mdp.graph import Floats, Graph, draw_probabilities, sums
from bbtc.planner.mdp.guided_search import Guided
from bbtc.planner.mdp.h_add import Costs, Relaxation
from bbtc.planner.mdp.maxprob import Bounds, MaxProb, max_prob
from bbtc.planner.mdp.packing import Flags
from bbtc.planner.mdp.state_space import Number, StateSpace
from bbtc.planner.mdp.transitions import Index

_CLOSED = 1e-9  # bounds this close have met
SMALLEST_STEP = 256
"""States expanded at a time, at least."""

_MOST_GUIDED = 100_000
"""States expanded one policy after the other; with more, batches are faster."""

_LONG_WITHOUT = 1_000
"""States after whose expansion a search looks for any way to the goal at all, if there is no policy yet."""

_LATE = 0.5  # seconds for a last solution once the time is over
_FEW = 50_000  # states that are solved within such a time
_SHARE = 4  # else this part of those expanded before
_OFTEN = 100  # solutions in which the expanded states did not become twice as many; from then on
_LEAST_SHARE = 16  # at least this part of them is expanded
_FAR = 1e4  # what a dead end counts as, in actions
_SWEEPS = 100  # steps for which runs of the optimistic policy are followed


class Advice(Protocol):
    """What is known of a task before a search. States are packed to integers, actions numbered."""

    def decide(self, state: int) -> int | None:
        """The action to try first, if there is one."""
        ...

    def forbids(self, state: int, action: int) -> bool:
        """May an action lead to a state from which nothing is sure any more? It is tried last."""
        ...


@dataclass(frozen=True, slots=True)
class Searched:
    """What a search found: the part of the space it expanded, solved from below (``lower``; its
    policy attains the lower bound), and the bounds on P*. ``stop`` says which limit ended it before
    the bounds met, if one did; ``interrupted`` tells that the user did."""

    lower: MaxProb
    bounds: Bounds
    stop: Diagnostic | None
    interrupted: bool = False

    @property
    def space(self) -> StateSpace:
        """The part of the space."""
        return self.lower.space


@dataclass(frozen=True, slots=True)
class _Solved:
    space: StateSpace
    graph: Graph
    lower: MaxProb
    upper: MaxProb

    @property
    def bounds(self) -> Bounds:
        low = self.lower.initial.lower
        return Bounds(low, max(low, self.upper.initial.upper))


def search_bounds(
    task: Task,
    limits: Limits,
    target: Fraction | None = None,
    *,
    verdict: bool = False,
    advice: Advice | None = None,
    step: int = SMALLEST_STEP,
) -> Searched:
    """Search until the bounds on P* have met, or a policy reaches the target, or a limit is met; with
    ``verdict``, also once no policy can reach the target. ``advice`` is followed first. At least ``step``
    states are expanded at a time. Raises ``LimitReached`` only if the time is over before it begins."""
    return _Search(task, limits, target, advice, verdict=verdict, step=step).run()


class _Search:
    def __init__(
        self,
        task: Task,
        limits: Limits,
        target: Fraction | None,
        advice: Advice | None,
        *,
        verdict: bool,
        step: int,
    ) -> None:
        self.limits, self.target, self.advice = limits, target, advice
        self.verdict, self.step = verdict, step
        self.explorer = Explorer(task, limits)
        self.heuristic = Relaxation(task, limits, count_actions=True)
        self.probability: list[float] = []
        self.guess: Costs = np.empty(0, dtype=np.float32)
        self.closed: Flags = np.empty(0, dtype=np.bool_)
        """States that need not be expanded: those that were, goals, dead ends."""
        self.expanded = 0
        self.doubled_at, self.since_doubled = 1, 0
        self._note()

    def run(self) -> Searched:
        self.solved = self._solve()
        stop: Diagnostic | None = None
        try:
            self._guided()
            self._batches()
        except LimitReached as reached:
            stop = reached.diagnostics[0]
            self._solve_late()
        except KeyboardInterrupt:
            if self.explorer.count <= _FEW:
                self._solve_late()
            return Searched(self.solved.lower, self.solved.bounds, None, interrupted=True)
        return self._finished(self.solved, stop)

    def _guided(self) -> None:
        """Expand what a depth-first search for a policy visits."""
        initial = [state for _, state in self.explorer.initial]
        guided = Guided(self._found, self._probabilities, initial, self._ranks)
        self.guided = guided
        guided.note(self.guess.tolist(), self.explorer.goal().tolist())
        settled = probed = False
        before = -1
        while (
            not settled
            and self.expanded > before
            and not self._done(self.solved.bounds)
            and self.expanded < _MOST_GUIDED
        ):
            before = self.expanded
            until = max(self.step, 2 * before)

            def more(until: int = until) -> bool:
                self.limits.check_time("the search for the best probability", self.explorer.count)
                return self.expanded < until

            if self.expanded >= _LONG_WITHOUT and not self.solved.bounds.lower and not probed:
                probed = guided.probe(more)
            else:
                settled = guided.run(more)
            self.solved = self._solve()
            guided.bound(self.solved.upper.upper.tolist())

    def _found(self, states: list[int]) -> Choices:
        """Expand some states, all of them."""
        mark, done = self.explorer.mark(), 0
        known = self.explorer.count
        while done < len(states):
            done += self._expand(np.array(states[done:], dtype=np.int64))
        self.guided.note(self.guess[known:].tolist(), self.explorer.goal()[known:].tolist())
        return self.explorer.since(mark)

    def _ranks(self, found: Choices) -> list[int]:
        """How little choices are advised."""
        advice = self.advice
        if advice is None:
            return [0] * len(found.owner)
        ranks: list[int] = []
        last, bits, advised = -1, 0, None
        for owner, action in zip(found.owner.tolist(), found.action.tolist(), strict=True):
            if owner != last:
                row = self.explorer.table.states[owner].astype("<u8")
                last, bits = owner, int.from_bytes(row.tobytes(), "little")
                advised = advice.decide(bits)
            ranks.append(0 if action == advised else 2 if advice.forbids(bits, action) else 1)
        return ranks

    def _batches(self) -> None:
        """Expand whole batches, until the bounds have met."""
        while not self._done(self.solved.bounds) and self.solved.space.fringe.any():
            frontier, mass = self._frontier(self.solved)
            if not len(frontier):
                break  # the optimistic policy is a policy, and the bounds met but for rounding
            self._plunge(frontier, mass)
            self.solved = self._solve()

    def _done(self, bounds: Bounds) -> bool:
        if self.target is not None and bounds.lower >= self.target:
            return True
        if self.verdict and self.target is not None and bounds.upper < self.target:
            return True
        return bounds.upper - bounds.lower <= _CLOSED

    def _solve(self, limits: Limits | None = None) -> _Solved:
        limits = limits or self.limits
        # A limit or the user may have ended the look at what was found last: that is open.
        fringe = ~self.explorer.goal()
        fringe[: len(self.closed)] &= ~self.closed
        space = self.explorer.space(fringe, None)
        graph = Graph(space)
        lower = max_prob(space, limits, graph=graph, rationals=False)
        hope = space.goal | space.fringe
        upper = max_prob(space, limits, hope, graph=graph, rationals=False)
        solved = _Solved(space, graph, lower, upper)
        bounds = solved.bounds
        self.limits.tell(
            "search for the best probability", space.expanded, (float(bounds.lower), float(bounds.upper))
        )
        return solved

    def _solve_late(self) -> None:
        """Solve what was expanded since, though the time is over."""
        if self.solved.space.expanded < len(self.closed) - int((~self.closed).sum()):
            with contextlib.suppress(LimitReached, KeyboardInterrupt):
                self.solved = self._solve(self.limits.overtime(_LATE))

    def _finished(self, solved: _Solved, stop: Diagnostic | None) -> Searched:
        """The last solution once more, in rationals where that is possible."""
        lower, bounds = solved.lower, solved.bounds
        try:
            lower = max_prob(solved.space, self.limits, graph=solved.graph)
            low = max(bounds.lower, lower.initial.lower)
            bounds = Bounds(low, max(low, bounds.upper))
            if bounds.exact is None and bounds.upper - low <= _CLOSED:
                hope = solved.space.goal | solved.space.fringe
                upper = max_prob(solved.space, self.limits, hope, graph=solved.graph).initial.upper
                bounds = Bounds(low, max(low, min(bounds.upper, upper)))
        except LimitReached:
            pass
        except KeyboardInterrupt:
            return Searched(lower, bounds, None, interrupted=True)
        return Searched(lower, bounds, stop)

    # --- what to expand --------------------------------------------------------------------------

    def _frontier(self, solved: _Solved) -> tuple[Index, Floats]:
        """The fringe states that runs of the optimistic policy end in, the most probable first, and
        how probable they are."""
        space, graph, lower, upper = solved.space, solved.graph, solved.lower, solved.upper
        allowed = upper.best.copy()
        met = (lower.lower >= upper.upper - _CLOSED) & ~upper.prob_0 & ~space.goal
        allowed[met[graph.choice_state]] = False
        own = lower.policy[met]
        allowed[own[own >= 0]] = True
        ahead = np.where(space.fringe, np.minimum(self.guess, _FAR), 0).astype(np.int32)
        via = graph.reach(space.goal | space.fringe, allowed, ahead).via
        states, mass = _followed(space, via)
        found = np.flatnonzero(space.fringe[states])
        found = found[np.argsort(-mass[found], kind="stable")]
        return states[found], mass[found]

    def _plunge(self, frontier: Index, mass: Floats) -> None:
        """Expand fringe states, and from each follow the choice that the heuristic prefers."""
        budget = max(self.step, self.expanded // _SHARE)
        least = self.expanded + (self.expanded // _LEAST_SHARE if self._solved_often() else 0)
        share = max(1, self.step // 4, budget // 2)
        while len(frontier) and budget > 0:
            chosen = np.argsort(-mass, kind="stable")[: min(share, budget)]
            chosen = chosen[np.argsort(frontier[chosen], kind="stable")]
            states, weights = frontier[chosen], mass[chosen]
            mark = self.explorer.mark()
            budget -= self._expand(states)
            frontier, mass = self._next(self.explorer.since(mark), states, weights)
        if self.expanded < least:  # else the space would be solved too often
            waiting = np.flatnonzero(~self.closed)
            nearest = np.argsort(self.guess[waiting], kind="stable")[: least - self.expanded]
            self._expand(np.sort(waiting[nearest]))

    def _solved_often(self) -> bool:
        """Was the space solved many times since it was half as large?"""
        if self.expanded >= 2 * self.doubled_at:
            self.doubled_at, self.since_doubled = self.expanded, 0
        self.since_doubled += 1
        return self.since_doubled > _OFTEN

    def _expand(self, states: Index) -> int:
        """Expand states, in order; how many were."""
        done = self.explorer.expand(states, self.limits)
        self.expanded += done
        self.closed[states[:done]] = True
        self._note()
        return done

    def _next(self, found: Choices, states: Index, weights: Floats) -> tuple[Index, Floats]:
        """The fringe states that the preferred choices lead to, and how probable they are."""
        if not len(found.owner):
            return np.empty(0, dtype=np.int64), np.empty(0)
        self._probabilities()
        count = len(found.owner)
        choice = np.repeat(np.arange(count), found.edges)
        weight = np.array(self.probability)[found.draw]
        loops = found.successor == found.owner[choice]
        onward = np.maximum(1e-12, sums(choice[~loops], weight[~loops], count))
        ahead = np.minimum(self.guess[found.successor], _FAR).astype(np.float64)
        total = (1 + sums(choice[~loops], (weight * ahead)[~loops], count)) / onward
        order = np.lexsort((np.arange(count), total, found.owner))
        first = np.ones(count, dtype=np.bool_)
        np.not_equal(found.owner[order][1:], found.owner[order][:-1], out=first[1:])
        best = np.zeros(count, dtype=np.bool_)
        best[order[first]] = True
        edges = best[choice] & ~self.closed[found.successor]
        arrived = weights[np.searchsorted(states, found.owner)][choice] * (weight / onward[choice])
        successors, place = np.unique(found.successor[edges], return_inverse=True)
        return successors, sums(place, arrived[edges], len(successors))

    def _probabilities(self) -> list[float]:
        """Of each draw."""
        draws = self.explorer.tables.draws[len(self.probability) :]
        self.probability.extend(float(draw.probability) for draw in draws)
        return self.probability

    def _note(self) -> None:
        """Take the states that were found since into account."""
        known, count = len(self.guess), self.explorer.count
        if known == count:
            return
        guess = self.heuristic.estimate(self.explorer.packing, self.explorer.table.states[known:count])
        self.guess = np.concatenate([self.guess, guess])
        self.closed = np.concatenate([self.closed, np.isinf(guess)]) | self.explorer.goal()


def _followed(space: StateSpace, via: Number) -> tuple[Index, Floats]:
    """The states that runs visit which take the choices of ``via``, and the probability of being
    there after some steps (of having ended there, where a state has no choice)."""
    taken = np.zeros(len(space.choice_state), dtype=np.bool_)
    taken[via[via >= 0]] = True
    states = space.closure(space.start, taken)
    count = len(states)
    number = np.full(len(space.states), -1, dtype=np.int64)
    number[states] = np.arange(count)
    moving = np.flatnonzero(via[states] >= 0)
    edges = space.edges_of(via[states[moving]])
    source = number[space.choice_state[space.edge_choice[edges]]]
    successor = number[space.edge_successor[edges]]
    weight = draw_probabilities(space)[edges]
    mass = np.zeros(count)
    for probability, state in space.initial:
        mass[number[state]] += float(probability)
    resting = np.ones(count, dtype=np.bool_)
    resting[moving] = False
    for _ in range(_SWEEPS):
        after = np.where(resting, mass, 0.0) + sums(successor, mass[source] * weight, count)
        if np.abs(after - mass).max() < 1e-6:
            break
        mass = after
    return states, mass
