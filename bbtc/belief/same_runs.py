"""Whether two trees do the same: in every run, the same actions in the same order, with the same end."""

from __future__ import annotations

from bbtc.belief.chain import Chain
from bbtc.belief.tick import STARTED, compile_tick, memory_of
from bbtc.ground.task import Task
from bbtc.tree.nodes import Node, actions_of


def same_runs(task: Task, chain: Chain, other: Node) -> bool:
    """Does another tree do in every run what the tree of a chain does? Then their scenarios, and so all
    their figures, are equal.

    Both trees are run side by side, on the states of the chain with what the other tree remembers. An action
    that the other tree gives up while it runs, though nothing changes, is not the same.
    """
    tick = compile_tick(task, other)
    names = [node.action for node in actions_of(other)]
    remembered = memory_of(other)
    pairs = dict.fromkeys((state, 0) for _, state in chain.initial)
    waiting = list(pairs)
    while waiting:
        state, memory = waiting.pop()
        returned = tick(chain.states[state].values, memory)
        if returned < STARTED:
            if chain.action[state] >= 0 or chain.status[state] != returned:
                return False
            continue
        started = remembered.action(returned)
        if chain.action[state] < 0 or chain.actions[chain.action[state]].action != names[started]:
            return False
        if remembered.forgets:
            during = remembered.during(memory, returned)
            if tick(chain.states[state].values, during) != STARTED + started:
                return False
        after = remembered.after(memory, returned)
        for edge in chain.edges[state]:
            pair = (edge.successor, after)
            if pair not in pairs:
                pairs[pair] = None
                waiting.append(pair)
    return True
