"""Planning for a deadline, as the command runs it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from bbtc.rounding import decimal

if TYPE_CHECKING:
    from bbtc.ground.task import Task
    from bbtc.limits import Limits
    from bbtc.planner.options import Options
    from bbtc.planner.result import Plan, Progress


@dataclass(slots=True)
class WithinTime:
    """A deadline in seconds, and what is known of the best that any policy attains by then."""

    seconds: Fraction
    most: Fraction | None = None

    def plan(
        self,
        task: Task,
        target: Fraction | None,
        strategy: str,
        limits: Limits,
        progress: Progress,
        *,
        options: Options,
        search_begins: Callable[[], None],
        search_ends: Callable[[], None],
    ) -> Plan:
        """As :func:`bbtc.pipeline.plan_task`, for the deadline."""
        from bbtc.pipeline import plan_task
        from bbtc.planner.deadline.plan import plan_by

        found = plan_by(
            task,
            self.seconds,
            plan_task,
            target,
            limits,
            strategy=strategy,
            progress=progress,
            options=options,
            search_begins=search_begins,
            search_ends=search_ends,
        )
        self.most = found.most
        return found.plan

    def summary(self, plan: Plan) -> list[str]:
        """How planning ended, in words."""
        from bbtc.artefacts.numbers import exact
        from bbtc.artefacts.time_json import outward

        tree = plan.tree
        by = tree.success_by
        assert by is not None
        least, most = outward(float(by.at_least), up=False), outward(float(by.at_most), up=True)
        chance = least if least == most else f"from {least} to {most}"
        attained = f"success within {decimal(by.seconds, 12)} s {chance}"
        missed = f"target {exact(tree.target)} not reached"
        stop = plan.stop.message if plan.stop is not None else "a limit"
        ended = {
            "target-reached": f"target {exact(tree.target)} reached: {attained}",
            "out-of-reach": f"{missed}: it is out of reach of any policy; the best tree has {attained}",
            "stuck": f"{missed}: no better tree that reads no clock was found; it has {attained}",
            "interrupted": f"interrupted; the best tree so far has {attained}",
            "limit-reached": f"{missed}: {stop}; the best tree so far has {attained}",
        }[tree.status]
        later = f"success probability {exact(tree.success_probability)} without a deadline"
        if self.most is None:
            return [ended, later]
        return [ended, later, f"no policy does better than {outward(float(self.most), up=True)} by then"]
