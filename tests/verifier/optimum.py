"""The best probability of reaching a label in a Markov decision process, exactly: policy iteration
over rationals (Howard 1960), from a policy that reaches it wherever any policy can."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from bbtc.limits import Limits
from bbtc.verifier.explore import Space, Step
from bbtc.verifier.solve import Solver

_ZERO, _ONE = Fraction(0), Fraction(1)


def best_probability(space: Space, limits: Limits, label: str = "goal") -> Fraction:
    """The greatest probability of reaching the label from the initial state. Raises
    ``LimitReached``."""
    goal = space.labels[label]
    choices = [[steps for _, steps in enabled if steps] for enabled in space.choices]
    policy = _first_policy(choices, goal)
    while True:
        solver = Solver([() if choice is None else choice for choice in policy], goal, limits)
        (values,) = solver.solve([dict.fromkeys(goal, _ONE)], None)
        improved = False
        for state, possible in enumerate(choices):
            best = values[state]
            for steps in possible if state not in goal else ():
                value = sum((step.probability * values[step.successor] for step in steps), _ZERO)
                if value > best:
                    best, policy[state], improved = value, steps, True
        if not improved:
            return values[0]


def _first_policy(
    choices: Sequence[Sequence[tuple[Step, ...]]], goal: frozenset[int]
) -> list[tuple[Step, ...] | None]:
    """For each state a choice that may bring it closer to the goal; None where there is none."""
    into: list[list[tuple[int, tuple[Step, ...]]]] = [[] for _ in choices]
    for state, possible in enumerate(choices):
        for steps in possible:
            for step in steps:
                if step.probability:
                    into[step.successor].append((state, steps))
    policy: list[tuple[Step, ...] | None] = [None] * len(choices)
    found = sorted(goal)
    seen = set(found)
    for successor in found:  # grows while it is read: breadth first
        for state, steps in into[successor]:
            if state not in seen:
                seen.add(state)
                policy[state] = steps
                found.append(state)
    return policy
