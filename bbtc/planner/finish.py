"""The last step of every planner: what the best tree does not need is taken from it."""

from __future__ import annotations

from bbtc.belief.chain import explore
from bbtc.belief.simulate import success_of
from bbtc.belief.state import Transition
from bbtc.limits import Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.options import Options
from bbtc.rewrite.retry import with_least_attempts
from bbtc.rewrite.shrink import shrunk
from bbtc.rewrite.simplify import numbered, simplified, size
from bbtc.tree.nodes import Node

GRACE = 0.5
"""Seconds to make the most of what is known once the user interrupts."""


def finish(
    best: BestTree, limits: Limits, options: Options, *, transitions: dict[str, Transition] | None = None
) -> None:
    """Take from the best tree what its runs, or the target, do not need, and give it as many attempts as the
    options say; what was done before a limit stays. Raises ``LimitReached``."""
    task, target = best.task, best.target

    def taken(root: Node) -> Node:
        root = numbered(root)
        chain = explore(task, root, limits, transitions)
        best.take(root, chain, success_of(chain))
        return root

    root = taken(simplified(task, best.root, limits, transitions))
    smaller = shrunk(task, root, target, limits, transitions)
    if smaller is not root:
        root = taken(smaller)
    if options.retries == "least" and best.success > target:
        retried = with_least_attempts(task, root, target, limits)
        if retried is not root and size(retried) <= limits.nodes:
            taken(retried)
