"""The strategy ``auto``: the smallest tree found that reaches the target and, among those, the
cheapest; where none does, the one with the greatest success probability."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.options import DEFAULTS, Options
from bbtc.plan.policy import plan_policy
from bbtc.plan.refine import refine
from bbtc.plan.result import Plan, Progress
from bbtc.tree.nodes import walk

_REFINE_STATES = 20_000
"""States of one simulation while refining for a second opinion."""


def plan_auto(
    task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = DEFAULTS
) -> Plan:
    """Plan by policy synthesis and by refinement, and keep the better tree. Always returns; each
    refinement is told to ``progress`` only if its tree is kept."""
    synthesized = plan_policy(task, target, limits, progress, options)
    if synthesized.tree.status == "interrupted" or options.max_actions is not None:
        return synthesized
    tree = synthesized.tree
    most_nodes = limits.nodes
    if tree.success_probability >= target:
        most_nodes = min(most_nodes, _size(synthesized) - 1)  # a larger tree would not be kept
    elif tree.bounds is not None and tree.success_probability == tree.bounds[1]:
        return synthesized  # nothing can do better
    narrow = replace(limits, nodes=max(1, most_nodes), states=min(limits.states, _REFINE_STATES))
    try:
        refined = refine(task, target, narrow, lambda _: None)
    except LimitReached:  # not even the goal alone is small enough
        return synthesized
    if _rank(refined) >= _rank(synthesized):
        return synthesized
    for step in refined.refinements:
        progress(step)
    return _with_bounds(refined, synthesized)


def _size(plan: Plan) -> int:
    return sum(1 for _ in walk(plan.tree.root))


def _rank(plan: Plan) -> tuple[int, Fraction, int, bool, Fraction]:
    """Sort key, best first."""
    tree, cost = plan.tree, plan.figures.cost
    reached = tree.success_probability >= tree.target
    missing = Fraction(0) if reached else -tree.success_probability
    return (not reached, missing, _size(plan), cost is None, cost or Fraction(0))


def _with_bounds(kept: Plan, other: Plan) -> Plan:
    """The plan with the bounds that the other one brought to light."""
    if other.tree.bounds is None:
        return kept
    lower, upper = other.tree.bounds
    lower = max(lower, kept.tree.success_probability)
    status = kept.tree.status
    if status == "stuck":
        status = "out-of-reach" if upper < kept.tree.target else other.tree.status
    tree = replace(kept.tree, bounds=(lower, max(lower, upper)), status=status)
    return replace(kept, tree=tree, stop=kept.stop or other.stop)
