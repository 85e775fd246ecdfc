"""Values of small Markov decision processes, exactly: policy iteration over rationals (Howard 1960)."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TypeAlias

Choice: TypeAlias = tuple[Fraction, list[tuple[int, Fraction]]]
"""What an action costs, and what it leads to, with probabilities."""
Row: TypeAlias = list[tuple[int, Fraction]]

_ZERO, _ONE = Fraction(0), Fraction(1)


class Mdp:
    """States by number, of which the first is where it starts: where the goal is true, and what may be done
    elsewhere."""

    def __init__(self, goals: Sequence[bool], choices: Sequence[Sequence[Choice]]) -> None:
        self.goals, self.choices = goals, choices
        self.best, self._policy = self._most_probable()

    def _most_probable(self) -> tuple[list[Fraction], dict[int, int]]:
        """The best probability of reaching the goal from each state, and a policy that attains it: values of
        a policy that no action improves are a fixed point, and so not below the best ones."""
        policy = self._nearer()
        while True:
            rows = {state: self.choices[state][number][1] for state, number in policy.items()}
            values = reached(rows, [Fraction(goal) for goal in self.goals])
            better = self._improved(policy, values, [_ZERO] * len(values), most=True)
            if better == policy:
                return values, policy
            policy = better

    def _nearer(self) -> dict[int, int]:
        """An action towards the goal for each state that has one."""
        policy: dict[int, int] = {}
        found = {state for state, goal in enumerate(self.goals) if goal}
        size = -1
        while size < len(found):
            size = len(found)
            for state, choices in enumerate(self.choices):
                for number, (_, after) in enumerate(choices):
                    if state not in found and any(each in found for each, _ in after):
                        policy[state] = number
                        found.add(state)
        return policy

    def _improved(
        self, policy: dict[int, int], values: list[Fraction], costs: list[Fraction], *, most: bool
    ) -> dict[int, int]:
        found = dict(policy)
        for state, own in policy.items():
            best, at = values[state] if most else costs[state], own
            for number, (cost, after) in enumerate(self.choices[state]):
                if most:
                    value = _mean(values, after)
                    if value > best:
                        best, at = value, number
                elif _mean(values, after) == values[state]:
                    value = cost + _mean(costs, after)
                    if value < best:
                        best, at = value, number
            found[state] = at
        return found

    def least_cost(self) -> Fraction:
        """The least expected cost of reaching the goal with the best probability, which ends where it is out
        of reach. All costs are above 0, so what improves a policy that ends is one that ends."""
        policy = {state: number for state, number in self._policy.items() if self.best[state]}
        while True:
            rows = {state: self.choices[state][number][1] for state, number in policy.items()}
            paid = [_ZERO] * len(self.goals)
            for state, number in policy.items():
                paid[state] = self.choices[state][number][0]
            costs = solved(rows, paid)
            better = self._improved(policy, self.best, costs, most=False)
            if better == policy:
                return costs[0]
            policy = better


def _mean(values: Sequence[Fraction], after: Row) -> Fraction:
    return sum((p * values[state] for state, p in after), _ZERO)


def reached(rows: dict[int, Row], ends: Sequence[Fraction]) -> list[Fraction]:
    """The expected value of where each state ends, 0 where it never does. States without a row are ends."""
    back: dict[int, list[int]] = {}
    for state, after in rows.items():
        for each, p in after:
            if p:
                back.setdefault(each, []).append(state)
    ending = {state for state in range(len(ends)) if state not in rows}
    waiting = list(ending)
    while waiting:
        for state in back.get(waiting.pop(), ()):
            if state not in ending:
                ending.add(state)
                waiting.append(state)
    some = {state: after for state, after in rows.items() if state in ending}
    values = [value if state in ending and state not in rows else _ZERO for state, value in enumerate(ends)]
    return solved(some, values)


def solved(rows: dict[int, Row], added: Sequence[Fraction]) -> list[Fraction]:
    """The solution of x = P x + added, where states without a row have the value added; every state that has
    a row must lead out of them. Gauss-Jordan, one state after the other."""
    system: dict[int, tuple[dict[int, Fraction], Fraction]] = {}
    for state, after in rows.items():
        left: dict[int, Fraction] = {state: _ONE}
        right = added[state]
        for each, p in after:
            if each in rows:
                left[each] = left.get(each, _ZERO) - p
            else:
                right += p * added[each]
        system[state] = left, right
    order = sorted(system, reverse=True)
    uses: dict[int, set[int]] = {}
    for state, (left, _) in system.items():
        for each in left:
            uses.setdefault(each, set()).add(state)
    for pivot in order:
        left, right = system[pivot]
        scale = left.pop(pivot)
        left = {each: value / scale for each, value in left.items() if value}
        right /= scale
        system[pivot] = left, right
        for state in uses[pivot] - {pivot}:
            other, constant = system[state]
            factor = other.pop(pivot, _ZERO)
            if factor:
                for each, value in left.items():
                    other[each] = other.get(each, _ZERO) - factor * value
                    uses[each].add(state)
                system[state] = other, constant - factor * right
    return [system[state][1] if state in system else added[state] for state in range(len(added))]
