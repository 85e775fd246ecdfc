"""``bbtc verify``: recompute a tree's figures by other means, and refuse it if they differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from bbtc.cli.session import Session, limit_options
from bbtc.cli.session import command as session_command

if TYPE_CHECKING:
    from bbtc.tree.nodes import Tree
    from bbtc.verifier.solve import Recomputed
    from bbtc.verifier.verdict import Engine, Verdict


@click.command("verify")
@click.argument("tree", metavar="TREE")
@click.option(
    "--engine",
    type=click.Choice(["auto", "own", "storm", "all"]),
    default="auto",
    show_default=True,
    help="Who recomputes: our own solver, Storm, or both; auto: own, and Storm if it is installed.",
)
@click.option("--json", "as_json", is_flag=True, help="Write what was found as JSON instead of text.")
@click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; - is stdout (default).")
@limit_options
@session_command
def command(session: Session, tree: str, engine: Engine, as_json: bool, output: str) -> None:
    """Recompute the figures of TREE without the simulator and the planner, and compare them.

    The tree and its task become a Markov chain in the PRISM language, which is solved anew. Exit status
    1: a figure is not what the tree claims, or the tree is not sound.
    """
    from bbtc.cli.inputs import tree_of
    from bbtc.pipeline import verify_tree

    session.expect_output(output, [tree])
    verdict = verify_tree(tree_of(session.read(tree)), session.limits, engine)
    if as_json:
        from bbtc.artefacts.jsontext import dumps
        from bbtc.artefacts.verdict_json import verdict_to_json

        session.write(output, dumps(verdict_to_json(verdict)))
    else:
        session.write(output, "".join(f"{line}\n" for line in verdict_report(verdict)))
    verdict.raise_problems()


def require_verified(session: Session, tree: Tree) -> None:
    """Raise :class:`~bbtc.diagnostics.BbtcError` unless the tree is what it claims to be. This may take
    as long as the time limit allows, counted anew: planning may have used all of it."""
    from bbtc.pipeline import verify_tree

    verdict = verify_tree(tree, session.watch.over(session.limits.afresh()))
    session.watch.off()
    verdict.raise_problems()
    engines = ["our own solver"] if verdict.own is not None else []
    engines += [f"Storm {verdict.storm.version}"] if verdict.storm is not None else []
    session.say(f"verified by {' and '.join(engines)}")


def verdict_report(verdict: Verdict) -> list[str]:
    """What was claimed and found, as lines of text."""
    from bbtc.artefacts.numbers import exact
    from bbtc.cli.counting import counted
    from bbtc.cli.wording import expected

    tree, own, found = verdict.tree, verdict.own, verdict.storm
    lines = [f"claimed   {exact(tree.success_probability)}"]
    if own is not None:
        lines.append(f"own       {exact(own.success)}, {counted(own.states, 'state')}")
    if verdict.hidden and own is not None:
        lines.append(f"worlds    {_worlds(verdict.worlds)}")
    if found is not None:
        low = found.success.lower
        how = "exactly" if found.exact else "within 1e-11"
        value = "none" if low is None else exact(low) if found.exact else f"{float(low):.9g}"
        lines.append(f"Storm     {value}, {how}, {counted(found.states, 'state')}, version {found.version}")
    if own is not None:
        lines += [f"success   {exact(own.success)}", f"failure   {exact(own.failure)}"]
        lines += [f"blocked   {exact(own.blocked)}"] if own.blocked else []
        lines += [f"endless   {exact(own.endless)}"] if own.endless else []
        lines.append(f"cost      {expected(own.cost, own.cost_given_success)}")
        lines.append(f"actions   {expected(own.actions, own.actions_given_success)}")
        if tree.task.counts_reward:
            lines.append(f"reward    {expected(own.reward, None)}")
        lines += _time(verdict)
    lines.append("refused" if verdict.problems else "verified")
    return lines


def _time(verdict: Verdict) -> list[str]:
    """How long the tree takes, as far as that is known."""
    from bbtc.cli.wording import expected
    from bbtc.rounding import decimal

    time, by = verdict.time, verdict.tree.success_by
    if time is None:
        return [] if by is None else ["time      not recomputed"]
    lines = [f"time      {expected(time.expected, time.given_success)}, in seconds"]
    if by is not None and time.by is not None:
        bounds = f"from {time.by[0]:.9g} to {time.by[1]:.9g}"
        lines.append(f"in time   {bounds}, within {decimal(by.seconds, 12)} s")
    elif by is not None:
        lines.append("in time   not recomputed, since facts are hidden")
    return lines


def _worlds(found: Recomputed | None) -> str:
    """What the runs in each world came to."""
    from bbtc.artefacts.numbers import exact
    from bbtc.cli.counting import counted

    if found is None:
        return "too many to be looked at one by one"
    mistaken = f", {exact(found.without_goal)} mistaken" if found.without_goal else ""
    return f"{exact(found.success - found.without_goal)}{mistaken}, {counted(found.states, 'state')}"
