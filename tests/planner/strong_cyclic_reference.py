"""Which states have a strong cyclic policy, by enumerating all states: written apart from the planner.

Source: Cimatti, Pistore, Roveri, Traverso, "Weak, strong, and strong cyclic planning via symbolic model
checking" (2003): take away what can no longer stay within the rest and reach the goal, until nothing changes.
"""

from __future__ import annotations

from bbtc.belief.draws import Values
from bbtc.belief.state import compile_action, initial_belief
from bbtc.ground.condition import evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits


def strong_cyclic_states(task: Task) -> tuple[set[Values], set[Values]]:
    """All states that are reachable, and those of them from which some policy reaches the goal for sure."""
    transitions = [(action.precondition, compile_action(task, action, Limits())) for action in task.actions]
    states = list(initial_belief(task))
    moves: dict[Values, list[frozenset[Values]]] = {}
    for state in states:
        if state in moves:
            continue
        moves[state] = []
        if evaluate(task.goal, state) is Truth.TRUE:
            continue
        for needs, results in transitions:
            if evaluate(needs, state) is Truth.TRUE:
                after = frozenset(result.values for result in results(state))
                moves[state].append(after)
                states.extend(after)
    goal = {state for state in moves if evaluate(task.goal, state) is Truth.TRUE}
    safe = set(moves)
    while True:
        reached = set(goal)
        grew = True
        while grew:
            found = {
                state
                for state in safe - reached
                if any(after <= safe and after & reached for after in moves[state])
            }
            grew = bool(found)
            reached |= found
        if reached == safe:
            return set(moves), safe
        safe = reached
