"""``bbtc simulate``: the exact figures of a tree."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

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
@click.option("--json", "as_json", is_flag=True, help="Write the figures as JSON instead of text.")
@click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; - is stdout (default).")
@limit_options
@session_command
def command(
    session: Session,
    tree: str,
    scenarios: int,
    samples: int | None,
    seed: int,
    as_json: bool,
    output: str,
) -> None:
    """Print the exact figures of TREE: how probably it succeeds, why it fails, what it costs."""
    from bbtc import artefacts
    from bbtc.belief.scenarios import sample
    from bbtc.belief.scenarios import scenarios as runs
    from bbtc.cli.inputs import tree_of
    from bbtc.cli.wording import figures_report
    from bbtc.pipeline import simulate_tree
    from bbtc.printable import printable

    session.expect_output(output, [tree])
    loaded = tree_of(session.read(tree))
    limits = session.limits
    figures, chain = simulate_tree(loaded, limits)
    session.clear()
    listed: list[Scenario] = []
    stop: LimitReached | None = None
    try:
        for run in itertools.islice(runs(chain, limits), scenarios):
            listed.append(run)  # noqa: PERF402 - what was found before a limit is worth telling
    except LimitReached as reached:
        stop = reached
    sampled = sample(chain, samples, seed, limits) if samples else None
    if as_json:
        session.write(output, artefacts.dumps(artefacts.figures_to_json(loaded, figures, listed, sampled)))
    else:
        lines = figures_report(loaded, figures)
        if sampled is not None:
            share = sampled.successes / sampled.samples
            lines.append(f"sampled   {share:.6g} of {sampled.samples} runs succeed (seed {sampled.seed})")
        lines.extend(_scenario_lines(loaded, listed))
        session.write(output, "".join(f"{printable(line)}\n" for line in lines))
    if stop is not None:
        raise stop


def _scenario_lines(tree: Tree, listed: list[Scenario]) -> list[str]:
    from bbtc.belief.tick import Status
    from bbtc.cli.wording import changes, exact

    lines = []
    for number, run in enumerate(listed, 1):
        ending = "blocked" if run.status is Status.RUNNING else run.status.word
        lines.append(f"run {number}: probability {exact(run.probability)}, {ending}")
        before = run.initial
        for step in run.steps:
            lines.append(f"  {step.node.action}: {changes(tree, before, step.values)}")
            before = step.values
    return lines
