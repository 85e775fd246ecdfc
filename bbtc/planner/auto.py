"""The strategies that choose among others.

``auto``: the smallest tree found that reaches the target and, among those, the cheapest;
where none does, the one with the greatest success probability.

1. Search over refinements: it takes time with the size of the tree, not of the task.
2. Write down an optimal policy. Where a tree that reaches the target is known already, only if the actions
   and states of the task are few, or the tree is large and they are not very many; else as the limits
   allow, since the policy tells whether the target can be reached.
3. Refine greedily, as published, in as many nodes as would make a smaller tree than those found; of
   a task with many actions, again, only where the target was not reached.

``advised``, the default: templates are their author's advice on how things are done, and only refinement
follows it. Where a task has templates, and refinement reaches the target, its tree is taken; else ``auto``.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.chaining.refine import refine
from bbtc.planner.chaining.search import plan_search
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.result import Plan, Progress, Refinement
from bbtc.planner.synthesis.policy import plan_policy
from bbtc.rewrite.simplify import size

MANY_ACTIONS = 500
"""A task with more gets no second opinion once a tree reaches the target."""

STATES_AND_ACTIONS = 200_000
"""For a second opinion, states times actions of the task are explored up to this number."""

LARGE_TREE = 100
"""Nodes; a tree of more is hard to read, and a second opinion on it worth more work."""

_WORK_FOR_LARGE = 3_000_000
"""States times actions explored for a second opinion on a large tree: some seconds."""

_REFINE_STATES = 20_000
"""States of one simulation while refining for a second opinion."""


def plan_auto(
    task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = DEFAULTS
) -> Plan:
    """Plan by search, by policy synthesis and by refinement, and keep the best tree. Always returns;
    refinements are told to ``progress`` only if their tree is kept. Raises
    :class:`bbtc.diagnostics.LimitReached` only if the limits do not even allow the simulation of the
    initial belief."""
    return _told(_best(task, target, limits, options, None), progress)


def plan_advised(
    task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = DEFAULTS
) -> Plan:
    """Plan by refinement where the task has templates, else, and where that falls short of the target, by
    :func:`plan_auto`, and as that does."""
    advised = None
    if task.templates and len(task.actions) <= MANY_ACTIONS and options == DEFAULTS:
        advised = _refined(task, target, limits, limits.nodes, options)
        if advised.tree.status in {"target-reached", "interrupted"}:
            return _told(advised, progress)
    return _told(_best(task, target, limits, options, advised), progress)


def _told(plan: Plan, progress: Progress) -> Plan:
    for step in plan.refinements:
        progress(step)
    return plan


def _silent(step: Refinement) -> None:
    del step


def _best(task: Task, target: Fraction, limits: Limits, options: Options, refined: Plan | None) -> Plan:
    """The best plan; ``refined`` is what refinement made, if it fell short of the target before."""
    if options.max_actions is not None:
        return plan_policy(task, target, limits, _silent, options)
    plans = [plan_search(task, target, limits, _silent, options)]
    if plans[0].tree.status != "interrupted":
        second = _policy(task, target, limits, options, plans[0])
        plans.extend([] if second is None else [second])
        if all(plan.tree.status != "interrupted" for plan in plans):
            third = _refine(task, limits, options, min(plans, key=_rank), refined)
            plans.extend([] if third is None else [third])
    return _with_findings(min(plans, key=_rank), plans)


def _policy(task: Task, target: Fraction, limits: Limits, options: Options, known: Plan) -> Plan | None:
    if known.tree.status != "target-reached":
        return plan_policy(task, target, limits, _silent, options)
    if size(known.tree.root) == 1 or len(task.actions) > MANY_ACTIONS:
        return None
    work = _WORK_FOR_LARGE if size(known.tree.root) > LARGE_TREE else STATES_AND_ACTIONS
    few = max(1, min(limits.states, work // max(1, len(task.actions))))
    try:
        found = plan_policy(task, target, replace(limits, states=few), _silent, options, whole=True)
    except LimitReached:  # more states than that
        return None
    return found


def _refine(task: Task, limits: Limits, options: Options, best: Plan, refined: Plan | None) -> Plan | None:
    tree, target = best.tree, best.tree.target
    most = limits.nodes
    if tree.status == "target-reached":
        most = min(most, size(tree.root) - 1)  # a larger tree would not be kept
        if len(task.actions) > MANY_ACTIONS:
            return None
    elif tree.bounds is not None and tree.success_probability == tree.bounds[1]:
        return None  # nothing can do better
    if refined is not None:
        return None if tree.status == "target-reached" else refined
    if most < 1:
        return None
    try:
        return _refined(task, target, limits, most, options)
    except LimitReached:  # not even the goal alone is small enough
        return None


def _refined(task: Task, target: Fraction, limits: Limits, nodes: int, options: Options) -> Plan:
    few = replace(limits, nodes=nodes, states=min(limits.states, _REFINE_STATES))
    return refine(task, target, few, _silent, options)


def _rank(plan: Plan) -> tuple[bool, Fraction, int, bool, Fraction]:
    """Sort key, best first."""
    tree, cost = plan.tree, plan.figures.cost
    reached = tree.success_probability >= tree.target
    missing = Fraction(0) if reached else -tree.success_probability
    return (not reached, missing, size(tree.root), cost is None, cost or Fraction(0))


def _with_findings(kept: Plan, plans: list[Plan]) -> Plan:
    """The plan with what the others brought to light: bounds, and what stopped them."""
    tree = kept.tree
    interrupted = any(plan.tree.status == "interrupted" for plan in plans)
    if interrupted and tree.status != "target-reached":
        tree = replace(tree, status="interrupted")
        kept = replace(kept, tree=tree)
    known = [plan.tree.bounds for plan in plans if plan.tree.bounds is not None]
    if not known:
        return kept
    lower = max(tree.success_probability, *(bounds[0] for bounds in known))
    upper = max(lower, min(bounds[1] for bounds in known))
    status = tree.status
    if status in {"stuck", "limit-reached"} and upper < tree.target:
        status = "out-of-reach"
    elif status == "stuck":
        status = "limit-reached"
    stop = kept.stop or next((plan.stop for plan in plans if plan.stop is not None), None)
    return replace(kept, tree=replace(tree, bounds=(lower, upper), status=status), stop=stop)
