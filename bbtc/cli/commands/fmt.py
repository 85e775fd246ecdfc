"""``bbtc fmt``: the canonical layout of files, in place."""

from __future__ import annotations

import click

from bbtc.cli.counting import counted
from bbtc.cli.session import Session, reading_limits
from bbtc.cli.session import command as session_command
from bbtc.diagnostics import BbtcError, LimitReached


@click.command("fmt")
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@click.option("--check", is_flag=True, help="Write nothing; show a diff and fail if a layout would change.")
@reading_limits
@session_command
def command(session: Session, files: tuple[str, ...], check: bool) -> None:
    """Give FILES their canonical layout, in place; `-` reads the standard input and writes to the
    standard output.

    Comments are kept. A file with syntax errors is left as it is, and so is one that has the layout
    already.
    """
    from bbtc.files.read_write import drift, write
    from bbtc.pipeline import format_source

    files = tuple(dict.fromkeys(files))
    changed = 0
    for file in files:
        try:
            source = session.read(file)
            text = format_source(source, session.limits)
            if file == "-" and check and text != source.text:
                raise drift(source.name, source.text.encode(), text.encode())
            changed += write(file, text, check=check)
        except LimitReached:
            raise
        except BbtcError as error:
            # The other files get their layout all the same.
            for diagnostic in error.diagnostics:
                session.report.add(diagnostic)
    session.report.raise_errors()
    if files != ("-",):
        session.say(f"{counted(len(files), 'file')}, {changed} changed")
