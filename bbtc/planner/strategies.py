"""The planning strategies by name."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from importlib import import_module

from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.options import Options
from bbtc.planner.result import Plan, Progress, Strategy

STRATEGIES = {
    "refine": ("bbtc.planner.chaining.refine", "refine"),
    "search": ("bbtc.planner.chaining.search", "plan_search"),
    "policy": ("bbtc.planner.synthesis.policy", "plan_policy"),
    "strong-cyclic": ("bbtc.planner.strong_cyclic.plan", "plan_strong_cyclic"),
    "auto": ("bbtc.planner.auto", "plan_auto"),
    "advised": ("bbtc.planner.auto", "plan_advised"),
}
"""Module and function of each strategy, imported when used."""

DEFAULT = "advised"


def require_strategy(name: str, options: Options) -> None:
    """Raises :class:`BbtcError` for an unknown strategy, and for options that it does not know."""
    if name not in STRATEGIES:
        raise BbtcError.single(
            "BBT0501", f"unknown strategy '{name}'", hint=f"known: {', '.join(STRATEGIES)}"
        )
    if name in {"refine", "search", "strong-cyclic"} and options.max_actions is not None:
        raise BbtcError.single(
            "BBT0503",
            f"the strategy '{name}' does not plan within a number of actions",
            hint="use --strategy policy",
        )


def run_strategy(
    name: str, task: Task, target: Fraction, *, limits: Limits, progress: Progress, options: Options
) -> Plan:
    """Plan with a strategy. Raises :class:`BbtcError` as :func:`require_strategy` does."""
    require_strategy(name, options)
    module, function = STRATEGIES[name]
    strategy: Strategy = getattr(import_module(module), function)
    from bbtc.planner.guard import guarded, most_more

    # Strategies need not know of guards: they change nothing in the simulation.
    unguarded = replace(options, guarded=False)
    if options.guarded:
        limits = replace(limits, nodes=max(1, limits.nodes - most_more(task)))
    plan = strategy(task, target, limits, progress, unguarded)
    return guarded(plan, limits) if options.guarded else plan
