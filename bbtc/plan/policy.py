"""The strategy ``policy``: an optimal policy, written down as a small tree.

1. Explore the states of the task. 2. Find P* and, among the policies that attain it, the cheapest.
3. Write these as rules (:mod:`bbtc.plan.synthesis_rules`), and the rules as a tree. 4. Simulate.
A tree of unlatched actions may try again for ever; its figures are those of the Markov chain.
"""

from __future__ import annotations

from fractions import Fraction

from bbtc.belief.simulate import simulate
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.options import DEFAULTS, Options
from bbtc.plan.policy_space import best_offers
from bbtc.plan.result import Plan, Progress
from bbtc.plan.space import explore_space
from bbtc.plan.synthesis_tree import numbered, synthesize
from bbtc.plan.value import best_probability, reachability
from bbtc.tree.nodes import ConditionNode, Node, Status, Tree, walk


def plan_policy(
    task: Task,
    target: Fraction,
    limits: Limits,
    progress: Progress,  # noqa: ARG001
    options: Options = DEFAULTS,  # noqa: ARG001
) -> Plan:
    """Plan by policy synthesis. Always returns; where a limit is reached, with the best that is known
    by then."""
    root: Node = numbered(ConditionNode("", task.goal))
    initial = simulate(task, root, limits)
    stop: Diagnostic | None = None
    bounds = (initial.success, Fraction(1))
    interrupted = False
    try:
        space = explore_space(task, limits)
        stop = space.stop
        found = reachability(space, limits)
        value = found.initial if space.complete else best_probability(space, limits)
        bounds = (value.lower, value.upper)
        offers, _ = best_offers(found, limits)
        root = synthesize(task, offers, limits)
        limits.check_nodes(sum(1 for _ in walk(root)))
    except LimitReached as reached:
        stop = reached.diagnostics[0]
    except KeyboardInterrupt:
        interrupted = True
    figures = simulate(task, root, Limits())
    lower = max(bounds[0], figures.success)
    status: Status = "limit-reached"
    if figures.success >= target:
        status = "target-reached"
    elif interrupted:
        status = "interrupted"
    elif bounds[1] < target:
        status = "out-of-reach"
    tree = Tree(task, root, figures.success, target, status, (lower, max(lower, bounds[1])))
    return Plan(tree, figures, initial.success, (), stop)
