"""``bbtc export``: a tree in a format for people or for an execution engine."""

from __future__ import annotations

from fractions import Fraction

import click

from bbtc.cli.session import (
    Probability,
    Session,
    limit_options,
    output_options,
)
from bbtc.cli.session import (
    command as session_command,
)
from bbtc.cli.verify import require_verified
from bbtc.plan.strategies import DEFAULT


def _list_formats(ctx: click.Context, _parameter: click.Parameter, value: bool) -> None:
    if not value or ctx.resilient_parsing:
        return
    from bbtc.export.registry import format_names, load_exporter

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
    from bbtc.cli.inputs import is_artefact, is_tree, task_of, tree_of
    from bbtc.cli.plan import STATUS_EXIT, run_planner
    from bbtc.pipeline import export_tree

    require_place(form, output)
    limits = session.limits
    sources = [session.read(file) for file in files]
    status = 0
    if len(sources) == 1 and is_artefact(sources[0]) and is_tree(sources[0]):
        tree = tree_of(sources[0])
    else:
        plan = run_planner(session, task_of(session, sources, limits), target, strategy, limits, quiet=True)
        tree, status = plan.tree, STATUS_EXIT[plan.tree.status]
    if verified:
        require_verified(session, tree)
    pairs = dict(_pair(option) for option in options)
    artefact = export_tree(tree, form, pairs, limits)
    session.write(output, artefact, check=check, depfile=depfile)
    return status


def require_place(form: str, output: str) -> None:
    """Refuse, before any work, an unknown format, and to write several files to stdout."""
    from bbtc.export.registry import load_exporter

    if not load_exporter(form).suffix and output == "-":
        raise click.UsageError(f"The format '{form}' is several files: name a directory with -o.")


def _pair(option: str) -> tuple[str, str]:
    name, equals, value = option.partition("=")
    if not equals:
        raise click.UsageError(f"'{option}' is not of the form NAME=VALUE.")
    return name, value
