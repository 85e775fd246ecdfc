"""``bbtc plan``: from a domain and a problem, or a compiled task, to a tree."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from types import FrameType
from typing import TYPE_CHECKING

import click

from bbtc.cli.session import (
    Count,
    Probability,
    Session,
    Time,
    output_options,
    planning_limits,
    problem_options,
)
from bbtc.cli.session import (
    command as session_command,
)
from bbtc.cli.within_time import WithinTime
from bbtc.diagnostics import LimitReached
from bbtc.exit_status import OF_TREE, ExitStatus
from bbtc.planner.strategies import DEFAULT, others
from bbtc.watch import undivided

if TYPE_CHECKING:
    from bbtc.ground.task import Task
    from bbtc.limits import Limits
    from bbtc.planner.options import Options, Prefer, Retries
    from bbtc.planner.result import Plan, Refinement
    from bbtc.planner.why_not import DeadEnd

_TELLING = 1.0
"""Seconds for finding out why a target is out of reach, which is told besides."""


@click.command("plan")
@click.argument("files", nargs=-1, required=True, metavar="DOMAIN [PROBLEM]")
@click.option(
    "--target", type=Probability(), help="Wanted success probability; default: the problem's, else 1."
)
@click.option("--strategy", default=DEFAULT, show_default=True, help=f"Or {others()}.")
@click.option("--max-actions", type=Count(0), metavar="K", help="Let no run take more actions.")
@click.option(
    "--retries",
    type=click.Choice(["unbounded", "least"]),
    default="unbounded",
    show_default=True,
    help=f"Try again without end, or as often as the target takes ({others(lambda each: each.retries)}).",
)
@click.option(
    "--prefer",
    type=click.Choice(["success", "cost", "size"]),
    default="success",
    show_default=True,
    help="Of trees that meet the target: the one of most success, least cost, or fewest nodes.",
)
@click.option(
    "--deadline",
    type=Time(),
    metavar="SECONDS",
    help="Plan for success within so many seconds: the target is one of that.",
)
@click.option(
    "--closed-world",
    is_flag=True,
    help="Leave out what is read only in case that others change the world, too.",
)
@click.option("--guarded", is_flag=True, help="The contrary of --closed-world, and the default.")
@click.option(
    "--allow-guess",
    is_flag=True,
    help="Let the tree succeed where the goal is believed, but hidden facts leave it open.",
)
@click.option("--bounds", is_flag=True, help="Print what any policy can reach, and plan nothing.")
@click.option("--json", "as_json", is_flag=True, help="With --bounds: print it as JSON.")
@click.option("--verify", "verified", is_flag=True, help="Write the tree only if `bbtc verify` takes it.")
@click.option("-q", "--quiet", is_flag=True, help="Do not print the refinements.")
@problem_options
@planning_limits
@output_options
@session_command
def command(
    session: Session,
    files: tuple[str, ...],
    target: Fraction | None,
    strategy: str,
    max_actions: int | None,
    retries: Retries,
    prefer: Prefer,
    deadline: Fraction | None,
    closed_world: bool,
    guarded: bool,
    allow_guess: bool,
    bounds: bool,
    as_json: bool,
    verified: bool,
    quiet: bool,
    output: str,
    check: bool,
    depfile: str | None,
) -> int:
    """Plan a tree that reaches the goal with the target probability, and write it as JSON.

    Each refinement is printed: the condition that stopped the runs, what was inserted for it, and
    the success probability after it. Exit status 0: target reached; 1: out of reach of any policy;
    3: a limit was reached, or nothing was left to insert (the best tree is written all the same).

    With --bounds, the best success probability of any policy is printed in place of a plan; 0: the
    target can be reached; 1: it cannot; 3: a limit leaves that open.
    """
    from bbtc.artefacts import dumps, tree_to_json
    from bbtc.cli.inputs import load_task
    from bbtc.planner.options import DEFAULTS, Options
    from bbtc.planner.strategies import require_strategy

    if as_json and not bounds:
        raise click.UsageError("--json goes with --bounds: a tree is always written as JSON.")
    if deadline is not None and (bounds or max_actions is not None):
        raise click.UsageError("--deadline goes with neither --bounds nor --max-actions.")
    if closed_world and guarded:
        raise click.UsageError("--closed-world and --guarded contradict each other.")
    limits = session.limits
    options = Options(max_actions, retries, prefer, closed_world, allow_guess)
    require_strategy(strategy, options if not bounds else DEFAULTS)
    session.expect_output(output, files, check=check and not bounds, depfile=None if bounds else depfile)
    task = load_task(session, files, limits, keep_hidden=allow_guess)
    if bounds:
        wanted = task.goal_probability if target is None else target
        return _print_bounds(session, task, wanted, options, output, as_json=as_json)
    with best_tree_on_signals() as signals:
        within = None if deadline is None else WithinTime(deadline)
        plan = run_planner(
            session, task, target, strategy, limits, options, quiet=quiet, signals=signals, within=within
        )
        if verified:
            from bbtc.cli.commands.verify import require_verified

            signals.end_at_once()
            require_verified(session, plan.tree)
        text = dumps(tree_to_json(plan.tree))
        session.write(output, text, check=check, depfile=depfile)
    return OF_TREE[plan.tree.status]


def _print_bounds(
    session: Session, task: Task, target: Fraction, options: Options, output: str, *, as_json: bool
) -> int:
    from bbtc.cli.bounds_report import bounds_json, bounds_report
    from bbtc.planner.bounds import task_value

    with best_tree_on_signals() as signals:
        signals.listen()
        value = task_value(task, session.limits, options, costs=True)
    session.clear()
    text = bounds_json(value, target) if as_json else bounds_report(task, value, target)
    session.write(output, text)
    if value.lower >= target:
        return 0
    if value.interrupted:
        return ExitStatus.INTERRUPTED
    return ExitStatus.ERRORS if value.upper < target else ExitStatus.LIMIT


def run_planner(
    session: Session,
    task: Task,
    target: Fraction | None,
    strategy: str,
    limits: Limits,
    options: Options | None = None,
    *,
    quiet: bool,
    signals: Signals,
    within: WithinTime | None = None,
) -> Plan:
    """Plan, telling the session each refinement as it is made and how planning ended. Afterwards neither a
    limit nor a signal keeps the tree from being written."""
    from bbtc.artefacts.numbers import exact
    from bbtc.cli.bounds_report import bounds_lines, dead_end_lines
    from bbtc.cli.wording import (
        plan_summary,
        refinement_line,
        rerolled_note,
        simplified_line,
        worst_world_line,
    )
    from bbtc.ground.describe import describe
    from bbtc.pipeline import plan_task
    from bbtc.planner.options import DEFAULTS

    options = options or DEFAULTS
    told: list[Refinement] = []

    def tell(step: Refinement) -> None:
        told.append(step)
        if not quiet:
            for line in refinement_line(len(told), step):
                session.say(line)

    if not quiet:
        wanted = task.goal_probability if target is None else target
        session.say(f"{task.domain}/{task.problem}: goal {describe(task, task.goal)}, target {exact(wanted)}")

    def search_ends() -> None:
        signals.hold()
        session.watch.off()

    limits.tell("planning")
    planner = plan_task if within is None else within.plan
    plan = planner(
        task,
        target,
        strategy,
        limits,
        tell,
        options=options,
        search_begins=signals.listen,
        search_ends=search_ends,
    )
    if plan.tree.status == "stuck" and within is None:
        session.report.warning(
            "BBT0502",
            f"the strategy '{strategy}' has nothing left to insert before the target",
            task.goal_span,
            hint="another strategy may reach it",
        )
    most = options.max_actions
    ends = _dead_ends(plan, limits) if within is None else ()
    made = simplified_line(told[-1], plan.tree) if told and not quiet else []
    lines = [
        *made,
        *(plan_summary(plan, most) if within is None else within.summary(plan)),
        *worst_world_line(plan.figures),
        *(f"readings {note}" for note in rerolled_note(plan.rerolled)),
        *(bounds_lines(plan.tree, most) if within is None else []),
        *dead_end_lines(plan.tree, ends, most),
    ]
    for line in lines:
        session.say(line)
    return plan


def _dead_ends(plan: Plan, limits: Limits) -> tuple[DeadEnd, ...]:
    """Why the target is out of reach, if it is, as far as that is found soon."""
    if plan.tree.status == "out-of-reach":
        from bbtc.planner.why_not import dead_ends

        with suppress(LimitReached):
            return dead_ends(plan.tree, limits.overtime(_TELLING))
    return ()


@dataclass(slots=True)
class Signals:
    """What SIGINT (Ctrl-C) and SIGTERM do to planning: the first one ends the search with the best tree so
    far; the third one, for people without patience, ends the program without it."""

    came: int = 0
    listening: bool = False
    held: bool = False

    def listen(self) -> None:
        """From now on there is a search that can be ended."""
        self.listening = True

    def hold(self) -> None:
        """The search is over, and what is left is to write the tree: do not disturb."""
        self.held = True

    def end_at_once(self) -> None:
        """From now on a signal ends the program."""
        self.listening, self.held, self.came = True, False, 0

    def stop(self, number: int, frame: FrameType | None) -> None:
        """The handler."""
        if not self.held and (not self.listening or undivided(frame)):
            # Too early, in a moment it will do.
            threading.Timer(_MOMENT, os.kill, (os.getpid(), number)).start()
            return
        self.came += 1
        if self.came >= _IMPATIENT or (self.came == 1 and not self.held):
            raise KeyboardInterrupt


_MOMENT = 0.05  # seconds
_IMPATIENT = 3


@contextmanager
def best_tree_on_signals() -> Iterator[Signals]:
    """Handle signals as :class:`Signals` says."""
    signals = Signals()
    if threading.current_thread() is not threading.main_thread():
        yield signals
        return
    kinds = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # by whoever started us
        kinds.append(signal.SIGINT)
    before = {kind: signal.signal(kind, signals.stop) for kind in kinds}
    try:
        yield signals
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)
