"""Exact expected visits and hitting probabilities of a finite Markov chain.

Strongly connected components are solved one at a time in topological order (Tarjan 1972); a
component of one state without a loop is a plain sum, so acyclic chains cost one pass. Loops are
solved by Gaussian elimination over rationals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from bbtc.belief.chain import Chain
from bbtc.markov import components

_ZERO = Fraction(0)
_ONE = Fraction(1)


class Absorption:
    """A chain prepared for exact questions; the component order is found once."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self._rows: list[dict[int, Fraction]] = []
        for edges in chain.edges:
            row: dict[int, Fraction] = {}
            for edge in edges:
                row[edge.target] = row.get(edge.target, _ZERO) + edge.result.probability
            self._rows.append(row)
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
            and all(component_of[target] == position for s in component for target in self._rows[s])
        )
        """States of a loop that nothing leaves: a run that enters it never ends."""

    def visits(self) -> list[Fraction | None]:
        """Expected number of visits of each state; None (infinite) in a loop that nothing leaves."""
        mass: list[Fraction] = [_ZERO] * len(self._rows)
        for probability, state in self.chain.initial:
            mass[state] += probability
        visits: list[Fraction | None] = [_ZERO] * len(self._rows)
        for component in reversed(self._components):  # sources first
            if component[0] in self.endless:
                for state in component:
                    visits[state] = None
                continue
            inside = set(component)
            # v(s) = mass(s) + sum over t in the component of v(t) P(t, s)
            system = {s: {t: self._rows[t][s] for t in component if s in self._rows[t]} for s in component}
            for state, value in _solve(system, {s: mass[s] for s in component}).items():
                visits[state] = value
                for target, probability in self._rows[state].items():
                    if target not in inside:
                        mass[target] += value * probability
        return visits

    def entering(self) -> Fraction:
        """Probability that a run enters a loop that nothing leaves."""
        return self.start(self.hitting(dict.fromkeys(self.endless, _ONE))) if self.endless else _ZERO

    def hitting(self, known: Mapping[int, Fraction]) -> list[Fraction]:
        """h = P h with the values of ``known`` held fixed and 0 in other final or endless states:
        with 1 for the states of a set, the probability of ever reaching it from each state."""
        values: list[Fraction] = [_ZERO] * len(self._rows)
        for component in self._components:  # sinks first
            open_states = [s for s in component if s not in known]
            for state in component:
                if state in known:
                    values[state] = known[state]
            if not open_states or (component[0] in self.endless and len(open_states) == len(component)):
                continue
            inside = set(open_states)
            system = {s: {t: p for t, p in self._rows[s].items() if t in inside} for s in open_states}
            constant = {
                s: sum((p * values[t] for t, p in self._rows[s].items() if t not in inside), _ZERO)
                for s in open_states
            }
            for state, value in _solve(system, constant).items():
                values[state] = value
        return values

    def start(self, values: Sequence[Fraction]) -> Fraction:
        """The expectation of a state function over the initial states."""
        return sum((p * values[s] for p, s in self.chain.initial), _ZERO)


def _solve(rows: dict[int, dict[int, Fraction]], constant: dict[int, Fraction]) -> dict[int, Fraction]:
    """x with x = A x + c for a substochastic A given by rows (state elimination)."""
    if len(rows) == 1:
        ((state, row),) = rows.items()
        loop = row.get(state, _ZERO)
        return {state: constant[state] / (1 - loop) if loop else constant[state]}
    order = sorted(rows)
    rows = {s: dict(rows[s]) for s in order}
    constant = dict(constant)
    for position, pivot in enumerate(order):
        row = rows[pivot]
        scale = 1 / (1 - row.pop(pivot, _ZERO))
        for target in row:
            row[target] *= scale
        constant[pivot] *= scale
        for later in order[position + 1 :]:
            factor = rows[later].pop(pivot, None)
            if factor is None:
                continue
            other = rows[later]
            for target, p in row.items():
                other[target] = other.get(target, _ZERO) + factor * p
            constant[later] += factor * constant[pivot]
    solution: dict[int, Fraction] = {}
    for state in reversed(order):
        solution[state] = constant[state] + sum((p * solution[t] for t, p in rows[state].items()), _ZERO)
    return solution
