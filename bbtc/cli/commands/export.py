"""``bbtc export``: a tree in a format for people or for an execution engine."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from fractions import Fraction

import click

from bbtc.cli.output import on_terminal
from bbtc.cli.session import (
    Probability,
    Session,
    limit_options,
    output_options,
    problem_options,
)
from bbtc.cli.session import (
    command as session_command,
)
from bbtc.exit_status import OF_TREE
from bbtc.planner.strategies import DEFAULT
from bbtc.printable import printable


def _list_formats(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if not value or ctx.resilient_parsing:
        return
    from bbtc.backends.registry import format_names, load_exporter

    for name in format_names():
        exporter = load_exporter(name)
        click.echo(f"{name:10} {exporter.description}")
        for option in exporter.options:
            choices = f" ({'|'.join(option.choices)})" if option.choices else ""
            default = str(option.default).lower() if isinstance(option.default, bool) else option.default
            click.echo(f"    -O {option.name}={default}  {option.help}{choices}")
    ctx.exit()


@click.command("export")
@click.argument("files", nargs=-1, required=True, metavar="TREE | DOMAIN [PROBLEM]")
@click.option("--to", "form", metavar="FORMAT", required=True, help="The format; see --list.")
@click.option(
    "--list",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_list_formats,
    help="List the formats and their options.",
)
@click.option(
    "-O", "--option", "options", multiple=True, metavar="NAME=VALUE", help="An option of the format."
)
@click.option("--target", type=Probability(), help="With DOMAIN: wanted success probability.")
@click.option("--strategy", default=DEFAULT, show_default=True, help="With DOMAIN: how to plan.")
@click.option("--verify", "verified", is_flag=True, help="Write only if `bbtc verify` takes the tree.")
@problem_options
@limit_options
@output_options
@session_command
def command(
    session: Session,
    files: tuple[str, ...],
    form: str,
    options: tuple[str, ...],
    target: Fraction | None,
    strategy: str,
    verified: bool,
    output: str,
    check: bool,
    depfile: str | None,
) -> int:
    """Write TREE in FORMAT. With a DOMAIN and PROBLEM in its place, plan on the way."""
    from bbtc.backends.registry import files_read, load_exporter
    from bbtc.cli.commands.plan import best_tree_on_signals, run_planner
    from bbtc.cli.inputs import is_artefact, is_tree, task_of, tree_of
    from bbtc.pipeline import export_tree
    from bbtc.planner.options import DEFAULTS
    from bbtc.planner.strategies import require_strategy

    pairs = dict(_pair(option) for option in options)
    require_place(session, form, pairs, output, files, check=check, depfile=depfile)
    require_strategy(strategy, DEFAULTS)
    session.inputs += files_read(load_exporter(form), pairs)
    sources = [session.read(file) for file in files]
    if len(sources) == 1 and is_artefact(sources[0]) and is_tree(sources[0]):
        tree = tree_of(sources[0])
        if verified:
            from bbtc.cli.commands.verify import require_verified

            require_verified(session, tree)
        artefact = export_tree(tree, form, pairs, session.limits)
        session.write(output, artefact, check=check, depfile=depfile)
        return 0
    limits = session.watch_planning()
    task = task_of(session, sources, limits)
    with best_tree_on_signals() as signals:
        tree = run_planner(session, task, target, strategy, limits, quiet=True, signals=signals).tree
        if verified:
            from bbtc.cli.commands.verify import require_verified

            signals.end_at_once()
            require_verified(session, tree)
            signals.hold()
        # Planning may have used all of the time: what was found gets some of its own.
        artefact = export_tree(tree, form, pairs, limits.afresh())
        session.write(output, artefact, check=check, depfile=depfile)
    return OF_TREE[tree.status]


def require_place(
    session: Session,
    form: str,
    options: Mapping[str, str],
    output: str,
    inputs: Sequence[str],
    *,
    check: bool,
    depfile: str | None,
) -> None:
    """Refuse, before any work, an unknown format or option, a place that cannot be written to or is
    that of an input, several files on stdout, and pixels on a terminal."""
    from bbtc.backends.registry import files_read, load_exporter, parse_options

    exporter = load_exporter(form)
    parse_options(exporter, options)
    inputs = [*inputs, *files_read(exporter, options)]
    if output == "-" and not exporter.suffix:
        raise click.UsageError(f"The format '{form}' is several files: name a directory with -o.")
    if output == "-" and form == "png" and on_terminal(sys.stdout):
        raise click.UsageError("The format 'png' is no text: name a file with -o.")
    session.expect_output(output, inputs, folder=not exporter.suffix, check=check, depfile=depfile)


def _pair(option: str) -> tuple[str, str]:
    name, equals, value = option.partition("=")
    if not equals:
        raise click.UsageError(f"'{printable(option)}' is not of the form NAME=VALUE.")
    return name, value
