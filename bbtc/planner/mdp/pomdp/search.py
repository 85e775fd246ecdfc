"""Heuristic search value iteration for the best probability of reaching a goal (HSVI: Smith and Simmons 2004;
for reachability without discounting: Ho et al. 2024).

Beliefs are visited where the bounds on P* (:mod:`bbtc.planner.mdp.pomdp.bounds`) are wide and a robot might
come:

1. *Trial*: from the start, by the action with the highest upper bound, to the belief where the gap weighs
   most, down to one that was not visited. Actions that are equally good are tried those first that get on.
   A belief is entered once in a trial.
2. *Rollout*: the same by the action that gets on fastest; it finds the first ways to the goal.
3. On the way back the bounds of each belief are made those of its best action, and it becomes a point and
   gives a vector.
4. *Sweeps*: the beliefs that the best known policy visits, and those beside them, are worked on again and
   again, the last first, until nothing gets better: a policy that tries again is worth what it is only then.
   Where nothing is known, the robot acts as one in haste that sees all would on the average of the worlds
   (QMDP: Littman, Cassandra, Kaelbling 1995).
5. Where a trial finds nothing new, the upper bounds of an end component hold each other up: it is worth no
   more than the best that leaves it (*deflation*: Křetínský et al. 2018). Where that changes nothing
   either, beliefs count that weigh less.

Numbers are floating-point ones. Beliefs whose weights agree to 40 bits count as one.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import count
from typing import NamedTuple, TypeAlias

import numpy as np

from bbtc.limits import Limits
from bbtc.planner.mdp.graph import Floats, Graph
from bbtc.planner.mdp.pomdp.bounds import Lower, Upper, Vector
from bbtc.planner.mdp.pomdp.informed import NEVER, hasty, informed
from bbtc.planner.mdp.pomdp.model import Doing, Pomdp, Told
from bbtc.planner.mdp.pomdp.processes import Choice, process

ERROR = 1e-8
"""What rounding, and beliefs that are not told apart, may add to a bound at most."""

_DOING = "the search for the best probability"
_CLOSED = 1e-7
_TIE = 1e-7  # actions whose bounds are closer are equally good
_PROGRESS = 1e-3  # of the gap, by which an upper bound must fall for a new beginning
_PATIENCE = 40  # trials in which nothing was found, and no bound moved
_NEWS = 1e-8  # a vector that attains no more than this more is not kept
_STEP = 1e-6  # a bound that fell by less is not kept once more
_WEIGHT = 0.02  # of the gap, that a belief must have to be visited
_LEAST_WEIGHT = 1e-9
_OF_ROLLOUTS = 0.05  # of that, in a rollout
_LONGEST = 1000
_FOLLOWED = 400  # beliefs that a policy visits which are swept
_LOST = 1e-6  # they are visited more often than this
_SWEEPS = 60
_BETTER = 1e-5  # that a sweep must make some belief, for another one
_LOOK = 16  # beliefs of a class that are visited between two looks at the clock
_PLACES = 7  # in which figures agree that count as equal
_DROPPED_BITS = 53 - 40


class After(NamedTuple):
    """Something that may be told after an action: how probable it is, and the belief then."""

    told: Told
    probability: float
    node: Node


class Way(NamedTuple):
    """An action in a belief."""

    doing: Doing
    after: tuple[After, ...]

    @property
    def upper(self) -> float:
        """An upper bound on what it attains."""
        return sum(each.probability * each.node.upper for each in self.after)

    @property
    def haste(self) -> float:
        """How fast it gets on."""
        return sum(each.probability * each.node.haste for each in self.after)


@dataclass(slots=True, eq=False)
class Node:
    """A belief: a class and weights that sum to 1, bounds on its value, and what it is worth to a robot in
    haste. ``ways`` are what can be done, once it was visited."""

    where: int
    weights: Floats
    lower: float
    upper: float
    haste: float
    ways: tuple[Way, ...] | None = None
    place: int | None = None
    """Its place among the points."""
    kept: float = 2.0
    """The upper bound that is kept there."""

    @property
    def gap(self) -> float:
        """How far the bounds are apart."""
        return self.upper - self.lower


_Path: TypeAlias = list[tuple[Node, float]]
"""Beliefs, one after the other, each with the probability of what is told to get there."""


class Search:
    """A search on a process, whose bounds hold from the start. Raises ``LimitReached``."""

    def __init__(self, pomdp: Pomdp, limits: Limits) -> None:
        self.pomdp, self._limits = pomdp, limits
        bounds = informed(pomdp, limits)
        self._haste = hasty(pomdp, bounds, limits)
        self._lower = [Lower(each) for each in pomdp.classes]
        self._upper = [Upper(rows, each) for rows, each in zip(bounds, pomdp.classes, strict=True)]
        self._visited: list[list[Floats]] = [[] for _ in pomdp.classes]
        self._nodes: dict[tuple[int, bytes], Node] = {}
        self._roots = [(float(p), self._node(where, weights)) for p, where, weights in pomdp.initial]

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds on P*; rounding may have moved them by :data:`ERROR`."""
        low = sum(p * node.lower for p, node in self._roots)
        return low, max(low, sum(p * node.upper for p, node in self._roots))

    def run(self, target: Fraction | None, limits: Limits, *, verdict: bool) -> None:
        """Search until the bounds have met, or reach a target, or with ``verdict`` leave it behind. Raises
        ``LimitReached``; what was found until then stays."""
        self._limits = limits
        share, waited = _WEIGHT, 0
        swept = 0
        while waited < _PATIENCE and not self._done(target, verdict=verdict):
            low, high = self.bounds
            limits.check_time(_DOING, len(self._nodes))
            limits.tell(_DOING, len(self._nodes), (low, high))
            if len(self._nodes) >= 2 * swept:
                self._sweep()
                swept = len(self._nodes)
            found = self._trial(share * (high - low))
            self._rollout(_OF_ROLLOUTS * share * (high - low))
            fell = 0.0 if found else self._deflate()
            onward = found or fell > _PROGRESS * (high - low)
            share = _WEIGHT if onward else max(_LEAST_WEIGHT, share / 4)
            waited = 0 if found or self.bounds != (low, high) else waited + 1

    def _done(self, target: Fraction | None, *, verdict: bool) -> bool:
        low, high = self.bounds
        if target is not None and (low - ERROR >= target or (verdict and high + ERROR < target)):
            return True
        return high - low <= _CLOSED

    def best(self, where: int, weights: Floats) -> Vector:
        """The best that is known to do in a belief."""
        return self._lower[where].best(weights)[1]

    # --- beliefs ---------------------------------------------------------------------------------

    def _node(self, where: int, weights: Floats) -> Node:
        key = where, _rounded(weights)
        found = self._nodes.get(key)
        if found is not None:
            return found
        has = weights > 0
        if any(met[has].all() for met in self.pomdp.classes[where].goals):
            found = Node(where, weights, 1.0, 1.0, 1.0)
        else:
            low = max(0.0, self._lower[where].best(weights)[0])
            haste = max(0.0, float((self._haste[where] @ weights).max(initial=0.0)))
            found = Node(where, weights, low, max(low, self._upper[where].value(weights)), haste)
        self._nodes[key] = found
        return found

    def _visit(self, node: Node) -> None:
        visited = self._visited[node.where]
        self._limits.check_states(len(self._nodes), _DOING)
        if len(visited) % _LOOK == 0:
            self._limits.check_time(_DOING, len(self._nodes))
        has = node.weights > 0
        ways = []
        if node.lower < 1.0:
            for doing in self.pomdp.classes[node.where].doings:
                if doing.applies[has].all():
                    after = tuple(self._after(node, doing))
                    if any(each.node is not node for each in after):
                        ways.append(Way(doing, after))
        node.ways = tuple(ways)
        visited.append(node.weights)

    def _after(self, node: Node, doing: Doing) -> Iterable[After]:
        for told in doing.told:
            weights = told.weights(node.weights)
            probability = float(weights.sum())
            if probability > 0.0:
                yield After(told, probability, self._node(told.after, weights / probability))

    # --- bounds ----------------------------------------------------------------------------------

    def _back_up(self, node: Node) -> None:
        if not node.ways:
            node.upper = node.lower
            return
        self._lowered(node, max(way.upper for way in node.ways))
        found = [(*self._worth(way), way) for way in node.ways]
        worth, best, way = max(found, key=lambda each: (round(each[0], _PLACES), -each[2].doing.action))
        lower = self._lower[node.where]
        if worth > lower.best(node.weights)[0] + _NEWS:
            lower.add(self._vector(node, way, best), self._visited[node.where])
        node.lower = max(node.lower, worth)

    def _lowered(self, node: Node, upper: float) -> None:
        node.upper = max(node.lower, min(node.upper, upper))
        if node.upper < node.kept - _STEP:
            node.place = self._upper[node.where].keep(node.weights, node.upper, node.place)
            node.kept = node.upper

    def _worth(self, way: Way) -> tuple[float, dict[int, Vector]]:
        """What an action and then the best known vectors attain, and those vectors, by what is told."""
        worth, best = 0.0, {}
        for told, probability, after in way.after:
            value, best[id(told)] = self._lower[after.where].best(after.weights)
            worth += probability * value
        return worth, best

    def _vector(self, node: Node, way: Way, best: Mapping[int, Vector]) -> Vector:
        worlds = self.pomdp.classes[node.where].worlds
        after = tuple(best.get(id(told), self._lower[told.after].nothing) for told in way.doing.told)
        values = np.zeros(worlds)
        for told, vector in zip(way.doing.told, after, strict=True):
            values += told.worth(vector.values, worlds)
        return Vector(np.where(way.doing.applies & (values > -1.0), values, NEVER), way.doing, after)

    # --- where to look ---------------------------------------------------------------------------

    def _start(self) -> tuple[Node, float]:
        probability, node = max(self._roots, key=lambda each: each[0] * each[1].gap)
        return node, probability

    def _trial(self, least: float) -> bool:
        """Was a belief visited that had not been?"""
        path: _Path = [self._start()]
        entered = {id(path[0][0])}
        found = False
        while path:
            node, chance = path[-1]
            if node.ways is None:
                self._visit(node)
                found = True
            step = None if len(path) == _LONGEST else self._step(node, chance, entered, least)
            if step is not None:
                entered.add(id(step[0]))
                path.append(step)
                continue
            if found:
                break
            path.pop()
            self._back_up(node)
        for node, _ in reversed(path):
            self._back_up(node)
        return found

    def _step(self, node: Node, chance: float, entered: set[int], least: float) -> tuple[Node, float] | None:
        """The belief to go on with; None where there is none that matters."""
        for way in self._best(node):
            step = _widest(way, chance, entered)
            if step is not None and step[1] * step[0].gap >= least:
                return step
        return None

    def _best(self, node: Node) -> list[Way]:
        """The actions with the highest upper bound."""
        if not node.ways:
            return []
        looked: set[int] = set()
        while True:
            worth = [way.upper for way in node.ways]
            top = max(worth) - _TIE
            best = [way for way, each in zip(node.ways, worth, strict=True) if each >= top]
            best.sort(key=_by_haste)
            if id(best[0]) in looked:
                return best
            looked.add(id(best[0]))
            for each in best[0].after:  # what was found since may bound them, too
                after = each.node
                if after.ways is None and after.gap > 0:
                    self._lowered(after, self._upper[after.where].value(after.weights))

    def _rollout(self, least: float) -> None:
        path: _Path = [self._start()]
        entered = {id(path[0][0])}
        while len(path) < _LONGEST:
            node, chance = path[-1]
            if node.ways is None:
                self._visit(node)
            if not node.ways:
                break
            step = _widest(min(node.ways, key=_by_haste), chance, entered)
            if step is None or step[1] * step[0].gap < least:
                break
            entered.add(id(step[0]))
            path.append(step)
        for node, _ in reversed(path):
            self._back_up(node)

    def _sweep(self) -> None:
        """Raise the lower bounds of what the best known policy visits, and of what is beside it."""
        nodes = self._followed()
        for node in nodes[:]:
            nodes += [each.node for way in node.ways or () for each in way.after]
        beside = [node for node in dict.fromkeys(nodes) if node.lower < 1.0]
        for node in beside:
            if node.ways is None:
                self._visit(node)
        for _ in range(_SWEEPS):
            better = 0.0
            for node in reversed(beside):
                before = node.lower
                self._back_up(node)
                better = max(better, node.lower - before)
            self._limits.check_time(_DOING, len(self._nodes))
            if better < _BETTER:
                break

    def _followed(self) -> list[Node]:
        """Beliefs that runs of the best known policy visit, the most probable first."""
        order = count()
        waiting = [(-p, next(order), node) for p, node in self._roots]
        heapq.heapify(waiting)
        found: dict[Node, None] = {}
        while waiting and len(found) < _FOLLOWED:
            weight, _, node = heapq.heappop(waiting)
            if node in found:
                continue
            found[node] = None
            if node.ways is None:
                self._visit(node)
            if node.ways:
                worth = [round(self._worth(way)[0], _PLACES) for way in node.ways]
                best = max(worth)
                ways = [way for way, each in zip(node.ways, worth, strict=True) if each == best]
                for each in min(ways, key=_by_haste).after:
                    if weight * each.probability < -_LOST:
                        heapq.heappush(waiting, (weight * each.probability, next(order), each.node))
        return list(found)

    def _deflate(self) -> float:
        """How far the upper bound of an end component fell, at most."""
        nodes = list(self._nodes.values())
        number = {id(node): at for at, node in enumerate(nodes)}
        ways = [(at, way) for at, node in enumerate(nodes) if node.ways and node.gap > 0 for way in node.ways]
        if not ways:
            return 0.0
        choices = [
            Choice(at, [number[id(e.node)] for e in way.after], [e.probability for e in way.after])
            for at, way in ways
        ]
        space = process(self.pomdp.task, np.zeros(len(nodes), dtype=np.bool_), choices)
        best = np.array([way.upper >= nodes[at].upper - _TIE for at, way in ways])
        fell = 0.0
        for component in Graph(space).end_components(best):
            inside = [nodes[at] for at in component]
            members = set(map(id, inside))
            leaving = [
                way.upper
                for node in inside
                for way in node.ways or ()
                if any(id(each.node) not in members for each in way.after)
            ]
            worth = max(leaving, default=0.0)
            for node in inside:
                fell = max(fell, node.upper - worth)
                self._lowered(node, worth)
        return fell


def _by_haste(way: Way) -> tuple[float, int]:
    """What gets on fastest comes first; of equals the same everywhere, which makes runs of one action."""
    return -round(way.haste, _PLACES), way.doing.action


def _widest(way: Way, chance: float, entered: set[int]) -> tuple[Node, float] | None:
    """Where the gap weighs most after an action, of beliefs that were not entered."""
    ahead = [each for each in way.after if id(each.node) not in entered]
    if not ahead:
        return None
    most = max(ahead, key=lambda each: each.probability * each.node.gap)
    return most.node, chance * most.probability


def _rounded(weights: Floats) -> bytes:
    bits = weights.view(np.int64)
    return bytes(((bits + (1 << _DROPPED_BITS - 1)) >> _DROPPED_BITS).tobytes())
