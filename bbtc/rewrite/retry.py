"""How often to try again: the least number of attempts that meets a target.

Rewrite rules, for a tree whose runs come back to a state; n is the least number that meets the target:

1. ``t`` becomes ``Retry(n, t)`` for the smallest subtree t that holds all actions of such runs.
2. Where that cannot meet the target, as what follows t takes over too late, t is the whole tree.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from bbtc.belief.chain import Chain, explore
from bbtc.belief.simulate import figures
from bbtc.belief.soundness import violations
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.markov import components, distribution
from bbtc.tree.nodes import ActionNode, ControlNode, Node, actions_of

_MOST_ATTEMPTS = 4096


def with_least_attempts(task: Task, root: Node, target: Fraction, limits: Limits) -> Node:
    """The tree with a retry node around the actions that its runs may start again and again, with
    the least number of attempts that reaches the target. The tree itself where its runs never come
    back to a state, and where no number of attempts (up to some thousands) is enough.

    The retry node stands as low as it can; where what follows it could not take over once its
    attempts are used up, it stands at the root.
    """
    looping = _looping(explore(task, root, limits))
    if not looping:
        return root
    for place in dict.fromkeys([_lowest_above(root, looping), root.id]):  # rule 1, else rule 2
        found = _least(task, root, place, target, limits)
        if found is not None:
            return found
    return root


def longest_run(chain: Chain) -> int | None:
    """The greatest number of actions in a run; None where runs may come back to a state."""
    longest = [0] * len(chain.states)
    successors = [[edge.successor for edge in edges] for edges in chain.edges]
    for component in components(successors):  # each after all that it can reach
        if len(component) > 1 or component[0] in successors[component[0]]:
            return None
        (state,) = component
        longest[state] = max((1 + longest[after] for after in successors[state]), default=0)
    return max((longest[state] for _, state in chain.initial), default=0)


def _looping(chain: Chain) -> set[str]:
    """Ids of the action nodes that a run may start in a state it comes back to."""
    successors = [[edge.successor for edge in edges] for edges in chain.edges]
    found: set[str] = set()
    for component in components(successors):
        if len(component) > 1 or component[0] in successors[component[0]]:
            found.update(chain.actions[chain.action[state]].id for state in component)
    return found


def _lowest_above(root: Node, actions: set[str]) -> str:
    """The id of the smallest subtree that holds all the actions."""
    node = root
    while isinstance(node, ControlNode):
        below = [c for c in node.children if any(a.id in actions for a in actions_of(c))]
        if len(below) != 1:
            break
        node = below[0]
    return node.id


def _least(task: Task, root: Node, place: str, target: Fraction, limits: Limits) -> Node | None:
    def success(attempts: int) -> Fraction | None:
        tree = _wrapped(root, place, attempts)
        chain = explore(task, tree, limits)
        return None if violations(task, chain) else figures(task, tree, chain).success

    least = 0
    most = _expected_attempts(task, root, target, limits) if place == root.id else 1
    try:
        if most > 1:  # very likely the number itself
            reached = success(most - 1)
            if reached is None:
                return None
            least, most = (0, most - 1) if reached >= target else (most - 1, most)
        while True:
            reached = success(most)
            if reached is None:
                return None
            if reached >= target:
                break
            least, most = most, 2 * most
            if most > _MOST_ATTEMPTS:
                return None
        while most - least > 1:
            middle = (least + most) // 2
            reached = success(middle)
            if reached is None:
                return None
            least, most = (least, middle) if reached >= target else (middle, most)
    except LimitReached:
        return None
    return _wrapped(root, place, most)


def _expected_attempts(task: Task, root: Node, target: Fraction, limits: Limits) -> int:
    """The least number of actions within which the tree succeeds with the target probability; this
    is the number of attempts to ask for at the root, but for odd trees. 1 if there is none."""
    chain = explore(task, root, limits)
    mass = distribution((state, probability) for probability, state in chain.initial)
    won = Fraction(0)
    for steps in range(_MOST_ATTEMPTS):
        following: dict[int, Fraction] = {}
        for state, probability in mass.items():
            if chain.status[state] is NodeStatus.SUCCESS:
                won += probability
            for edge in chain.edges[state]:
                share = probability * edge.result.probability
                following[edge.successor] = following.get(edge.successor, Fraction(0)) + share
        if won >= target:
            return max(1, steps)
        if not following:
            break
        limits.check_time("the search for a number of attempts")
        mass = following
    return 1


def _wrapped(node: Node, place: str, attempts: int) -> Node:
    if node.id == place:
        return ControlNode(f"{node.id}.retry", "retry", (node,), attempts=attempts)
    if isinstance(node, ActionNode) or not isinstance(node, ControlNode):
        return node
    return replace(node, children=tuple(_wrapped(child, place, attempts) for child in node.children))
