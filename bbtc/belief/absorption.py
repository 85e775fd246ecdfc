"""Exact expected visits and hitting probabilities of a finite Markov chain: absorption analysis (Kemeny,
Snell, "Finite Markov chains", 1960), with the linear systems solved by :mod:`bbtc.markov`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from bbtc.belief.chain import Chain
from bbtc.markov import components, distribution, solve, weighted

_ZERO = Fraction(0)
_ONE = Fraction(1)


class Absorption:
    """A chain prepared for exact questions; the component order is found once."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._rows = [
            distribution((edge.successor, edge.result.probability) for edge in edges) for edges in chain.edges
        ]
        self._components = components([tuple(row) for row in self._rows])
        component_of = [0] * len(self._rows)
        for position, component in enumerate(self._components):
            for state in component:
                component_of[state] = position
        self.endless = frozenset(
            state
            for position, component in enumerate(self._components)
            for state in component
            if self._rows[state]
            and all(component_of[successor] == position for s in component for successor in self._rows[s])
        )
        """States of a loop that nothing leaves: a run that enters it never ends."""

    def visits(self) -> list[Fraction | None]:
        """Expected number of visits of each state; None (infinite) in a loop that nothing leaves."""
        mass: list[Fraction] = [_ZERO] * len(self._rows)
        for probability, state in self.chain.initial:
            mass[state] += probability
        # v(s) = mass(s) + sum over t of v(t) P(t, s): the chain backwards, the sources first.
        into: list[dict[int, Fraction]] = [{} for _ in self._rows]
        for source, row in enumerate(self._rows):
            for successor, probability in row.items():
                into[successor][source] = probability
        leaving = [part for part in reversed(self._components) if part[0] not in self.endless]
        visits = solve(into, mass, leaving)
        assert visits is not None
        return [None if state in self.endless else visit for state, visit in enumerate(visits)]

    def entering(self) -> Fraction:
        """Probability that a run enters a loop that nothing leaves."""
        return self.start(self.hitting(dict.fromkeys(self.endless, _ONE))) if self.endless else _ZERO

    def hitting(self, known: Mapping[int, Fraction]) -> list[Fraction]:
        """h = P h with the values of ``known`` held fixed and 0 in other final or endless states:
        with 1 for the states of a set, the probability of ever reaching it from each state."""
        rows = [{} if state in known else row for state, row in enumerate(self._rows)]
        constant = [known.get(state, _ZERO) for state in range(len(rows))]
        ending = [
            part
            for part in self._components
            if part[0] not in self.endless or not known.keys().isdisjoint(part)
        ]
        values = solve(rows, constant, ending)
        assert values is not None
        return values

    def start(self, values: Sequence[Fraction]) -> Fraction:
        """The expectation of a state function over the initial states."""
        return weighted((p, values[s]) for p, s in self.chain.initial)
