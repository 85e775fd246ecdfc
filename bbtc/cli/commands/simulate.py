"""``bbtc simulate``: the exact figures of a tree."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, TypeVar

import click

from bbtc.cli.session import Count, Seed, Session, limit_options
from bbtc.cli.session import command as session_command
from bbtc.diagnostics import LimitReached

if TYPE_CHECKING:
    from bbtc.belief.scenarios import Scenario
    from bbtc.tree.nodes import Tree


@click.command("simulate")
@click.argument("tree", metavar="TREE")
@click.option("--scenarios", type=Count(0), default=0, metavar="N", help="List the N most probable runs.")
@click.option("--samples", type=Count(1), metavar="N", help="Also sample N runs (Monte Carlo).")
@click.option("--seed", type=Seed(), default=0, show_default=True, help="Seed of the sampling.")
@click.option(
    "--failing",
    type=Count(0),
    default=3,
    show_default=True,
    metavar="N",
    help="List the N most probable runs that fail, each with the fact it lacks at its root.",
)
@click.option("--json", "as_json", is_flag=True, help="Write the figures as JSON instead of text.")
@click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; - is stdout (default).")
@limit_options
@session_command
def command(
    session: Session,
    tree: str,
    scenarios: int,
    failing: int,
    samples: int | None,
    seed: int,
    as_json: bool,
    output: str,
) -> None:
    """Print the exact figures of TREE: how probably it succeeds, why it fails, what it costs."""
    from bbtc.belief.scenarios import sample
    from bbtc.belief.scenarios import scenarios as runs
    from bbtc.cli.inputs import tree_of
    from bbtc.cli.wording import failing_lines, figures_report
    from bbtc.pipeline import simulate_tree
    from bbtc.planner.failing_runs import failing_runs
    from bbtc.printable import printable

    session.expect_output(output, [tree])
    loaded = tree_of(session.read(tree))
    limits = session.limits
    figures, chain = simulate_tree(loaded, limits)
    session.clear()
    listed, stop = _until_limit(itertools.islice(runs(chain, limits), scenarios))
    failed, stop_failing = _until_limit(failing_runs(loaded, chain, limits, failing))
    rest = figures.failure + figures.blocked - sum((each.run.probability for each in failed), Fraction(0))
    sampled = sample(chain, samples, seed, limits) if samples else None
    if as_json:
        from bbtc.artefacts.figures_json import failing_run_to_json, figures_to_json
        from bbtc.artefacts.jsontext import dumps
        from bbtc.artefacts.numbers import figure_text

        data = figures_to_json(loaded, figures, listed, sampled)
        data["failing_runs"] = [failing_run_to_json(loaded, each) for each in failed]
        data["other_failing_runs"] = figure_text(rest)
        session.write(output, dumps(data))
    else:
        lines = figures_report(loaded, figures)
        if sampled is not None:
            share = sampled.successes / sampled.samples
            lines.append(f"sampled   {share:.6g} of {sampled.samples} runs succeed (seed {sampled.seed})")
        lines.extend(failing_lines(loaded, failed, rest))
        lines.extend(_scenario_lines(loaded, listed))
        session.write(output, "".join(f"{printable(line)}\n" for line in lines))
    for reached in (stop, stop_failing):
        if reached is not None:
            raise reached


def _scenario_lines(tree: Tree, listed: list[Scenario]) -> list[str]:
    from bbtc.artefacts.numbers import exact
    from bbtc.belief.tick import NodeStatus
    from bbtc.cli.wording import run_lines

    lines = []
    for number, run in enumerate(listed, 1):
        ending = "blocked" if run.status is NodeStatus.RUNNING else run.status.word
        lines.append(f"run {number}: probability {exact(run.probability)}, {ending}")
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
