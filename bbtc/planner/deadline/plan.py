"""Planning for success by a deadline.

1. Plan as ever, for success, for the least cost, and for the least time. 2. Solve the task in steps of time
by backward induction. 3. Write a policy that reads no clock as a tree. 4. Of all these trees, take the one
that is most certain to succeed by the deadline: by the lower of the two bounds.

So the tree is never worse than those that are planned without a deadline. What any policy could attain, also
one that reads a clock, is told beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TypeAlias

import numpy as np

from bbtc import durations
from bbtc.belief.chain import explore
from bbtc.belief.simulate import figures, success_of
from bbtc.diagnostics import BbtcError, LimitReached
from bbtc.ground.task import Factor, GroundAction, Task
from bbtc.limits import Limits
from bbtc.planner.best_tree import BestTree
from bbtc.planner.deadline.induction import induction
from bbtc.planner.deadline.process import TimedProcess, timed_process
from bbtc.planner.deadline.stationary import stationary
from bbtc.planner.finish import checked, finish
from bbtc.planner.guard import guarded
from bbtc.planner.options import Options, Prefer
from bbtc.planner.result import Plan, Progress, Refinement
from bbtc.planner.synthesis.permissive import MultiPolicy, multi_policy
from bbtc.planner.synthesis.tree import synthesize
from bbtc.rewrite.simplify import size
from bbtc.rounding import decimal
from bbtc.timing.chain import Untimed, timed
from bbtc.timing.figures import success_by, unknown, whole_step
from bbtc.tree.nodes import PlanStatus, SuccessBy

_SHARE = 0.3  # of the time, for planning as ever, and each of the others
Planner: TypeAlias = Callable[..., Plan]
_STEPS = 300  # of time, up to the deadline


@dataclass(frozen=True, slots=True)
class DeadlinePlan:
    """The plan whose tree succeeds by the deadline with a probability between the bounds that it claims; no
    policy does better than ``most`` (None: not known)."""

    plan: Plan
    most: Fraction | None

    @property
    def by(self) -> SuccessBy:
        """What the tree claims."""
        assert self.plan.tree.success_by is not None
        return self.plan.tree.success_by


def plan_by(
    task: Task,
    seconds: Fraction,
    planner: Planner,
    target: Fraction | None,
    limits: Limits,
    *,
    strategy: str,
    progress: Progress,
    options: Options,
    search_begins: Callable[[], None] = lambda: None,
    search_ends: Callable[[], None] = lambda: None,
) -> DeadlinePlan:
    """Plan for success within so many seconds. The planner is :func:`bbtc.pipeline.plan_task`, and the other
    arguments are its own. Raises as that does, and :class:`BbtcError` where it is not known how long actions
    take, and where no run can be done in time."""
    if not timed(task):
        raise unknown("no action of the task has a `:duration`")
    wanted = task.goal_probability if target is None else target
    part = limits.part(_SHARE)
    first = planner(task, target, strategy, part, progress, options=options, search_begins=search_begins)
    best = judged(first, seconds, limits)
    search = _Search(task, seconds, planner, limits, options)
    stop = first.stop
    try:
        for plan in search.plans(target, strategy):
            best = max(best, judged(plan, seconds, limits), key=_worth)
    except LimitReached as reached:
        stop = reached.diagnostics[0]
    except KeyboardInterrupt:
        best = replace(best, tree=replace(best.tree, status="interrupted"))
    search_ends()
    most = None if search.most is None else max(search.most, _by(best).at_least)
    status: PlanStatus = (
        best.tree.status
        if best.tree.status == "interrupted"
        else "stuck"
        if stop is None
        else "limit-reached"
    )
    if _by(best).at_least >= wanted:
        status = "target-reached"
    elif most is not None and most < wanted:
        status = "out-of-reach"
    tree = replace(best.tree, status=status, target=wanted, bounds=first.tree.bounds)
    return DeadlinePlan(replace(best, tree=tree, stop=stop), most)


def judged(plan: Plan, seconds: Fraction, limits: Limits) -> Plan:
    """The plan with what its tree claims of a deadline. Raises :class:`BbtcError` where that is not known."""
    tree = plan.tree
    chain = explore(tree.task, tree.root, Limits(states=limits.states))
    return replace(plan, tree=replace(tree, success_by=success_by(tree.task, chain, seconds, limits)))


def _by(plan: Plan) -> SuccessBy:
    assert plan.tree.success_by is not None
    return plan.tree.success_by


def _worth(plan: Plan) -> tuple[Fraction, Fraction, int]:
    return _by(plan).at_least, plan.figures.success, -size(plan.tree.root)


@dataclass(slots=True)
class _Search:
    """Other trees than the one that is planned without a deadline."""

    task: Task
    seconds: Fraction
    planner: Planner
    limits: Limits
    options: Options
    most: Fraction | None = None

    def plans(self, target: Fraction | None, strategy: str) -> Iterator[Plan]:
        """Plans to compare. Raises ``LimitReached``."""
        quick = by_time(self.task)
        preferences: list[tuple[Task, Prefer]] = [(quick, "success"), (self.task, "cost"), (quick, "cost")]
        process = None if self.task.components else self._process()
        for task, prefer in preferences:
            options = replace(self.options, prefer=prefer)
            with suppress(LimitReached):
                part = self.limits.part(_SHARE)
                plan = self.planner(task, target, strategy, part, _quiet, options=options)
                yield self._of_task(plan)
        if process is not None:
            yield from self._by_induction(process)

    def _process(self) -> TimedProcess | None:
        """The task in time, unless it is too large, or some action does not tell its time. Raises
        :class:`BbtcError` where no run can be done by the deadline."""
        try:
            process = timed_process(self.task, self.limits.part(_SHARE))
        except (LimitReached, Untimed):
            return None
        soonest = process.soonest()
        if soonest is not None and soonest > self.seconds:
            message = f"no run can reach the goal within {decimal(self.seconds, 12)} s"
            hint = f"the soonest takes {decimal(soonest, 12)} s"
            raise BbtcError.single("BBT0447", message, self.task.goal_span, hint)
        return process

    def _of_task(self, plan: Plan) -> Plan:
        """The plan for the task itself, which counts other costs."""
        chain = explore(self.task, plan.tree.root, Limits(states=self.limits.states))
        found = figures(self.task, plan.tree.root, chain)
        return replace(plan, tree=replace(plan.tree, task=self.task), figures=found, chain=None)

    def _by_induction(self, process: TimedProcess) -> Iterator[Plan]:
        step = whole_step(process.ways, self.seconds, _STEPS)
        most = int(self.seconds / step)
        early = induction(process, step, most, self.limits, late=False)
        if early.settled:
            # Of sums and products of numbers from 0 on, each rounded to 2**-53.
            self.most = min(Fraction(1), Fraction(early.at_start(process)) * (1 + Fraction(1, 10**9)))
        late = induction(process, step, most, self.limits, late=True)
        policies = list(stationary(process, late, step, self.limits.part(_SHARE)))
        if policies:
            taken = np.zeros(len(process.ways), dtype=np.bool_)
            taken[policies[-1]] = True
            yield self._tree_of(multi_policy(process.space, taken))

    def _tree_of(self, policy: MultiPolicy) -> Plan:
        root = synthesize(self.task, policy, self.limits)
        best = BestTree(self.task, Fraction(0))
        chain = explore(self.task, root, self.limits)
        best.take(root, chain, success_of(chain))
        finish(best, self.limits, self.options)
        plan = best.plan("stuck")
        return checked(plan if self.options.closed_world else guarded(plan), self.limits)[0]


def by_time(task: Task) -> Task:
    """The task in which an action costs the time that it takes on average."""
    events = (replace(event, factors=tuple(map(_without_cost, event.factors))) for event in task.events)
    return replace(task, metric="cost", actions=tuple(map(_by_time, task.actions)), events=tuple(events))


def _by_time(action: GroundAction) -> GroundAction:
    takes = action.duration or durations.INSTANT
    mean = durations.mean(takes)[0]
    if action.timeout is not None:
        kept = durations.partial_mean(takes, action.timeout)[0]
        mean = kept + durations.exceeding(takes, action.timeout) * action.timeout
    factors = tuple(map(_without_cost, action.factors))
    return replace(action, cost=mean, factors=factors)


def _without_cost(factor: Factor) -> Factor:
    outcomes = (
        replace(each, cost=Fraction(0), charges=(), factors=tuple(map(_without_cost, each.factors)))
        for each in factor.outcomes
    )
    return replace(factor, outcomes=tuple(outcomes))


def _quiet(_: Refinement) -> None:
    """The refinements of other trees are not told."""
