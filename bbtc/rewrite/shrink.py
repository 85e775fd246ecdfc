"""Smaller trees that still reach the target: alternatives that it does not take are dropped.

Rewrite rule, kept if the tree is still worth it (:meth:`_Worth.will_do`); k is a Fallback or a Skipper:

1. ``k(…, c, …)`` becomes ``k(…, …)`` for a branch c with actions, and ``k(c, d)`` becomes ``d``.

The smallest tree that it makes is tried first; what is left is simplified (:mod:`bbtc.rewrite.simplify`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import Chain, explore
from bbtc.belief.soundness import violations
from bbtc.belief.state import Transition
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import LimitReached
from bbtc.ground.task import ZERO, Task
from bbtc.limits import Limits
from bbtc.markov import weighted
from bbtc.rewrite.simplify import simplified, size
from bbtc.tree.nodes import ControlNode, Node, actions_of

_MOST_STATES = 50_000
"""States of all simulations together."""


def shrunk(
    task: Task,
    root: Node,
    target: Fraction,
    limits: Limits,
    transitions: dict[str, Transition] | None = None,
    *,
    closed_world: bool = False,
) -> Node:
    """The tree without those alternatives of its Fallbacks that the target does not need: one after
    the other is dropped, the largest first, as long as the exact success probability stays at the
    target or above. Where the tree does no better than that from the start, neither success nor expected
    cost may get worse. What is left is simplified.
    Raises ``LimitReached`` when the time is over.
    """
    transitions = {} if transitions is None else transitions
    chain = explore(task, root, limits, transitions)
    work = len(chain.states)
    before = _Worth.of(chain)
    dropped = True
    while dropped:
        dropped = False
        for smaller in sorted(_without_one(root), key=size):
            limits.check_time("the search for a small tree")
            if work > _MOST_STATES:
                return root
            narrow = replace(limits, states=min(limits.states, 4 * len(chain.states)))
            try:
                other = explore(task, smaller, narrow, transitions)
            except LimitReached:
                continue
            work += len(other.states)
            if _Worth.of(other).will_do(before, target) and not violations(task, other):
                root = simplified(task, smaller, limits, transitions, closed_world=closed_world)
                dropped = True
                break
    return root


@dataclass(frozen=True, slots=True)
class _Worth:
    """Probabilities of success and of never ending, and the expected cost (None: infinite)."""

    success: Fraction
    endless: Fraction
    cost: Fraction | None

    @classmethod
    def of(cls, chain: Chain) -> _Worth:
        visits = Absorption(chain).visits()
        ends = {status: Fraction(0) for status in NodeStatus}
        for state in chain.final:
            ends[chain.status[state]] += visits[state] or 0
        endless = 1 - sum(ends.values(), Fraction(0))
        cost = weighted(
            (visit, weighted((edge.result.probability, edge.result.cost) for edge in edges))
            for visit, edges in zip(visits, chain.edges, strict=True)
            if visit
        )
        success = weighted((visits[state] or ZERO, chain.won(state)) for state in chain.final)
        return cls(success, endless, None if endless else cost)

    def will_do(self, before: _Worth, target: Fraction) -> bool:
        """Is it good enough in place of what was before?"""
        if self.endless > before.endless or self.success < min(before.success, target):
            return False
        if before.success > target or before.cost is None:
            return True
        return self.cost is not None and self.cost <= before.cost


def _without_one(node: Node) -> Iterator[Node]:
    """Trees that lack one alternative with actions."""
    if not isinstance(node, ControlNode) or node.template is not None:
        return
    for at, child in enumerate(node.children):
        rest = (*node.children[:at], *node.children[at + 1 :])
        if node.kind in {"fallback", "skipper"} and rest and any(actions_of(child)):
            yield rest[0] if len(rest) == 1 else replace(node, children=rest)  # rule 1
        for smaller in _without_one(child):
            yield replace(node, children=(*node.children[:at], smaller, *node.children[at + 1 :]))
