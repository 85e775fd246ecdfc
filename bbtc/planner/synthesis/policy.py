"""The strategy ``policy``: an optimal policy, written down as a small tree.

1. Explore the states of the task. 2. Find P* and, among the policies that attain it, the cheapest.
3. Write these as rules (:mod:`bbtc.planner.synthesis.rules`), and the rules as a tree. 4. Bound how
often it tries again (:mod:`bbtc.rewrite.retry`). 5. Simulate.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction

from bbtc.belief.chain import explore
from bbtc.belief.simulate import success_of
from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.finish import GRACE, finish
from bbtc.planner.guard import with_guards
from bbtc.planner.mdp.bounded_search import Advice
from bbtc.planner.mdp.finite_horizon import Horizon
from bbtc.planner.mdp.maxprob import Bounds, MaxProb
from bbtc.planner.mdp.solve import best_known, best_within
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.result import Plan, Progress
from bbtc.planner.synthesis.believed import with_beliefs
from bbtc.planner.synthesis.decision_tree import decision_tree
from bbtc.planner.synthesis.permissive import (
    MultiPolicy,
    best_multi_policy,
    likely_policy,
    likely_way,
    one_policy,
)
from bbtc.planner.synthesis.phases import Phase, by_count, likely_way_within, phases
from bbtc.planner.synthesis.tree import in_phases, one_after_another, synthesize
from bbtc.rewrite.retry import longest_run
from bbtc.rewrite.shrink import shrunk
from bbtc.rewrite.simplify import numbered, simplified, size
from bbtc.tree.nodes import ConditionNode, Node

_BEFORE_TREE = 0.6  # of the time, for all that comes before a tree
_FOR_COST = 0.5  # of the time left, to find the cheapest policy
LARGE_POLICY = 1000
"""States; of a larger policy, a tree is made fast first."""

_ENOUGH = 1000  # states that the simulation of what is fallen back on may have, whatever the limit
_DRAFTS = (1000, 50)  # states of a policy that a tree is made of, if one of all has too many nodes
_ALLOWANCE = Fraction(1, 1000)  # success given up for a tree that counts to an end
_CLOSE = Fraction(1, 10**8)  # probabilities closer than this differ by rounding


@dataclass(slots=True)
class _Search:
    """The best tree so far, what is known of the best possible, and what stopped the search."""

    task: Task
    target: Fraction
    limits: Limits
    options: Options
    best: BestTree
    whole: bool = False
    advice: Advice | None = None
    found: MaxProb | None = None
    horizon: Horizon | None = None
    bounds: Bounds = field(default_factory=lambda: Bounds(Fraction(0), Fraction(1)))
    stop: Diagnostic | None = None
    interrupted: bool = False
    wider: Task | None = None
    """The task with what has to be asked about, too, to tell apart what is believed."""

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
        self._fall_back()

    def _without_end(self) -> None:
        limits = self.limits.part(_BEFORE_TREE)
        best = best_known(self.task, limits, self.target, whole=self.whole, advice=self.advice)
        self.found = best.found
        self.bounds, self.stop, self.interrupted = best.bounds, best.stop, best.interrupted
        limits = self.limits.within(GRACE) if best.interrupted else self.limits
        if likely_policy(best.found, LARGE_POLICY) is not None and not self.task.components:
            self._draft(one_policy(best.found), limits)
        policy = self._cheapest(best.found, limits)
        self.wider = with_beliefs(self.task, policy)
        if self.wider is not None:
            self._by_count(best.found, limits)
            return  # no tree can follow it that can neither ask nor count
        self._keep(synthesize(self.task, policy, limits), limits)
        finish(self.best, limits, self.options)

    def _by_count(self, found: MaxProb, limits: Limits) -> None:
        """A tree that counts its actions where it cannot ask."""
        enough = min(self.target, found.initial.lower) - _ALLOWANCE
        parts = by_count(found.space, found.policy, float(enough), limits)
        with suppress(LimitReached):
            root = in_phases(self.task, [(part.steps, part.policy) for part in parts], limits)
            # Where a state was given up, it reads like others, in which the action is right.
            self._keep(with_guards(self.task, root), limits)

    def _cheapest(self, found: MaxProb, limits: Limits) -> MultiPolicy:
        """The cheapest of the best policies, or one of the best if there is no time to find it."""
        try:
            return best_multi_policy(found, limits.part(_FOR_COST))[0]
        except LimitReached:
            return one_policy(found)

    def _draft(self, policy: MultiPolicy, limits: Limits) -> None:
        """A tree of a policy, however large it is, to fall back on."""
        with suppress(LimitReached):
            self._keep(decision_tree(self.task, policy, limits), limits)

    def _fall_back(self) -> None:
        """Write down the policy that is known, if that was not done before a limit, or the user, ended it."""
        found = self.found
        if self.horizon is not None:
            self._fall_back_within(self.horizon)
        if found is None or self._is_reached(found.initial.lower) or self.wider is not None:
            return
        # The tree visits no state that was not found, but those may be a few more than the limit, and so may
        # what is worked out of an action.
        few = replace(self.limits, states=max(self.limits.states, len(found.space.states), _ENOUGH))
        try:
            way = likely_way(found)
            if way is not None and not self.best.success:
                self._surely(lambda limits: self._draft(way, limits), few)
            limits = few.overtime(GRACE)
            for policy in (one_policy(found), *(likely_policy(found, most) for most in _DRAFTS)):
                if policy is not None and not self._is_reached(found.initial.lower):
                    self._draft(policy, limits)
        except KeyboardInterrupt:
            self.interrupted = True

    def _surely(self, draft: Callable[[Limits], None], few: Limits) -> None:
        """Write down what is small, and so has always time and memory enough. The watch over the limits may
        interrupt it once: it leaves a second until it does so again."""
        endless = replace(few, seconds=None, until=None, memory=None)
        draft(endless)
        if not self.best.success:
            draft(endless)

    def _is_reached(self, attained: Fraction) -> bool:
        """Is the tree as good as the policy that is known, or as the target asks for?"""
        return self.best.success >= min(self.target, attained - _CLOSE)

    def _fall_back_within(self, horizon: Horizon) -> None:
        """The same within a number of actions."""
        attained = horizon.initial[-1].lower
        if self._is_reached(attained):
            return
        # A retry node counts, so that what is told apart of a state is how many actions are left.
        most = len(horizon.space.states) * len(horizon.values)
        few = replace(self.limits, states=max(self.limits.states, most, _ENOUGH))
        try:
            way = likely_way_within(horizon)
            if way is not None:
                self._surely(lambda limits: self._draft_within([way], limits), few)
            if not self._is_reached(attained):
                limits = few.overtime(GRACE)
                with suppress(LimitReached):
                    self._draft_within(phases(horizon, limits), limits)
        except KeyboardInterrupt:
            self.interrupted = True

    def _draft_within(self, parts: list[Phase], limits: Limits) -> None:
        """A tree of phases, however large it is, to fall back on."""
        with suppress(LimitReached):
            trees = [
                decision_tree(self.task, part.policy, limits, fall_through=number < len(parts))
                for number, part in enumerate(parts, 1)
            ]
            self._keep(one_after_another(self.task, [part.steps for part in parts], trees), limits)

    def _within(self, steps: int) -> None:
        best = best_within(self.task, self.limits.part(_BEFORE_TREE), steps)
        self.bounds, self.stop, self.horizon = best.bounds, best.stop, best.horizon
        horizon = best.horizon
        parts = phases(horizon, self.limits)
        for part in parts:
            self.wider = with_beliefs(self.task, part.policy)
            if self.wider is not None:
                return
        done = False
        if len(parts) == 1:
            root = synthesize(self.task, parts[0].policy, self.limits)
            longest = longest_run(explore(self.task, root, self.limits))
            if longest is not None and longest <= steps:
                self._keep(root)
                done = True
        if not done:
            self._keep(in_phases(self.task, [(part.steps, part.policy) for part in parts], self.limits))
        closed = self.options.closed_world
        simple = simplified(self.task, self.best.root, self.limits, closed_world=closed)
        wanted = self.target if self.options.prefer == "size" else self.best.success
        self._keep(numbered(shrunk(self.task, simple, wanted, self.limits, closed_world=closed)))

    def _keep(self, root: Node, limits: Limits | None = None) -> None:
        """Take a tree for the best so far, unless it does worse and does not reach the target."""
        limits = limits or self.limits
        if self.task.events and self.found is not None and self.found.space.fringe.any():
            # What happens by itself may lead to where the space was not looked at.
            root = with_guards(self.task, root)
        limits.check_nodes(size(root))
        chain = explore(self.task, root, limits)
        success = success_of(chain)
        if success >= min(self.target, self.best.success):
            self.best.take(root, chain, success)


def plan_policy(
    task: Task,
    target: Fraction,
    limits: Limits,
    progress: Progress,
    options: Options = DEFAULTS,
    *,
    whole: bool = False,
    advice: Advice | None = None,
) -> Plan:
    """Plan by policy synthesis. Always returns; where a limit is reached, with the best that is known
    by then. ``advice`` is what a search follows first. Only with ``whole`` it raises ``LimitReached`` instead
    where the task has more states than the limit."""
    goal: Node = numbered(ConditionNode("", task.goal))
    search = _Search(
        task, target, limits, options, BestTree.start(task, target, options.best, goal, limits), whole, advice
    )
    search.run()
    asking: Plan | None = None
    if search.wider is not None and not search.interrupted:
        with suppress(LimitReached):
            inner = replace(options, best=None)
            asking = plan_policy(search.wider, target, limits, progress, inner, whole=whole, advice=advice)
    if whole and search.stop is not None and asking is None:
        raise LimitReached([search.stop])
    plan = search.best.plan("interrupted" if search.interrupted else "limit-reached", search.stop)
    if asking is not None and not _beats(plan, asking):
        return asking
    lower = max(search.bounds.lower, plan.figures.success)
    upper = max(search.bounds.upper, lower)
    status = plan.tree.status
    if status == "limit-reached" and upper < target:
        status = "out-of-reach"
    return replace(plan, tree=replace(plan.tree, status=status, bounds=(lower, upper)))


def _beats(counting: Plan, asking: Plan) -> bool:
    """Does a tree that counts do better than one that asks, or as well at no more cost, with fewer nodes?"""
    target = asking.tree.target
    more = min(target, counting.figures.success) - min(target, asking.figures.success)
    costs = counting.figures.cost, asking.figures.cost
    cheap = costs[1] is None or (costs[0] is not None and costs[0] <= costs[1])
    small = size(counting.tree.root) < size(asking.tree.root)
    return more > _ALLOWANCE or (more > -_ALLOWANCE and cheap and small)
