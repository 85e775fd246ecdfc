"""What is possible at all: the value of a task in a few figures, and the verdict on a plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.options import DEFAULTS, Options
from bbtc.planner.result import Plan
from bbtc.tree.nodes import PlanStatus

if TYPE_CHECKING:
    from bbtc.planner.mdp.maxprob import Bounds
    from bbtc.planner.mdp.state_space import StateSpace


@dataclass(frozen=True, slots=True)
class TaskValue:
    """P* lies between ``lower`` and ``upper`` (equal: it is known exactly); with ``max_actions``,
    the best probability with at most so many actions. ``cost`` is the least expected cost of a
    policy that attains P*, exact if ``cost_exact``; None where it was not computed. Of ``states``
    found, ``expanded`` had their ``choices`` looked at: all of them, or those that matter. ``stop``
    says which limit left the bounds apart, if one did; ``interrupted`` tells that the user did."""

    lower: Fraction
    upper: Fraction
    states: int
    expanded: int
    choices: int
    max_actions: int | None = None
    cost: Fraction | None = None
    cost_exact: bool = False
    stop: Diagnostic | None = None
    interrupted: bool = False


def task_value(
    task: Task,
    limits: Limits,
    options: Options = DEFAULTS,
    *,
    costs: bool = False,
    target: Fraction | None = None,
) -> TaskValue:
    """The value of a task; ``costs`` asks for the least cost, too, which is found where the whole space
    is small enough. With a ``target``, the bounds may stay apart where they tell whether it can be
    reached. Limits make the bounds wider, up to 0 and 1."""
    from bbtc.planner.mdp.solve import best_within

    if task.components:
        from bbtc.planner.stopping import stopping_of

        stopping = stopping_of(task, options)
        task = task if stopping is None else stopping.task
    steps = options.max_actions
    try:
        if steps is None:
            return _without_end(task, limits, costs=costs, target=target)
        within = best_within(task, limits, steps)
        return _value(within.horizon.space, within.bounds, max_actions=steps, stop=within.stop)
    except LimitReached as reached:
        stop, known = reached.diagnostics[0], bounds_of(reached)
        return TaskValue(known.lower, known.upper, 0, 0, 0, max_actions=steps, stop=stop)


def bounds_of(reached: LimitReached) -> Bounds:
    """What was known of P* when a limit was met."""
    from bbtc.planner.mdp.maxprob import Bounds
    from bbtc.planner.mdp.solve import OnlyBounds

    return reached.bounds if isinstance(reached, OnlyBounds) else Bounds(Fraction(0), Fraction(1))


def _without_end(task: Task, limits: Limits, *, costs: bool, target: Fraction | None) -> TaskValue:
    from bbtc.planner.mdp.solve import best_known
    from bbtc.planner.mdp.ssp import least_cost

    best = best_known(task, limits, target, costs=costs, verdict=True)
    cost, stop = None, best.stop
    if costs and best.space.complete:
        try:
            cost = least_cost(best.found, limits)
        except LimitReached as reached:
            stop = reached.diagnostics[0]
    return _value(
        best.space,
        best.bounds,
        cost=None if cost is None else cost.initial,
        cost_exact=cost is not None and cost.exact,
        stop=stop,
        interrupted=best.interrupted,
    )


def _value(
    space: StateSpace,
    bounds: Bounds,
    *,
    max_actions: int | None = None,
    cost: Fraction | None = None,
    cost_exact: bool = False,
    stop: Diagnostic | None,
    interrupted: bool = False,
) -> TaskValue:
    return TaskValue(
        lower=bounds.lower,
        upper=bounds.upper,
        states=len(space.states),
        expanded=space.expanded,
        choices=len(space.choice_action),
        max_actions=max_actions,
        cost=cost,
        cost_exact=cost_exact,
        stop=stop,
        interrupted=interrupted,
    )


def judged(plan: Plan, limits: Limits, options: Options = DEFAULTS) -> Plan:
    """The plan with bounds on what any policy can do, where it falls short of its target; its
    status is ``out-of-reach`` if the upper bound does, too."""
    tree = plan.tree
    if tree.status not in {"stuck", "limit-reached"} or tree.bounds is not None:
        return plan
    lower, upper, interrupted = tree.success_probability, Fraction(1), False
    try:
        value = task_value(tree.task, limits, replace(options, allow_guess=False), target=tree.target)
        lower, upper, interrupted = max(lower, value.lower), value.upper, value.interrupted
    except (LimitReached, MemoryError):
        pass
    except KeyboardInterrupt:
        return replace(plan, tree=replace(tree, status="interrupted"))
    status: PlanStatus = "out-of-reach" if upper < tree.target else tree.status
    if interrupted:
        status = "interrupted"
    return replace(plan, tree=replace(tree, status=status, bounds=(lower, upper)))


def unjudged(plan: Plan, reached: LimitReached) -> Plan:
    """The plan with the bounds that hold without looking, where a limit ended planning before it had any:
    what the tree does itself, and what was known then."""
    tree = plan.tree
    if tree.status != "limit-reached" or tree.bounds is not None:
        return plan
    own = tree.success_probability
    return replace(plan, tree=replace(tree, bounds=(own, max(own, bounds_of(reached).upper))))
