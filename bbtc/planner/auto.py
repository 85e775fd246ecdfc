"""The strategies that choose among others.

``auto`` has several planners make a tree, each with a share of the time, and keeps the best
(:mod:`bbtc.planner.objective`). What one of them finds decides how much the next ones may do:

1. Search over refinements: it takes time with the size of the tree, not of the task.
2. Write down an optimal policy, of the whole space where that is small. Where a tree that meets the target is
   known already, as few states and actions as take a moment are looked at, or, where it is large, some more.
3. A policy over partial states, which surely reaches the goal, unless it is known that there is none. Where a
   tree that meets the target is known, with an effort of a moment.
4. Where nothing met the target, write down the best policy that the limits allow to find: it tells whether
   the target can be reached.
5. Refine greedily, as published, where nothing met the target, or, if the smallest tree is asked for, in as
   many nodes as would make a smaller one than those found.
6. Unless the world is closed, learn rules for all states that actions lead to, or others may
   (:mod:`bbtc.planner.recovering`). Where that takes too long, or does not help, and the smallest tree is not
   asked for, plan as in 2 and 3 once more, for what others may make of visited states, too
   (:mod:`bbtc.planner.elsewhere`).

``advised``, the default: templates are their author's advice on how things are done, and only refinement
follows it. Where a task has templates, and refinement meets the target, its tree is taken, with equal
attempts that follow one another put together (:mod:`bbtc.rewrite.repeat`); else ``auto``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction

from bbtc.belief.chain import explore
from bbtc.belief.draws import Values
from bbtc.belief.simulate import figures, success_of
from bbtc.diagnostics import LimitReached
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Effort, Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.chaining.refine import refine
from bbtc.planner.chaining.search import plan_search
from bbtc.planner.elsewhere import also_at, only_at, starts_elsewhere
from bbtc.planner.finish import bound_attempts
from bbtc.planner.guard import guarded
from bbtc.planner.objective import Worth, best_of
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.recovering import recovering_tree
from bbtc.planner.result import Plan, Progress, Refinement
from bbtc.planner.strong_cyclic.plan import plan_strong_cyclic
from bbtc.planner.synthesis.policy import plan_policy
from bbtc.rewrite.repeat import with_repeats
from bbtc.rewrite.simplify import size
from bbtc.tree.nodes import Node

MANY_ACTIONS = 500
"""A task with more gets no second opinion once a tree meets the target."""

STATES_AND_ACTIONS = 200_000
"""For a second opinion, states times actions of the task are explored up to this number."""

LARGE_TREE = 100
"""Nodes; a tree of more is hard to read, and a second opinion on it worth more work."""

_WORK_FOR_LARGE = 3_000_000
"""States times actions explored for a second opinion on a large tree: some seconds."""

_LOOKS = 150
"""Looks at the clock in the search for a policy over partial states, for a second opinion."""

_LOOKS_ELSEWHERE = 1500
"""The same for policies from states that others may leave the world in."""

_MOST_RECOVERING = 60_000
"""States for which a tree that recovers from anywhere is made."""

_REFINE_STATES = 20_000
"""States of one simulation while refining for a second opinion."""

_SEARCH_SHARE, _SURE_SHARE = 0.4, 0.5  # of the time left


def plan_auto(
    task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = DEFAULTS
) -> Plan:
    """Plan by several strategies, and keep the best tree. Always returns;
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
    follows = options.prefer == "success" and options.retries == "unbounded" and options.max_actions is None
    if task.templates and len(task.actions) <= MANY_ACTIONS and follows:
        advised = _refined(task, target, limits, limits.nodes, options)
        if advised.tree.status == "target-reached":
            advised = _with_repeats(advised, limits)
        if advised.tree.status in {"target-reached", "interrupted"}:
            return _told(advised, progress)
    return _told(_best(task, target, limits, options, advised), progress)


def _told(plan: Plan, progress: Progress) -> Plan:
    for step in plan.refinements:
        progress(step)
    return plan


def _silent(step: Refinement) -> None:
    del step


@dataclass(slots=True)
class _Auto:
    """The plans found so far."""

    task: Task
    target: Fraction
    limits: Limits
    options: Options
    plans: list[Plan] = field(default_factory=list)
    elsewhere: Task | None = None
    """The task, beginning in states that others may leave it in."""
    _recovery: dict[int, Fraction] = field(default_factory=dict)

    @property
    def best(self) -> Plan:
        """The best of them."""
        worths = [Worth.of(plan, self.recovery(plan)) for plan in self.plans]
        return self.plans[best_of(worths, self.target, self.options.prefer)]

    @property
    def met(self) -> bool:
        """Does one meet the target?"""
        return self.best.tree.success_probability >= self.target

    @property
    def interrupted(self) -> bool:
        """Did the user end it?"""
        return any(plan.tree.status == "interrupted" for plan in self.plans)

    @property
    def upper(self) -> Fraction:
        """No policy does better."""
        return min((plan.tree.bounds[1] for plan in self.plans if plan.tree.bounds), default=Fraction(1))

    def add(self, plan: Plan | None) -> None:
        """Take a plan into account."""
        if plan is not None:
            self.plans.append(plan if self.options.closed_world else guarded(plan))

    def run(self, refined: Plan | None) -> None:
        """Make plans; ``refined`` is what refinement made, if it fell short of the target before."""
        task, target, limits, options = self.task, self.target, self.limits, self.options
        self.add(plan_search(task, target, limits.part(_SEARCH_SHARE), _silent, options))
        for step in (self.of_few_states, self.surely, self.of_all_states):
            if not self.interrupted:
                self.add(step())
        if not self.interrupted:
            self.add(self.refinement(refined))
        if not self.interrupted and not options.closed_world and not task.components:
            with suppress(LimitReached):
                self.go_on_from_elsewhere()

    def recovery(self, plan: Plan) -> Fraction:
        """How often a tree succeeds from where others may leave the world; 0 where that takes too long."""
        if self.elsewhere is None:
            return Fraction(0)
        if id(plan) not in self._recovery:
            self._recovery[id(plan)] = self._success_from(self.elsewhere, plan)
        return self._recovery[id(plan)]

    def _success_from(self, elsewhere: Task, plan: Plan) -> Fraction:
        few = replace(self.limits, states=min(self.limits.states, _REFINE_STATES))
        try:
            return success_of(explore(elsewhere, plan.tree.root, few))
        except LimitReached:
            return Fraction(0)

    def go_on_from_elsewhere(self) -> None:
        """Policies that hold from where others may leave the world, too. Raises ``LimitReached``."""
        task, best = self.task, self.best
        if not task.actions or len(task.actions) > MANY_ACTIONS or not best.tree.success_probability:
            return
        starts = starts_elsewhere(task, self.limits, _visited(best))
        if not starts:
            return
        self.elsewhere = only_at(task, starts)
        if self.recovers() or self.options.prefer == "size":
            return
        few = replace(self.limits, states=max(1, STATES_AND_ACTIONS // len(task.actions)))
        with suppress(LimitReached):
            wider = also_at(task, starts)
            self.add_for_own_starts(plan_policy(wider, self.target, few, _silent, self.inner, whole=True))
        if any(plan.tree.success_probability == 1 and plan.chain is not None for plan in self.plans):
            self.surely_from(starts)

    def recovers(self) -> bool:
        """Rules for all states that actions lead to; is there nothing better?"""
        most = min(self.limits.states, _MOST_RECOVERING, max(1, _WORK_FOR_LARGE // len(self.task.actions)))
        limits = replace(self.limits.part(_SURE_SHARE), states=most, effort=Effort(_LOOKS_ELSEWHERE))
        try:
            root = recovering_tree(self.task, limits)
            if root is None:
                return False
            self.add_tree(root)
        except LimitReached:
            return False
        return self.best is self.plans[-1]

    def surely_from(self, starts: Sequence[tuple[Truth, ...]]) -> None:
        """A policy over partial states for those of the starts from which one surely reaches the goal."""
        limits = replace(self.limits.part(_SURE_SHARE), effort=Effort(_LOOKS_ELSEWHERE))

        def surely(task: Task) -> Plan:
            return plan_strong_cyclic(task, Fraction(1), limits, _silent, self.inner)

        sure = [each for each in starts if surely(only_at(self.task, [each])).tree.success_probability == 1]
        if sure:
            self.add_for_own_starts(surely(also_at(self.task, sure)))

    @property
    def inner(self) -> Options:
        """For plans of other tasks than this one."""
        return replace(self.options, best=None)

    def add_for_own_starts(self, plan: Plan) -> None:
        """Take the tree of a plan for other starts into account. Raises ``LimitReached``."""
        if plan.tree.status == "interrupted":
            raise KeyboardInterrupt
        self.add_tree(plan.tree.root)

    def add_tree(self, root: Node) -> None:
        """Take a tree into account. Raises ``LimitReached``."""
        chain = explore(self.task, root, replace(self.limits, states=min(self.limits.states, _REFINE_STATES)))
        best = BestTree(self.task, self.target, outer=self.options.best)
        best.take(root, chain, success_of(chain))
        self.add(best.plan("stuck"))

    def of_few_states(self) -> Plan | None:
        """An optimal policy, where a moment is enough to explore the whole space."""
        nodes, actions = size(self.best.tree.root), len(self.task.actions)
        if self.met and (nodes == 1 or actions > MANY_ACTIONS):
            return None
        work = _WORK_FOR_LARGE if nodes > LARGE_TREE else STATES_AND_ACTIONS
        most = max(1, min(self.limits.states, work // max(1, actions)))
        few = replace(self.limits, states=most)
        try:
            return plan_policy(self.task, self.target, few, _silent, self.options, whole=True)
        except LimitReached:  # more states than that
            return None

    def surely(self) -> Plan | None:
        """A policy over partial states, unless there is none that surely reaches the goal."""
        if self.upper < 1 or self.task.components:
            return None
        limits = self.limits.part(_SURE_SHARE)
        if self.met:
            if size(self.best.tree.root) == 1 or len(self.task.actions) > MANY_ACTIONS:
                return None
            limits = replace(limits, effort=Effort(_LOOKS))
        return plan_strong_cyclic(self.task, self.target, limits, _silent, self.options)

    def of_all_states(self) -> Plan | None:
        """The best policy that can be found, where nothing met the target."""
        if self.met or self.upper <= self.best.tree.success_probability:
            return None
        return plan_policy(self.task, self.target, self.limits, _silent, self.options)

    def refinement(self, refined: Plan | None) -> Plan | None:
        """The greedy refinement, where that may help."""
        best = self.best
        if not self.met:
            if best.tree.success_probability >= self.upper:
                return None  # nothing can do better
            return refined or self.greedy(self.limits.nodes)
        if self.options.prefer != "size" or refined is not None or len(self.task.actions) > MANY_ACTIONS:
            return None
        return self.greedy(min(self.limits.nodes, size(best.tree.root) - 1))  # a larger one would not be kept

    def greedy(self, most: int) -> Plan | None:
        """Greedy refinement within so many nodes."""
        if most < 1:
            return None
        try:
            return _refined(self.task, self.target, self.limits, most, self.options)
        except LimitReached:  # not even the goal alone is small enough
            return None


def _visited(plan: Plan) -> Iterable[Values]:
    """The states that runs visit, as far as they are known."""
    return () if plan.chain is None else (state.values for state in plan.chain.states)


def _best(task: Task, target: Fraction, limits: Limits, options: Options, refined: Plan | None) -> Plan:
    """The best plan; ``refined`` is what refinement made, if it fell short of the target before."""
    if options.max_actions is not None:
        return plan_policy(task, target, limits, _silent, options)
    auto = _Auto(task, target, limits, replace(options, retries="unbounded"))
    auto.run(refined)
    return _with_findings(_bounded(auto.best, limits, options), auto.plans)


def _bounded(plan: Plan, limits: Limits, options: Options) -> Plan:
    """The plan with as many attempts as the target takes, where that was asked for."""
    tree = plan.tree
    if options.retries != "least" or plan.chain is None:
        return plan
    best = BestTree(tree.task, tree.target, outer=options.best)
    best.take(tree.root, plan.chain, tree.success_probability)
    try:
        bound_attempts(best, limits)
    except LimitReached:
        return plan
    found = best.plan(tree.status)
    return replace(found, initial_success=plan.initial_success, refinements=plan.refinements)


def _with_repeats(plan: Plan, limits: Limits) -> Plan:
    """The plan with equal attempts that follow one another put together."""
    tree, chain = plan.tree, plan.chain
    if chain is None:
        return plan
    try:
        root = with_repeats(tree.task, tree.root, chain, limits)
        if root is tree.root:
            return plan
        chain = explore(tree.task, root, limits)
    except LimitReached:
        return plan
    return replace(plan, tree=replace(tree, root=root), figures=figures(tree.task, root, chain), chain=chain)


def _refined(task: Task, target: Fraction, limits: Limits, nodes: int, options: Options) -> Plan:
    few = replace(limits, nodes=nodes, states=min(limits.states, _REFINE_STATES))
    return refine(task, target, few, _silent, options)


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
