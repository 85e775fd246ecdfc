"""``bbtc init``: a small project to start from."""

from __future__ import annotations

import click

from bbtc.cli.session import Session
from bbtc.cli.session import command as session_command


@click.command("init")
@click.argument("folder", default=".", metavar="[FOLDER]")
@session_command
def command(session: Session, folder: str) -> None:
    """Make a small project in FOLDER (default: here): a domain, a problem, and the manifest that `bbtc
    build` reads. Nothing is overwritten: where one of the files is there already, nothing is made.
    """
    from bbtc.builder.starter import make_project

    for path in make_project(folder):
        session.say(f"made {path}")
    where = "" if folder == "." else f"cd {folder}; "
    session.say(f"now: {where}bbtc build")
