"""Where the manifest of a project is, and its bytes."""

from __future__ import annotations

import re
from pathlib import Path

from bbtc.diagnostics import BbtcError
from bbtc.files.read_write import read_file, reason

YAML_NAME = "bbtc.yaml"
TOML_NAME = "pyproject.toml"
MAX_BYTES = 1 << 20
"""Largest manifest that is read."""

_TABLE = re.compile(rb"^[ \t]*\[[ \t]*tool[ \t]*\.[ \t]*bbtc\b", re.MULTILINE)


def find_manifest(start: Path) -> Path:
    """The manifest of the project that a folder belongs to: in the folder itself, or in the nearest
    one around it that has one. Raises :class:`BbtcError` where there is none, or two."""
    start = start.absolute()
    for folder in [start, *start.parents]:
        found = [file for file in (folder / YAML_NAME, folder / TOML_NAME) if is_manifest(file)]
        if len(found) > 1:
            raise BbtcError.single(
                "BBT1002",
                f"both {YAML_NAME} and {TOML_NAME} of {folder} are manifests",
                hint=f"leave [tool.bbtc] out of {TOML_NAME}",
            )
        if found:
            return found[0]
    raise BbtcError.single(
        "BBT1002",
        f"no manifest: neither {YAML_NAME} nor [tool.bbtc] in {TOML_NAME}, here or in a folder around",
        hint="`bbtc init` makes a small project",
    )


def is_manifest(file: Path) -> bool:
    """Is this file, which has a name of one, a manifest?"""
    if not file.is_file():
        return False
    if file.name != TOML_NAME:
        return True
    try:
        return _TABLE.search(read_file(file, MAX_BYTES)) is not None
    except OSError:
        return False


def manifest_bytes(file: Path) -> bytes:
    """The content of a manifest. Raises :class:`BbtcError` if it cannot be read or is too large."""
    try:
        data = read_file(file, MAX_BYTES + 1)
    except OSError as error:
        raise BbtcError.single("BBT0001", f"cannot read {file}: {reason(error)}") from error
    if len(data) > MAX_BYTES:
        raise BbtcError.single("BBT0005", f"{file} is larger than {MAX_BYTES >> 20} MiB")
    return data


def source_name(folder: Path, path: str) -> str:
    """The name that messages give a file of a project: relative to where the command runs, if it is
    below that."""
    whole = folder / path
    try:
        return str(whole.relative_to(Path.cwd()))
    except ValueError:
        return str(whole)
