"""``bbtc init``: a small project to start from."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import click

from bbtc.cli.session import Session
from bbtc.cli.session import command as session_command
from bbtc.diagnostics import BbtcError, Diagnostic

NAMES = ("bbtc.yaml", "domain.pddl", "first-problem.pddl", ".gitignore")
"""The files of the project, as they stand in ``bbtc/build/template`` (where names have no leading dot)."""


@click.command("init")
@click.argument("folder", default=".", metavar="[FOLDER]")
@session_command
def command(session: Session, folder: str) -> None:
    """Make a small project in FOLDER (default: here): a domain, a problem, and the manifest that `bbtc
    build` reads. Nothing is overwritten: where one of the files is there already, nothing is made.
    """
    from bbtc.files import write_files

    root = Path(folder)
    taken = [name for name in NAMES if (root / name).exists()]
    if taken:
        raise BbtcError(
            Diagnostic("BBT1007", f"{root / name} is there already", hint="choose another folder")
            for name in taken
        )
    template = files("bbtc") / "build" / "template"
    write_files(folder, {name: (template / name.lstrip(".")).read_text("utf-8") for name in NAMES})
    for name in NAMES:
        session.say(f"made {root / name}")
    where = "" if folder == "." else f"cd {folder}; "
    session.say(f"now: {where}bbtc build")
