"""The strategy ``policy``: an optimal policy, written down as a small tree.

1. Explore the states of the task. 2. Find P* and, among the policies that attain it, the cheapest.
3. Write these as rules (:mod:`bbtc.plan.synthesis_rules`), and the rules as a tree. 4. Bound how
often it tries again (:mod:`bbtc.plan.policy_retry`). 5. Simulate.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from bbtc.belief.chain import explore
from bbtc.belief.simulate import simulate
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.options import DEFAULTS, Options
from bbtc.plan.policy_budget import phases
from bbtc.plan.policy_retry import longest_run, with_least_attempts
from bbtc.plan.policy_space import best_offers
from bbtc.plan.result import Plan, Progress
from bbtc.plan.simplify import numbered, size
from bbtc.plan.space import explore_space
from bbtc.plan.synthesis_tree import in_phases, synthesize
from bbtc.plan.value import Bounds, best_probability, reachability
from bbtc.plan.value_horizon import horizon_values
from bbtc.tree.nodes import ConditionNode, Node, Status, Tree


@dataclass(slots=True)
class _Search:
    """The best tree so far, what is known of the best possible, and what stopped the search."""

    task: Task
    target: Fraction
    limits: Limits
    options: Options
    root: Node
    bounds: Bounds = field(default_factory=lambda: Bounds(Fraction(0), Fraction(1)))
    stop: Diagnostic | None = None
    interrupted: bool = False

    def run(self) -> None:
        """Search until done, stopped by a limit, or interrupted."""
        try:
            if self.options.max_actions is None:
                self._without_end()
            else:
                self._within(self.options.max_actions)
        except LimitReached as reached:
            self.stop = reached.diagnostics[0]
        except KeyboardInterrupt:
            self.interrupted = True

    def _without_end(self) -> None:
        space = explore_space(self.task, self.limits)
        self.stop = space.stop
        found = reachability(space, self.limits)
        self.bounds = found.initial if space.complete else best_probability(space, self.limits)
        offers, _ = best_offers(found, self.limits)
        self._keep(synthesize(self.task, offers, self.limits))
        if self.options.retries == "least" and found.initial.upper > self.target:
            self._keep(numbered(with_least_attempts(self.task, self.root, self.target, self.limits)))

    def _within(self, steps: int) -> None:
        space = explore_space(self.task, self.limits, steps)
        self.stop = space.stop
        horizon = horizon_values(space, steps, self.limits)
        if self.stop is None:
            self.bounds = horizon.initial[-1]
        parts = phases(horizon, self.limits)
        if len(parts) == 1:
            root = synthesize(self.task, parts[0].offers, self.limits)
            longest = longest_run(explore(self.task, root, self.limits))
            if longest is not None and longest <= steps:
                self._keep(root)
                return
        self._keep(in_phases(self.task, [(part.steps, part.offers) for part in parts], self.limits))

    def _keep(self, root: Node) -> None:
        self.limits.check_nodes(size(root))
        self.root = root


def plan_policy(
    task: Task,
    target: Fraction,
    limits: Limits,
    progress: Progress,  # noqa: ARG001
    options: Options = DEFAULTS,
) -> Plan:
    """Plan by policy synthesis. Always returns; where a limit is reached, with the best that is known
    by then."""
    goal: Node = numbered(ConditionNode("", task.goal))
    initial = simulate(task, goal, limits)
    search = _Search(task, target, limits, options, goal)
    search.run()
    figures = simulate(task, search.root, Limits())
    lower = max(search.bounds.lower, figures.success)
    upper = max(search.bounds.upper, lower)
    status: Status = "limit-reached"
    if figures.success >= target:
        status = "target-reached"
    elif search.interrupted:
        status = "interrupted"
    elif upper < target:
        status = "out-of-reach"
    tree = Tree(task, search.root, figures.success, target, status, (lower, upper))
    return Plan(tree, figures, initial.success, (), search.stop)
