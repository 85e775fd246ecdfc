"""The last thing that is done about a plan: its tree gets its labels, and the invariants are checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from bbtc.belief.chain import Chain, explore
from bbtc.belief.soundness import violations
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.ground.task import BodyControl, GroundTemplate, Task, walk_body
from bbtc.limits import Limits
from bbtc.planner.result import Plan
from bbtc.planner.subgoals import with_subgoals
from bbtc.tree.nodes import Node, walk
from bbtc.tree.validate import check_tree


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
