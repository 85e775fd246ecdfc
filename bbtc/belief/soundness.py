"""The five soundness invariants of a tree (semantics page, "Post-checks")."""

from __future__ import annotations

from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain
from bbtc.belief.tick import NodeStatus
from bbtc.ground.condition import evaluate
from bbtc.ground.task import Task
from bbtc.kleene import Truth


def violations(task: Task, chain: Chain) -> list[str]:
    """Every way in which the chain breaks an invariant, in words; empty for a sound tree.

    1. An action is only started where its precondition is true. 2. Root success implies the goal, where
    nothing is hidden; else what is taken for true and is not is counted
    (:attr:`bbtc.belief.simulate.Figures.mistaken`).
    3. The probabilities of the ways to end sum to 1. 4. A tree of latched actions halts. 5. No action that
    runs is given up while nothing changes: what it would have done is no outcome of its then.
    """
    found: dict[str, None] = {}
    for state, action in zip(chain.states, chain.action, strict=True):
        if action >= 0:
            name = chain.actions[action].action
            if evaluate(task.action_by_name[name].precondition, state.values) is not Truth.TRUE:
                found[f"{name} is started where its precondition is not true"] = None
    for index in chain.final:
        holds = evaluate(task.goal, chain.states[index].values) is Truth.TRUE
        if chain.status[index] is NodeStatus.SUCCESS and not holds and not task.components:
            found["the tree succeeds where the goal is not true"] = None
    absorption = Absorption(chain)
    visits = absorption.visits()
    total = sum((visits[index] or Fraction(0) for index in chain.final), Fraction(0))
    if total + absorption.entering() != 1:
        found[f"the probabilities of all ends sum to {total}, not 1"] = None
    for number in chain.given_up:
        found[f"{chain.actions[chain.action[number]].action} is given up while it runs"] = None
    latched = all(action.latched for action in chain.actions) and not chain.forgets
    if latched and absorption.endless:
        found["a tree of latched actions never ends"] = None
    return list(found)
