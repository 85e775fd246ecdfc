"""Success by a time: a curve that is certainly not above the truth, and one that is certainly not below.

Durations are rounded to steps, up for the lower curve and down for the upper one. A run whose actions all
take longer ends later, so that no run is counted too soon, or too late. The upper curve is at most the lower
one a step earlier for each action of a run. Masses are floats; since only sums and products of numbers from 0
on are formed, their relative error is at most that of one rounding times the number of roundings, which is
taken off or added.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from bbtc import durations
from bbtc.belief.chain import Chain
from bbtc.durations import Taken
from bbtc.limits import Limits
from bbtc.markov import reachable
from bbtc.timing.chain import Happening

_ROUNDING = 2.0**-52
_MOST_ROUNDS = 100_000  # moves within one step
_NEGLIGIBLE = 1e-18  # mass that still moves within a step
_TINY = 1e-300  # more than what may get lost since it is too small for a float
_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Curve:
    """Bounds of the probability of success within ``number * step`` seconds, by number; ``early[n]`` is that
    of all times before the next step, too. Neither falls."""

    step: Fraction
    late: tuple[float, ...]
    early: tuple[float, ...]

    def by(self, seconds: Fraction) -> tuple[float, float]:
        """Bounds of the probability of success within so many seconds; beyond the curve, those of its end, of
        which the upper one need not hold."""
        number = min(len(self.late) - 1, int(seconds / self.step))
        return self.late[number], self.early[number]


@dataclass(frozen=True, slots=True)
class _Kernel:
    """All that takes one duration: of which states, to which, how probably; and the duration in steps."""

    sources: npt.NDArray[np.int64]
    targets: npt.NDArray[np.int64]
    chances: _Floats
    steps: _Floats


class _Flow:
    """The mass of the runs that may still succeed, step by step."""

    def __init__(
        self,
        chain: Chain,
        ways: Sequence[Sequence[Happening]],
        step: Fraction,
        most: int,
        *,
        late: bool,
    ) -> None:
        wins = {state: float(chain.won(state)) for state in chain.final if chain.won(state)}
        before: list[list[int]] = [[] for _ in chain.states]
        for state, edges in enumerate(chain.edges):
            for edge in edges:
                before[edge.successor].append(state)
        useful = reachable(wins, before.__getitem__)
        self._late = late
        self._count = len(chain.states)
        self._wins = np.zeros(self._count)
        for state, chance in wins.items():
            self._wins[state] = chance
        self._start = np.zeros(self._count)
        for probability, state in chain.initial:
            if state in useful:
                self._start[state] += float(probability)
        entries: dict[tuple[Taken, Fraction | None], list[tuple[int, int, float]]] = {}
        for state, each in enumerate(ways):
            for way in each if state in useful else ():
                rows = entries.setdefault((way.duration, way.at_most), [])
                rows += [
                    (state, target, float(way.chance * probability))
                    for target, probability in way.moves
                    if target in useful
                ]
        self._kernels = []
        for (duration, at_most), rows in entries.items():
            steps = durations.in_steps(duration, step, most, late=late, at_most=at_most)
            sources, targets, chances = zip(*rows, strict=True) if rows else ((), (), ())
            self._kernels.append(
                _Kernel(
                    np.array(sources, dtype=np.int64),
                    np.array(targets, dtype=np.int64),
                    np.array(chances, dtype=np.float64),
                    np.array([float(p) for p in steps]),
                )
            )
        self.roundings = 4 * (len(chain.states) + 8)

    def curve(self, most: int, enough: float, limits: Limits) -> list[float]:
        """The probability of success within 0, 1, 2, … steps: until it is ``enough``, at ``most`` so many."""
        width = max((len(kernel.steps) for kernel in self._kernels), default=1)
        ahead = np.zeros((width, self._count))
        ahead[0] = self._start
        total, found = 0.0, list[float]()
        for number in range(most + 1):
            if number % 64 == 0:
                limits.check_time("working out success by a time")
            row = number % width
            arrived, stuck = self._settled(ahead[row], limits)
            ahead[row] = 0
            total += float(arrived @ self._wins) + stuck
            found.append(self._bound(total, number))
            if total >= enough:
                break
            for kernel in self._kernels:
                moved = self._moved(kernel, arrived)
                targets = np.nonzero(moved)[0]
                later = len(kernel.steps) - 1
                if not len(targets) or later < 1:
                    continue
                rows = (row + np.arange(1, later + 1)) % width
                ahead[np.ix_(rows, targets)] += np.outer(kernel.steps[1:], moved[targets])
        return found

    def _settled(self, arriving: _Floats, limits: Limits) -> tuple[_Floats, float]:
        """All that is in each state within a step, once what takes no step has been taken, and what still
        moves, which counts as won where it must not count for too little."""
        total = arriving.copy()
        moving = arriving
        for number in range(_MOST_ROUNDS):
            after = np.zeros(self._count)
            for kernel in self._kernels:
                if kernel.steps[0]:
                    after += self._moved(kernel, moving) * kernel.steps[0]
            mass = float(after.sum())
            if not mass:
                return total, 0.0
            total += after
            moving = after
            self.roundings = max(self.roundings, 4 * (self._count + 8) + 4 * number)
            if mass < _NEGLIGIBLE:
                break
            if number % 1024 == 1023:
                limits.check_time("working out success by a time")
        return total, 0.0 if self._late else float(moving.sum())

    def _moved(self, kernel: _Kernel, mass: _Floats) -> _Floats:
        moved = np.zeros(self._count)
        moved += np.bincount(kernel.targets, mass[kernel.sources] * kernel.chances, self._count)
        return moved

    def _bound(self, total: float, number: int) -> float:
        """The sum, with what rounding may have added, or taken, put right."""
        width = max((len(kernel.steps) for kernel in self._kernels), default=1)
        error = _ROUNDING * (number + 1) * (self.roundings + 4 * width * (len(self._kernels) + 1))
        return max(0.0, total * (1 - error)) if self._late else min(1.0, total * (1 + error) + _TINY)


def curves(
    chain: Chain,
    ways: Sequence[Sequence[Happening]],
    step: Fraction,
    most: int,
    limits: Limits,
    *,
    enough: float = 1.0,
    success: Fraction = Fraction(1),
) -> Curve:
    """Both curves, up to ``most`` steps, or until the lower one is ``enough``. ``success`` is the probability
    of ever succeeding, which bounds both. Raises :class:`bbtc.diagnostics.LimitReached`."""
    late = _Flow(chain, ways, step, most, late=True).curve(most, enough, limits)
    early = _Flow(chain, ways, step, most, late=False).curve(len(late) - 1, 2.0, limits)
    cap = float(success)
    if Fraction(cap) < success:
        cap = float(np.nextafter(cap, 2.0))
    first = soonest(chain, ways)
    none = len(early) if first is None else min(len(early), int(first / step))
    early[:none] = [0.0] * none
    return Curve(step, tuple(_rising(late)), tuple(_rising(min(cap, each) for each in early)))


def soonest(chain: Chain, ways: Sequence[Sequence[Happening]]) -> Fraction | None:
    """The least number of seconds within which a run may succeed; None where none can (Dijkstra)."""
    best: dict[int, Fraction] = {}
    queue = [(Fraction(0), state) for probability, state in chain.initial if probability]
    heapq.heapify(queue)
    while queue:
        seconds, state = heapq.heappop(queue)
        if state in best:
            continue
        if chain.won(state):
            return seconds
        best[state] = seconds
        for way in ways[state]:
            later = seconds + durations.shortest(way.duration)
            for target, probability in way.moves:
                if target not in best and probability and way.chance:
                    heapq.heappush(queue, (later, target))
    return None


def _rising(values: Iterable[float]) -> list[float]:
    found: list[float] = []
    for value in values:
        found.append(max(value, found[-1] if found else 0.0))
    return found
