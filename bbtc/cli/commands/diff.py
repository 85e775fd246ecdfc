"""``bbtc diff``: what changed from one tree to another, in structure and in figures."""

from __future__ import annotations

import click

from bbtc.cli.session import Session, limit_options
from bbtc.cli.session import command as session_command


@click.command("diff")
@click.argument("old", metavar="OLD")
@click.argument("new", metavar="NEW")
@click.option(
    "--to",
    "form",
    type=click.Choice(["text", "markdown"]),
    default="text",
    show_default=True,
    help="Text for a terminal, or Markdown for a pull request.",
)
@click.option("--exit-code", is_flag=True, help="Exit with status 1 if anything differs.")
@click.option("-o", "--output", default="-", metavar="FILE", help="Where to write; default: stdout.")
@limit_options
@session_command
def command(session: Session, old: str, new: str, form: str, exit_code: bool, output: str) -> int:
    """Tell what changed from the tree OLD to the tree NEW: figures, task, and nodes."""
    from bbtc.cli.diff_report import markdown_report, text_report
    from bbtc.cli.inputs import tree_of
    from bbtc.pipeline import compare_trees

    session.expect_output(output, [old, new])
    first, second = (tree_of(session.read(path)) for path in (old, new))
    comparison = compare_trees(first, second, session.limits)
    session.clear()
    lines = markdown_report(comparison) if form == "markdown" else text_report(comparison)
    session.write(output, "".join(f"{line}\n" for line in lines))
    return int(exit_code and comparison.differs)
