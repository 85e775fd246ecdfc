"""The prior of a component with too many worlds to be listed, as a decision diagram."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from bbtc.diagrams import NOTHING, ZERO, Diagram, Diagrams, Weighted, good_order
from bbtc.ground.condition import Condition, variables
from bbtc.ground.condition_diagram import ConditionDiagrams
from bbtc.ground.hidden.physical import Draw
from bbtc.limits import Limits


@dataclass(frozen=True, slots=True)
class Said:
    """What is said of facts at the start; each fact has a place. Draws are made independently, facts without
    one are drawn uniformly, ``given`` ones are certain, and ``clauses``, over places, hold."""

    places: Mapping[int, int]
    given: Mapping[int, bool]
    draws: Sequence[Draw]
    clauses: Sequence[Condition]


def prior_diagram(said: Said, together: Iterable[Sequence[int]], limits: Limits) -> Diagram | None:
    """How likely the worlds of some facts are; None if no world is left. ``together`` are places that others
    will read together. Raises :class:`bbtc.diagrams.TooManyNodes`."""
    places = said.places
    read = [tuple(dict.fromkeys(variables(clause))) for clause in said.clauses]
    drawn = [tuple(places[fact] for fact in draw.variables) for draw in said.draws]
    diagrams = Diagrams(good_order(range(len(places)), [*read, *drawn, *together]), limits.diagram_nodes)
    conditions = ConditionDiagrams(diagrams)
    level = {place: at for at, place in enumerate(diagrams.order)}
    last = [max((level[place] for place in each), default=0) for each in read]
    node = diagrams.cube((places[fact], value) for fact, value in said.given.items())
    for draw, mine in zip(said.draws, drawn, strict=True):
        limits.check_time("finding worlds")
        node = diagrams.product(node, _draw(diagrams, places, draw, mine)).node
    # From the last on: so what is made stays, and is not made anew above it.
    for _, clause in sorted(zip(last, said.clauses, strict=True), key=lambda each: -each[0]):
        limits.check_time("finding worlds")
        node = diagrams.product(node, conditions.node(clause)).node
    return None if node == ZERO else diagrams.written(node)


def _draw(diagrams: Diagrams, places: Mapping[int, int], draw: Draw, mine: Sequence[int]) -> int:
    """The weights that a draw gives."""
    merged: dict[frozenset[int], Fraction] = {}
    for weight, true in draw.branches:
        if weight:
            local = frozenset(places[fact] for fact in true)
            merged[local] = merged.get(local, Fraction(0)) + weight
    scale = lcm(*(weight.denominator for weight in merged.values()))
    found = NOTHING
    for true, weight in merged.items():
        node = diagrams.cube((place, place in true) for place in mine)
        found = diagrams.sum(found, Weighted(int(weight * scale), node))
    return found.node
