"""What is possible at all: the value of a task in a few figures, and the verdict on a plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from bbtc.diagnostics import Diagnostic, LimitReached
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.plan.options import DEFAULTS, Options
from bbtc.plan.result import Plan


@dataclass(frozen=True, slots=True)
class TaskValue:
    """P* lies between ``lower`` and ``upper`` (equal: it is known exactly); with ``max_actions``,
    the best probability with at most so many actions. ``cost`` is the least expected cost of a
    policy that attains P*, exact if ``cost_exact``; None where it was not computed. ``stop`` says
    which limit left the bounds apart, if one did."""

    lower: Fraction
    upper: Fraction
    states: int
    choices: int
    max_actions: int | None = None
    cost: Fraction | None = None
    cost_exact: bool = False
    stop: Diagnostic | None = None


def task_value(task: Task, limits: Limits, options: Options = DEFAULTS, *, costs: bool = False) -> TaskValue:
    """The value of a task; ``costs`` asks for the least cost, too. Limits make the bounds wider; only
    time that is over before anything was found raises ``LimitReached``."""
    from bbtc.plan.space import explore_space
    from bbtc.plan.value import Bounds, best_probability, reachability
    from bbtc.plan.value_cost import least_cost
    from bbtc.plan.value_horizon import horizon_values

    space = explore_space(task, limits, options.max_actions)
    cost = None
    stop = space.stop
    if options.max_actions is not None and space.stop is None:
        try:
            bounds = horizon_values(space, options.max_actions, limits).initial[-1]
        except LimitReached as reached:
            bounds, stop = Bounds(Fraction(0), Fraction(1)), reached.diagnostics[0]
    elif options.max_actions is None and space.complete:
        found = reachability(space, limits)
        bounds = found.initial
        if costs:
            try:
                cost = least_cost(found, limits)
            except LimitReached as reached:
                stop = reached.diagnostics[0]
    else:
        bounds = best_probability(space, limits)
    return TaskValue(
        lower=bounds.lower,
        upper=bounds.upper,
        states=len(space.states),
        choices=len(space.choice_action),
        max_actions=options.max_actions,
        cost=None if cost is None else cost.initial,
        cost_exact=cost is not None and cost.exact,
        stop=stop,
    )


def judged(plan: Plan, limits: Limits, options: Options = DEFAULTS) -> Plan:
    """The plan with bounds on what any policy can do, where it falls short of its target; its
    status is ``out-of-reach`` if the upper bound does, too."""
    tree = plan.tree
    if tree.status not in {"stuck", "limit-reached"} or tree.bounds is not None:
        return plan
    lower, upper = tree.success_probability, Fraction(1)
    try:
        value = task_value(tree.task, limits, options)
        lower, upper = max(lower, value.lower), value.upper
    except (LimitReached, MemoryError):
        pass
    except KeyboardInterrupt:
        return replace(plan, tree=replace(tree, status="interrupted"))
    status = "out-of-reach" if upper < tree.target else tree.status
    return replace(plan, tree=replace(tree, status=status, bounds=(lower, upper)))
