"""The planning strategies by name, and what each can do: options, refusals and help follow from the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from importlib import import_module
from typing import Protocol

from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.planner.options import Options
from bbtc.planner.result import Plan, Progress


class Strategy(Protocol):
    """A planner: from a ground task and a target probability to a plan. Always returns."""

    def __call__(
        self, task: Task, target: Fraction, limits: Limits, progress: Progress, options: Options = ...
    ) -> Plan:
        """Plan. ``progress`` is told every refinement as it is made."""
        ...


@dataclass(frozen=True, slots=True)
class Entry:
    """Module and function of a strategy, imported when used, and which options it knows: ``max_actions`` is
    refused where it does not; ``retries`` changes nothing there. ``hidden``, ``events``, ``numbers``: does it
    plan with hidden facts, with what happens by itself, with numbers?"""

    module: str
    function: str
    max_actions: bool = False
    retries: bool = False
    hidden: bool = True
    events: bool = True
    numbers: bool = True

    def load(self) -> Strategy:
        """The strategy."""
        found: Strategy = getattr(import_module(self.module), self.function)
        return found


STRATEGIES = {
    "refine": Entry("bbtc.planner.chaining.refine", "refine", numbers=False),
    "search": Entry("bbtc.planner.chaining.search", "plan_search", retries=True, numbers=False),
    "policy": Entry("bbtc.planner.synthesis.policy", "plan_policy", max_actions=True, retries=True),
    "strong-cyclic": Entry(
        "bbtc.planner.strong_cyclic.plan",
        "plan_strong_cyclic",
        hidden=False,
        events=False,
        numbers=False,
    ),
    "auto": Entry("bbtc.planner.auto", "plan_auto", max_actions=True, retries=True),
    "advised": Entry("bbtc.planner.auto", "plan_advised", max_actions=True, retries=True),
}

DEFAULT = "auto"


def others(those: Callable[[Entry], bool] = lambda _: True) -> str:
    """The names of strategies other than the default, for help."""
    return ", ".join(name for name, entry in STRATEGIES.items() if name != DEFAULT and those(entry))


def require_strategy(name: str, options: Options) -> None:
    """Raises :class:`BbtcError` for an unknown strategy, and for options that it does not know."""
    if name not in STRATEGIES:
        raise BbtcError.single(
            "BBT0501", f"unknown strategy '{name}'", hint=f"known: {', '.join(STRATEGIES)}"
        )
    if options.max_actions is not None and not STRATEGIES[name].max_actions:
        raise BbtcError.single(
            "BBT0503",
            f"the strategy '{name}' does not plan within a number of actions",
            hint=f"use --strategy {next(name for name, entry in STRATEGIES.items() if entry.max_actions)}",
        )


def run_strategy(
    name: str, task: Task, target: Fraction, *, limits: Limits, progress: Progress, options: Options
) -> Plan:
    """Plan with a strategy, but for guards. Raises :class:`BbtcError` as :func:`require_strategy` does."""
    require_strategy(name, options)
    if task.components and not STRATEGIES[name].hidden:
        raise BbtcError.single(
            "BBT0505",
            f"the strategy '{name}' does not plan with hidden facts",
            hint=f"use --strategy {next(name for name, entry in STRATEGIES.items() if entry.hidden)}",
        )
    if task.events and not STRATEGIES[name].events:
        raise BbtcError.single(
            "BBT0505",
            f"the strategy '{name}' does not plan with events",
            hint=f"use --strategy {next(name for name, entry in STRATEGIES.items() if entry.events)}",
        )
    if task.numbers and not STRATEGIES[name].numbers:
        raise BbtcError.single(
            "BBT0441",
            f"the strategy '{name}' does not plan with numbers, such as {task.numbers[0].name}",
            hint=f"use --strategy {next(name for name, entry in STRATEGIES.items() if entry.numbers)}",
        )
    if not options.closed_world:
        from bbtc.planner.guard import most_more

        limits = replace(limits, nodes=max(min(1, limits.nodes), limits.nodes - most_more(task)))
    return STRATEGIES[name].load()(task, target, limits, progress, options)
