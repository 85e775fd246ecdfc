"""``bbtc simulate``: the exact figures of a tree."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar

import click

from bbtc.cli.session import Count, Probability, Seed, Session, Time, limit_options, problem_options
from bbtc.cli.session import command as session_command
from bbtc.diagnostics import LimitReached

if TYPE_CHECKING:
    from bbtc.belief.scenarios import Scenario
    from bbtc.cli.time_report import ToldTimes
    from bbtc.limits import Limits
    from bbtc.tree.nodes import Tree


@click.command("simulate")
@click.argument("tree", metavar="TREE")
@click.argument("others", nargs=-1, metavar="[DOMAIN PROBLEM | TASK]")
@click.option("--scenarios", type=Count(0), default=0, metavar="N", help="List the N most probable runs.")
@click.option(
    "--samples",
    type=Count(1),
    metavar="N",
    help="Also sample N runs (Monte Carlo); with --recovery, N states.",
)
@click.option(
    "--perturb",
    type=Probability(),
    metavar="RATE",
    help="Also run TREE where before each tick, with this probability, a fact changes by itself.",
)
@click.option("--runs", type=Count(1), default=10_000, show_default=True, help="Runs with --perturb.")
@click.option("--max-ticks", type=Count(1), default=1000, show_default=True, help="Ticks of such a run.")
@click.option(
    "--recovery",
    is_flag=True,
    help="Also tell what a new tree attains from every state that actions lead to, beside the best possible.",
)
@click.option("--seed", type=Seed(), default=0, show_default=True, help="Seed of everything that is sampled.")
@click.option(
    "--failing",
    type=Count(0),
    default=3,
    show_default=True,
    metavar="N",
    help="List the N most probable runs that fail, each with the fact it lacks at its root.",
)
@click.option("--time-step", type=Time(), metavar="S", help="Step of the curve of success by a time.")
@click.option("--curve", metavar="FILE.svg", help="Also write that curve, as a picture.")
@click.option("--json", "as_json", is_flag=True, help="Write the figures as JSON instead of text.")
@click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; - is stdout (default).")
@problem_options
@limit_options
@session_command
def command(
    session: Session,
    tree: str,
    others: tuple[str, ...],
    scenarios: int,
    failing: int,
    samples: int | None,
    perturb: Fraction | None,
    runs: int,
    max_ticks: int,
    recovery: bool,
    seed: int,
    time_step: Fraction | None,
    curve: str | None,
    as_json: bool,
    output: str,
) -> None:
    """Print the exact figures of TREE: how probably it succeeds, why it fails, what it costs.

    TREE carries along the actions that it uses. With a DOMAIN and PROBLEM, or a compiled TASK, that is
    what it is run in: then its other actions count, too, for what can change.
    """
    from bbtc.belief.rerolled import rerolled
    from bbtc.belief.scenarios import sample
    from bbtc.belief.scenarios import scenarios as listing
    from bbtc.cli.time_report import told_times
    from bbtc.cli.wording import failing_lines, figures_report, rerolled_note
    from bbtc.pipeline import simulate_tree, with_worst_world
    from bbtc.planner.failing_runs import failing_runs
    from bbtc.printable import printable

    for place in (output, *([] if curve is None else [curve])):
        session.expect_output(place, [tree, *others])
    loaded = _tree(session, tree, others)
    limits = session.limits
    figures, chain = simulate_tree(loaded, limits)
    figures = with_worst_world(loaded, figures, limits)
    taken = told_times(loaded, figures, chain, limits, time_step)
    if curve is not None:
        session.write(curve, taken.picture())
    session.clear()
    listed, stop = _until_limit(itertools.islice(listing(chain, limits), scenarios))
    failed, stop_failing = _until_limit(failing_runs(loaded, chain, limits, failing))
    rest = figures.failure + figures.blocked - sum((each.run.probability for each in failed), Fraction(0))
    sampled = sample(chain, samples, seed, limits) if samples and not recovery else None
    disturbed = _Disturbed(loaded, limits, seed, bool(others))
    if perturb is not None:
        disturbed.add(lambda: disturbed.perturb(perturb, runs, max_ticks))
    if recovery:
        disturbed.add(lambda: disturbed.recover(samples))
    if as_json:
        from bbtc.artefacts.figures_json import failing_run_to_json, figures_to_json
        from bbtc.artefacts.jsontext import dumps
        from bbtc.artefacts.numbers import figure_text

        data = figures_to_json(loaded, figures, listed, sampled) | disturbed.data
        taken.add_to(data, listed)
        data["failing_runs"] = [failing_run_to_json(loaded, each) for each in failed]
        again = rerolled(loaded.task, chain)
        data |= {"rerolled": list(again)} if again else {}
        data["other_failing_runs"] = figure_text(rest)
        session.write(output, dumps(data))
    else:
        lines = [*figures_report(loaded, figures), *taken.lines()]
        lines += [f"readings  {note}" for note in rerolled_note(rerolled(loaded.task, chain))]
        if sampled is not None:
            share = sampled.successes / sampled.samples
            lines.append(f"sampled   {share:.6g} of {sampled.samples} runs succeed (seed {sampled.seed})")
        lines.extend(disturbed.lines)
        lines.extend(failing_lines(loaded, failed, rest))
        lines.extend(_scenario_lines(loaded, listed, taken))
        session.write(output, "".join(f"{printable(line)}\n" for line in lines))
    for reached in (stop, stop_failing, disturbed.stop):
        if reached is not None:
            raise reached


def _tree(session: Session, path: str, others: tuple[str, ...]) -> Tree:
    """The tree of a file, on the task of others if there are any."""
    from bbtc.artefacts import load_tree
    from bbtc.cli.inputs import load_task

    source = session.read(path)
    return load_tree(source, load_task(session, others, session.limits) if others else None)


@dataclass
class _Disturbed:
    """What was found of the tree in disturbed worlds, for both forms of output; ``stop`` is the limit that
    ended the rest of it."""

    tree: Tree
    limits: Limits
    seed: int
    whole: bool
    data: dict[str, object] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    stop: LimitReached | None = None

    def add(self, find: Callable[[], None]) -> None:
        """Find something, as far as the limits allow."""
        try:
            find()
        except LimitReached as reached:
            self.stop = self.stop or reached

    def perturb(self, rate: Fraction, runs: int, most_ticks: int) -> None:
        """What comes of perturbed runs."""
        from bbtc.artefacts.disturbance_json import perturbed_to_json
        from bbtc.cli.disturbance_report import perturbed_lines
        from bbtc.disturbance.perturbed import perturbed_runs

        task, root = self.tree.task, self.tree.root
        found = perturbed_runs(
            task, root, rate, self.limits, runs=runs, seed=self.seed, most_ticks=most_ticks
        )
        self.data["perturbed"] = perturbed_to_json(found)
        self.lines.extend(perturbed_lines(found))

    def recover(self, samples: int | None) -> None:
        """What the tree attains from any state."""
        from bbtc.artefacts.disturbance_json import recovery_to_json
        from bbtc.cli.disturbance_report import recovery_lines
        from bbtc.disturbance.recovery import recovery

        found = recovery(self.tree.task, self.tree.root, self.limits, samples=samples, seed=self.seed)
        self.data["recovery"] = recovery_to_json(self.tree, found)
        self.lines.extend(recovery_lines(self.tree, found, self.whole))


def _scenario_lines(tree: Tree, listed: list[Scenario], taken: ToldTimes) -> list[str]:
    from bbtc.artefacts.numbers import exact
    from bbtc.belief.tick import NodeStatus
    from bbtc.cli.wording import run_lines

    lines = []
    for number, run in enumerate(listed, 1):
        ending = "blocked" if run.status is NodeStatus.RUNNING else run.status.word
        lines.append(f"run {number}: probability {exact(run.probability)}, {ending}{taken.of(run)}")
        lines.extend(f"  {line}" for line in run_lines(tree, run))
    return lines


_T = TypeVar("_T")


def _until_limit(found: Iterator[_T]) -> tuple[list[_T], LimitReached | None]:
    """All that is found, or what was found before a limit, which is worth telling, and the limit."""
    listed: list[_T] = []
    try:
        for each in found:
            listed.append(each)  # noqa: PERF402
    except LimitReached as reached:
        return listed, reached
    return listed, None
