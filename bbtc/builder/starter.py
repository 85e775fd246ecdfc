"""A small project to start from."""

from __future__ import annotations

import os
from importlib.resources import files
from pathlib import Path

from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.files.read_write import write_files

NAMES = ("bbtc.yaml", "domain.pddl", "first-problem.pddl", ".gitignore")
"""The files of the project, as they stand in ``template`` (where names have no leading dot)."""


def make_project(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Make a domain, a problem and a manifest in a folder; the files made. Raises :class:`BbtcError` and
    makes nothing where one of them is there already (BBT1007) or cannot be written."""
    root = Path(folder)
    paths = tuple(root / name for name in NAMES)
    taken = [path for path in paths if os.path.lexists(path)]  # a link that leads nowhere, too
    if taken:
        raise BbtcError(
            Diagnostic("BBT1007", f"{path} is there already", hint="choose another folder") for path in taken
        )
    template = files("bbtc.builder") / "template"
    write_files(str(root), {name: (template / name.lstrip(".")).read_text("utf-8") for name in NAMES})
    return paths
