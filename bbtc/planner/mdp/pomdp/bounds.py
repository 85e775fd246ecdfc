"""Two bounds on the value of beliefs, which close as beliefs are visited.

From below, *vectors*: what a way to go on attains from each world (``NEVER`` where it cannot be followed);
the best of them bounds a belief. From above, *points*: beliefs with bounds on their value. The value is
convex, so that a belief which holds a share of a point is worth no more than that share of the point and
the rest in known worlds (the sawtooth bound: Hauskrecht 2000).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bbtc.planner.mdp.graph import Floats
from bbtc.planner.mdp.pomdp.informed import NEVER
from bbtc.planner.mdp.pomdp.model import Class, Doing

_GAIN = 1e-9
"""What tells no more than this is not kept."""

_FEW = 64


class _Rows:
    """A matrix that grows by rows."""

    def __init__(self, width: int) -> None:
        self._array = np.empty((16, width))
        self.count = 0

    @property
    def rows(self) -> Floats:
        return self._array[: self.count]

    def add(self, row: Floats | float) -> int:
        if self.count == len(self._array):
            self._array = np.concatenate([self._array, np.empty_like(self._array)])
        self._array[self.count] = row
        self.count += 1
        return self.count - 1


@dataclass(frozen=True, slots=True, eq=False)
class Vector:
    """A way to go on, and what it attains from each world: an action, then another way for each thing that
    may be told. Without an action, it is to stop."""

    values: Floats
    doing: Doing | None = None
    after: tuple[Vector, ...] = ()


class Lower:
    """The vectors of a class."""

    def __init__(self, where: Class) -> None:
        goals = (np.where(met, 1.0, NEVER) for met in where.goals)
        self.nothing = Vector(np.zeros(where.worlds))
        self._stops = [self.nothing, *map(Vector, goals)]
        self._next_look = _FEW
        self._take(self._stops)

    def _take(self, vectors: list[Vector]) -> None:
        self._vectors = vectors
        self._rows = _Rows(len(self.nothing.values))
        for each in vectors:
            self._rows.add(each.values)

    def best(self, weights: Floats) -> tuple[float, Vector]:
        """What the best vector is worth for some weights, and the vector."""
        worth = self._rows.rows @ weights
        at = int(worth.argmax())
        return float(worth[at]), self._vectors[at]

    def add(self, vector: Vector, visited: Sequence[Floats]) -> None:
        """Keep a vector; now and then those are dropped that are the best for no belief that was visited."""
        self._vectors.append(vector)
        self._rows.add(vector.values)
        if len(self._vectors) < self._next_look:
            return
        best = (self._rows.rows @ np.array(visited).T).argmax(axis=0)
        used = np.union1d(best, np.arange(len(self._stops)))
        self._take([self._vectors[at] for at in used.tolist()])
        self._next_look = max(_FEW, 2 * len(used))


class Upper:
    """The points of a class, beside what bounds it from the start
    (:mod:`bbtc.planner.mdp.pomdp.informed`)."""

    def __init__(self, informed: Floats, where: Class) -> None:
        self._informed = informed
        self._corners = np.maximum(informed.max(axis=0, initial=0.0), 0.0)
        """What known worlds are worth."""
        self._inverse = _Rows(where.worlds)
        """One by the weights of the points, infinite where there is none."""
        self._worlds: npt.NDArray[np.uint8] = np.empty((16, -(-where.worlds // 8)), dtype=np.uint8)
        """The worlds that points have, as bits."""
        self._gain = np.empty(16)
        """How much less points are worth than the known worlds in them."""

    def value(self, weights: Floats) -> float:
        """A bound for weights that sum to 1."""
        bound = min(1.0, float((self._informed @ weights).max(initial=0.0)))
        count = self._inverse.count
        within = ~(self._worlds[:count] & ~np.packbits(weights > 0)).any(axis=1)
        rows = np.flatnonzero(within)
        if not len(rows):
            return bound
        inside = np.flatnonzero(weights)
        shares = (self._inverse.rows[np.ix_(rows, inside)] * weights[inside]).min(axis=1)
        return min(bound, max(0.0, float(self._corners @ weights + (shares * self._gain[rows]).min())))

    def keep(self, weights: Floats, value: float, place: int | None) -> int | None:
        """Keep a point, at its ``place`` if it was kept before, unless it tells no more than the known worlds
        in it; its place."""
        gain = value - float(self._corners @ weights)
        if gain > -_GAIN:
            return place
        if place is None:
            with np.errstate(divide="ignore"):
                place = self._inverse.add(1.0 / weights)
            if place == len(self._gain):
                self._gain = np.concatenate([self._gain, np.empty_like(self._gain)])
                self._worlds = np.concatenate([self._worlds, np.empty_like(self._worlds)])
            self._worlds[place] = np.packbits(weights > 0)
        self._gain[place] = gain
        return place
