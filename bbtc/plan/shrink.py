"""Smaller trees that still reach the target: alternatives that it does not take are dropped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from bbtc.belief.absorption import Absorption
from bbtc.belief.chain import explore
from bbtc.belief.soundness import violations
from bbtc.belief.state import Transition
from bbtc.belief.tick import Status
from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.simplify import simplified, size
from bbtc.tree.nodes import ControlNode, Node, actions_of

_MOST_STATES = 50_000
"""States of all simulations together."""


def shrunk(
    task: Task, root: Node, target: Fraction, limits: Limits, transitions: dict[str, Transition] | None = None
) -> Node:
    """The tree without those alternatives of its Fallbacks that the target does not need: one after
    the other is dropped, the largest first, as long as the exact success probability stays at the
    target or above (or, where the tree falls short of it, stays what it is). What is left is simplified.
    Raises ``LimitReached`` when the time is over.
    """
    transitions = {} if transitions is None else transitions
    chain = explore(task, root, limits, transitions)
    work = len(chain.states)
    success, endless = _outcome(Absorption(chain))
    wanted = min(target, success)
    dropped = True
    while dropped:
        dropped = False
        for smaller in sorted(_without_one(root), key=size):
            limits.check_time("the search for a small tree")
            if work > _MOST_STATES:
                return root
            try:
                chain = explore(
                    task, smaller, replace(limits, states=min(limits.states, 4 * work)), transitions
                )
            except LimitReached:
                continue
            work += len(chain.states)
            reached, circling = _outcome(Absorption(chain))
            if reached >= wanted and circling <= endless and not violations(task, chain):
                root = simplified(task, smaller, limits, transitions)
                dropped = True
                break
    return root


def _outcome(absorption: Absorption) -> tuple[Fraction, Fraction]:
    """Probabilities of success, and of never ending."""
    chain = absorption.chain
    visits = absorption.visits()
    won = sum(
        (visits[s] or Fraction(0) for s in chain.final if chain.status[s] is Status.SUCCESS), Fraction(0)
    )
    return won, 1 - sum((visits[s] or Fraction(0) for s in chain.final), Fraction(0))


def _without_one(node: Node) -> Iterator[Node]:
    """Trees that lack one alternative with actions."""
    if not isinstance(node, ControlNode) or node.template is not None:
        return
    for at, child in enumerate(node.children):
        rest = (*node.children[:at], *node.children[at + 1 :])
        if node.kind in {"fallback", "skipper"} and rest and any(actions_of(child)):
            yield rest[0] if len(rest) == 1 else replace(node, children=rest)
        for smaller in _without_one(child):
            yield replace(node, children=(*node.children[:at], smaller, *node.children[at + 1 :]))
