"""The strategies that choose among others.

``auto``, the default, has several planners make a tree, each with a share of the time, and keeps the best
(:mod:`bbtc.planner.objective`). What one of them finds decides how much the next ones may do:

1. Unless the world is closed, learn rules for all states that actions lead to, or others may
   (:mod:`bbtc.planner.recovering`), if these are few. Where the tree proves to be the best there is, and is
   so small that no smaller one could rule it out, planning ends.
2. Search over refinements: it takes time with the size of the tree, not of the task.
3. Write down an optimal policy, of the whole space where that is small. Where a tree that meets the target is
   known already, as few states and actions as take a moment are looked at, or, where it is large, some more.
4. A policy over partial states, which surely reaches the goal, unless it is known that there is none. Where a
   tree that meets the target is known, with an effort of a moment.
5. Where nothing met the target, write down the best policy that the limits allow to find: it tells whether
   the target can be reached.
6. Refine greedily, as published, with equal attempts that follow one another put together
   (:mod:`bbtc.rewrite.repeat`): where nothing met the target, where the task has templates, which only
   refinement follows, and where the smallest tree is asked for; in no more nodes than a tree may have that
   would be kept.
7. The rules of 1, where there are more states. Where that takes too long, or does not help, and the smallest
   tree is not asked for, plan as in 3 and 4 once more, for what others may make of visited states, too
   (:mod:`bbtc.planner.elsewhere`).

Where there are numbers: the rules of 1, an optimal policy, and the rules of 7; what else there is asks for
facts one by one.

Where facts are hidden: an optimal policy over what is believed, a search over refinements, and, where neither
met the target, greedy refinement.

``advised`` trusts templates, their author's advice on how things are done, more than figures: where a task
has some, and refinement meets the target, its tree is taken; else ``auto``.
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
from bbtc.planner.elsewhere import also_at, elsewhere_of, only_at, starts_elsewhere
from bbtc.planner.finish import bound_attempts
from bbtc.planner.guard import guarded
from bbtc.planner.objective import UNSEEN, Elsewhere, Worth, allowance, best_of
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.recovering import Recovering, recovering_tree
from bbtc.planner.result import Plan, Progress, Refinement
from bbtc.planner.strong_cyclic.plan import plan_strong_cyclic, sure_starts
from bbtc.planner.synthesis.policy import plan_policy
from bbtc.rewrite.repeat import with_repeats
from bbtc.rewrite.simplify import size
from bbtc.tree.nodes import Node

MANY_ACTIONS = 500
"""A task with more gets no second opinion once a tree meets the target."""

STATES_AND_ACTIONS = 200_000
"""For a second opinion, states times actions of the task are explored up to this number."""

_WORK_ELSEWHERE = 50_000
"""The same for a policy from states that others may leave the world in."""

LARGE_TREE = 100
"""Nodes; a tree of more is hard to read, and a second opinion on it worth more work."""

_WORK_FOR_LARGE = 1_000_000
"""States times actions explored for a second opinion on a large tree, or for one that recovers: a second or
two."""

_LOOKS = 150
"""Looks at the clock in the search for a policy over partial states, for a second opinion."""

_LOOKS_ELSEWHERE = 50
"""The same for policies from states that others may leave the world in."""

_LOOKS_RECOVERING = 1500
"""The same for rules for all states."""

_LOOKS_FIRST = 500
"""The same in the search over refinements, before others are tried."""

_FEW_STATES = 500
"""States for which rules are learnt before anything else is tried."""

_MOST_RECOVERING = 60_000
"""States for which a tree that recovers from anywhere is made."""


_REFINE_STATES = 20_000
"""States of one simulation while refining for a second opinion."""

_POLICY_SHARE = 0.7  # of the time, where facts are hidden
_STATES_ELSEWHERE = 5_000
"""States of the simulation of a tree from where others may leave the world."""

_SEARCH_SHARE, _SURE_SHARE, _NEARLY_ALL = 0.4, 0.5, 0.9  # of the time left


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
    follows = follows and not task.numbers
    if task.templates and len(task.actions) <= MANY_ACTIONS and follows:
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


@dataclass(slots=True)
class _Candidate:
    """A plan; the rules for all states that it is made of, if it is; and what its tree does from where others
    may leave the world, once that was looked at."""

    plan: Plan
    recovers: Recovering | None = None
    elsewhere: Elsewhere = UNSEEN
    worth: Worth = field(init=False)
    """What counts of it."""

    def __post_init__(self) -> None:
        self.worth = Worth.of(self.plan, self.elsewhere)


@dataclass(slots=True)
class _Auto:
    """The plans found so far."""

    task: Task
    target: Fraction
    limits: Limits
    options: Options
    candidates: list[_Candidate] = field(default_factory=list)
    elsewhere: Task | None = None
    """The task, beginning in states that others may leave it in."""
    learnt: bool = False
    """Are rules for all states looked for no more?"""
    begun: int = 0
    """The number of the plan of the search that was tried first."""

    @property
    def plans(self) -> list[Plan]:
        """The plans."""
        return [each.plan for each in self.candidates]

    @property
    def best(self) -> _Candidate:
        """The best of them."""
        worths = [each.worth for each in self.candidates]
        return self.candidates[best_of(worths, self.target, self.options.prefer)]

    @property
    def met(self) -> bool:
        """Does one meet the target?"""
        return self.best.worth.success >= self.target

    @property
    def interrupted(self) -> bool:
        """Did the user end it?"""
        return any(plan.tree.status == "interrupted" for plan in self.plans)

    @property
    def upper(self) -> Fraction:
        """No policy does better."""
        return min((plan.tree.bounds[1] for plan in self.plans if plan.tree.bounds), default=Fraction(1))

    def add(self, plan: Plan | None, recovers: Recovering | None = None) -> None:
        """Take a plan into account."""
        if plan is not None:
            plan = plan if self.options.closed_world else guarded(plan)
            self.candidates.append(self.looked_at(_Candidate(plan, recovers)))

    def run(self, refined: Plan | None) -> None:
        """Make plans; ``refined`` is what refinement made, if it fell short of the target before."""
        if self.task.components:
            self.of_hidden(refined)
            return
        if self.learns(_FEW_STATES, everywhere=True) and self.proven:
            return
        if self.task.numbers:
            self.of_numbers()
            return
        self.begun = len(self.candidates)
        self.add(self.searched(replace(self.limits, effort=Effort(_LOOKS_FIRST))))
        for step in (self.of_few_states, self.surely, self.searched_on, self.of_all_states):
            if not self.interrupted:
                self.add(step())
        if not self.interrupted:
            self.add(self.refinement(refined))
        if not self.interrupted and not self.options.closed_world:
            with suppress(LimitReached):
                self.go_on_from_elsewhere()

    def of_hidden(self, refined: Plan | None) -> None:
        """Plans where facts are hidden: what others do is left out, and a policy is what readings are best
        for."""
        task, target, options = self.task, self.target, self.options
        self.add(plan_policy(task, target, self.limits.part(_POLICY_SHARE), _silent, options))
        if not self.interrupted:
            limits = self.limits
            if self.met and task.endless_beliefs:  # trees that ask without end would use up all states
                limits = replace(limits, states=min(limits.states, _FEW_STATES))
            self.add(self.searched(limits))
        if not self.interrupted and not self.met:
            self.add(self.refinement(refined))

    def of_numbers(self) -> None:
        """Plans where there are numbers."""
        self.add(plan_policy(self.task, self.target, self.limits, _silent, self.options))
        if not self.interrupted and not self.options.closed_world:
            with suppress(LimitReached):
                self.go_on_from_elsewhere()

    def looked_at(self, candidate: _Candidate) -> _Candidate:
        """What the tree does from where others may leave the world; nothing good if that takes too long."""
        if self.elsewhere is None:
            return candidate
        few = replace(self.limits, states=min(self.limits.states, _STATES_ELSEWHERE))
        try:
            found = elsewhere_of(explore(self.elsewhere, candidate.plan.tree.root, few), candidate.plan.chain)
        except LimitReached:
            found = UNSEEN
        return replace(candidate, elsewhere=found)

    def go_on_from_elsewhere(self) -> None:
        """Policies that hold from where others may leave the world, too. Raises ``LimitReached``."""
        task, best = self.task, self.best.plan
        if not task.actions or len(task.actions) > MANY_ACTIONS or not best.tree.success_probability:
            return
        starts = starts_elsewhere(task, self.limits, _visited(best))
        if not starts:
            return
        self.elsewhere = only_at(task, starts)
        self.candidates = [self.looked_at(each) for each in self.candidates]
        self.learns(_MOST_RECOVERING)
        if self.best.recovers or self.options.prefer == "size":
            return
        few = replace(self.limits, states=max(1, _WORK_ELSEWHERE // len(task.actions)))
        with suppress(LimitReached):
            wider = also_at(task, starts)
            self.add_for_own_starts(plan_policy(wider, self.target, few, _silent, self.inner, whole=True))
        surely = any(plan.tree.success_probability == 1 and plan.chain is not None for plan in self.plans)
        if surely and not task.events and not task.numbers:
            self.surely_from(starts)

    def learns(self, most: int, *, everywhere: bool = False) -> bool:
        """Rules for all states that actions lead to, or really for all, if these are few; are there any?"""
        actions = len(self.task.actions)
        if self.learnt or self.options.closed_world or not 0 < actions <= MANY_ACTIONS:
            return False
        most = min(self.limits.states, most, max(1, _WORK_FOR_LARGE // actions))
        limits = replace(self.limits.part(_SURE_SHARE), states=most, effort=Effort(_LOOKS_RECOVERING))
        try:
            found = recovering_tree(self.task, limits, everywhere=everywhere)
            self.learnt = True
            if found is None or not found.bounds.upper:
                return False
            self.add_tree(found.root, found)
        except LimitReached:
            return False
        return True

    @property
    def proven(self) -> bool:
        """Is the best tree the best there is by success, cost and recovery, and so small that no smaller one
        could rule it out?"""
        best = self.best
        return (
            self.options.prefer == "success"
            and best.recovers is not None
            and best.recovers.everywhere
            and best.plan.tree.success_probability == best.recovers.bounds.exact
            and best.worth.nodes <= allowance(1)
        )

    def surely_from(self, starts: Sequence[tuple[Truth, ...]]) -> None:
        """A policy over partial states for those of the starts from which one surely reaches the goal."""
        limits = replace(self.limits.part(_SURE_SHARE), effort=Effort(_LOOKS_ELSEWHERE))
        sure = sure_starts(only_at(self.task, starts), limits)
        if sure:
            wider = also_at(self.task, sure)
            self.add_for_own_starts(plan_strong_cyclic(wider, Fraction(1), limits, _silent, self.inner))

    @property
    def inner(self) -> Options:
        """For plans of other tasks than this one."""
        return replace(self.options, best=None)

    def add_for_own_starts(self, plan: Plan) -> None:
        """Take the tree of a plan for other starts into account. Raises ``LimitReached``."""
        if plan.tree.status == "interrupted":
            raise KeyboardInterrupt
        self.add_tree(plan.tree.root)

    def add_tree(self, root: Node, recovers: Recovering | None = None) -> None:
        """Take a tree into account. Raises ``LimitReached``."""
        self.limits.check_nodes(size(root))
        chain = explore(self.task, root, replace(self.limits, states=min(self.limits.states, _REFINE_STATES)))
        best = BestTree(self.task, self.target, outer=self.options.best)
        best.take(root, chain, success_of(chain))
        plan = best.plan("stuck")
        if recovers is not None:
            bounds = recovers.bounds.lower, recovers.bounds.upper
            plan = replace(plan, tree=replace(plan.tree, bounds=bounds))
        self.add(plan, recovers)

    def searched(self, limits: Limits) -> Plan:
        """Search over refinements."""
        return plan_search(self.task, self.target, limits.part(_SEARCH_SHARE), _silent, self.options)

    def searched_on(self) -> Plan | None:
        """The same in full, where nothing met the target, and the first search did not come to its end."""
        stop = self.candidates[self.begun].plan.stop
        if stop is None or self.met or self.upper <= self.best.worth.success:
            return None
        del self.candidates[self.begun]
        return self.searched(self.limits)

    def of_few_states(self) -> Plan | None:
        """An optimal policy, where a moment is enough to explore the whole space."""
        nodes, actions = self.best.worth.nodes, len(self.task.actions)
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
        if self.upper < 1 or self.task.events:
            return None
        # Where it finds none, it looks for the best policy there is: both share nearly all the time.
        limits = self.limits.part(_SURE_SHARE if self.met else _NEARLY_ALL)
        if self.met:
            if self.best.worth.nodes == 1 or len(self.task.actions) > MANY_ACTIONS:
                return None
            limits = replace(limits, effort=Effort(_LOOKS))
        return plan_strong_cyclic(self.task, self.target, limits, _silent, self.options)

    def of_all_states(self) -> Plan | None:
        """The best policy that can be found, where nothing met the target."""
        if self.met or self.upper <= self.best.worth.success:
            return None
        return plan_policy(self.task, self.target, self.limits, _silent, self.options)

    def refinement(self, refined: Plan | None) -> Plan | None:
        """The greedy refinement, where that may help."""
        best, options = self.best, self.options
        if not self.met:
            if best.worth.success >= self.upper:
                return None  # nothing can do better
            return refined or self.greedy(self.limits.nodes)
        if refined is not None or len(self.task.actions) > MANY_ACTIONS:
            return None
        if options.prefer != "size" and (not self.task.templates or options.retries == "least"):
            return None
        # A larger one would not be kept.
        fewer = options.prefer == "size" or (options.prefer == "success" and best.recovers is not None)
        return self.greedy(best.worth.nodes - 1 if fewer else allowance(best.worth.nodes))

    def greedy(self, most: int) -> Plan | None:
        """Greedy refinement within so many nodes."""
        if most < 1:
            return None
        try:
            return _refined(self.task, self.target, self.limits, min(most, self.limits.nodes), self.options)
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
    return _with_findings(_bounded(auto.best.plan, limits, options), auto.plans)


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
    plan = refine(task, target, few, _silent, options)
    return _with_repeats(plan, limits) if plan.tree.status == "target-reached" else plan


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
