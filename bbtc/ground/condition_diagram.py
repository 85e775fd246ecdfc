"""Conditions over the facts of a component as decision diagrams, and how likely they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce

from typing_extensions import assert_never

from bbtc.diagrams import ONE, ZERO, Diagrams, Weighted
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, in_digits
from bbtc.ground.task import Component
from bbtc.kleene import Truth

MOST_NODES_OF_BELIEFS = 4_000_000
"""So many nodes the diagrams of a component may have while beliefs are looked at."""


@dataclass(slots=True)
class ConditionDiagrams:
    """Conditions on places as functions of zeros and ones."""

    diagrams: Diagrams
    prior: int = ONE
    _nodes: dict[Condition, int] = field(default_factory=dict)

    def node(self, condition: Condition) -> int:
        """The function that is 1 where a condition is so."""
        found = self._nodes.get(condition)
        if found is None:
            found = self._nodes[condition] = self._node(condition)
        return found

    def _node(self, condition: Condition) -> int:
        diagrams = self.diagrams
        match condition:
            case Constant(value):
                return ONE if value else ZERO
            case Is(place, value):
                assert value is not Truth.UNKNOWN  # facts are two-valued
                return diagrams.cube([(place, value is Truth.TRUE)])
            case Known():
                return ONE  # what is true of a world is no secret there
            case Within():
                return self.node(in_digits(condition))
            case Not(part):
                return diagrams.complement(self.node(part))
            case And(parts):
                return reduce(lambda one, other: diagrams.product(one, other).node, map(self.node, parts))
            case Or(parts):
                none = (diagrams.complement(self.node(part)) for part in parts)
                return diagrams.complement(reduce(lambda one, other: diagrams.product(one, other).node, none))
            case _:
                assert_never(condition)

    def share(self, node: int, condition: Condition) -> tuple[int, int]:
        """The weight of the worlds of a function in which a condition is so, and that of all."""
        whole = Weighted(1, node)
        return self.diagrams.total(self.diagrams.times(whole, self.node(condition))), self.diagrams.total(
            whole
        )


def diagrams_of(component: Component) -> ConditionDiagrams:
    """The diagrams in which functions of a component's worlds are written whose prior is one, and that."""
    found = component.memo.get("diagrams")
    if not isinstance(found, ConditionDiagrams):
        assert component.diagram is not None
        diagrams = Diagrams(component.diagram.order, MOST_NODES_OF_BELIEFS)
        found = ConditionDiagrams(diagrams, diagrams.read(component.diagram))
        component.memo["diagrams"] = found
    return found
