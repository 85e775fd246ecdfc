"""The last steps of every planner: what the best tree does not need is taken from it, and it is checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from bbtc.belief.chain import Chain, explore
from bbtc.belief.simulate import success_of
from bbtc.belief.soundness import violations
from bbtc.belief.state import Transition
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.ground.task import BodyControl, GroundTemplate, Task, walk_body
from bbtc.limits import Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.guard import with_guards
from bbtc.planner.objective import MORE_NODES, allowance
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.planner.subgoals import with_subgoals
from bbtc.rewrite.left_to_guards import left_to_guards
from bbtc.rewrite.retry import with_least_attempts
from bbtc.rewrite.shrink import shrunk
from bbtc.rewrite.simplify import numbered, simplified, size
from bbtc.tree.nodes import Node, walk
from bbtc.tree.validate import check_tree

GRACE = 0.5
"""Seconds to make the most of what is known once the user interrupts."""


def finish(
    best: BestTree, limits: Limits, options: Options, *, transitions: dict[str, Transition] | None = None
) -> None:
    """Take from the best tree what its runs, or the target, do not need, and give it as many attempts as the
    options say; what was done before a limit stays. Raises ``LimitReached``."""
    task = best.task

    def taken(root: Node) -> Node:
        root = numbered(root)
        chain = explore(task, root, limits, transitions)
        best.take(root, chain, success_of(chain))
        return root

    def without_branches(success: Fraction) -> Node:
        return shrunk(task, root, success, limits, transitions, closed_world=options.closed_world)

    limits.check_time("the search for a small tree")
    # Actions that read what they need may fail, and something else has its turn then.
    root = best.root if options.closed_world else with_guards(task, best.root)
    root = taken(simplified(task, root, limits, transitions, closed_world=options.closed_world))
    smaller = root
    if options.prefer == "size":
        smaller = without_branches(best.target)
    elif options.closed_world:
        smaller = without_branches(best.success)
    elif size(root) > MORE_NODES and best.success > best.target:
        # Branches that the simulation does not need help where others change the world.
        smallest = without_branches(best.target)
        smaller = smallest if size(root) > allowance(size(smallest)) else root
    if not options.closed_world:
        smaller = left_to_guards(task, smaller)
    if smaller is not root:
        root = taken(smaller)
    if options.retries == "least":
        bound_attempts(best, limits)


def bound_attempts(best: BestTree, limits: Limits) -> None:
    """Give the best tree as many attempts as the target takes, and no more. Raises ``LimitReached``."""
    if best.success <= best.target:
        return
    root = with_least_attempts(best.task, best.root, best.target, limits)
    if root is not best.root and size(root) <= limits.nodes:
        root = numbered(root)
        chain = explore(best.task, root, limits)
        best.take(root, chain, success_of(chain))


def checked(plan: Plan, limits: Limits) -> tuple[Plan, Chain]:
    """The plan with the subgoals of its tree named, and the tree's chain. Raises :class:`BbtcError` where
    what the body of a template tries again makes it unsound, and ``AssertionError`` for any other
    violation, which is a bug."""
    task = plan.tree.task
    plan = replace(plan, tree=replace(plan.tree, root=with_subgoals(task, plan.tree.root)))
    check_tree(plan.tree)
    chain = plan.chain or explore(task, plan.tree.root, Limits(states=limits.states))
    broken = violations(task, chain)
    if broken and chain.given_up:
        for template in _retrying(task, plan.tree.root):
            raise BbtcError([_gives_up(chain, template)])
    if broken:
        raise AssertionError(f"unsound tree: {'; '.join(broken)}")
    return plan, chain


def _retrying(task: Task, root: Node) -> Iterator[GroundTemplate]:
    """The templates of a tree whose own bodies try again."""
    used = {node.template for node in walk(root) if node.template is not None}
    for template in task.templates:
        parts = walk_body(template.body)
        if template.name in used and any(
            isinstance(p, BodyControl) and p.attempts is not None for p in parts
        ):
            yield template


def _gives_up(chain: Chain, template: GroundTemplate) -> Diagnostic:
    action = chain.actions[chain.action[chain.given_up[0]]].action
    return Diagnostic(
        "BBT0448",
        f"{action} is given up by the tick after its start: a `retry` before it begins anew in each tick",
        template.span,
        "let something else decide then: `(fallback (condition c) (retry n b))`, c being what b is for",
    )
