"""Every console snippet of the README and of docs/ is run, in order, and its output compared.

A snippet is a block marked ``console``: lines that start with ``$ `` are commands for a shell, the
lines after one are what it prints (stdout and stderr together); ``…`` alone on a line stands for any
lines. All snippets of a page run in one fresh folder that shows the repository's ``docs`` and
``domains``.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.forked import commands

REPOSITORY = Path(__file__).parents[2]
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGES = [
    page
    for page in (REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md")))
    if BLOCK.search(page.read_text())
]


def sessions(page: Path) -> list[tuple[str, str]]:
    """The commands of a page, each with what it should print."""
    found: list[tuple[str, str]] = []
    for block in BLOCK.findall(page.read_text()):
        command, expected = "", ""
        for line in block.splitlines():
            if line.startswith("$ "):
                if command:
                    found.append((command, expected))
                command, expected = line[2:], ""
            elif line.startswith("> ") and command and not expected:
                command += "\n" + line[2:]
            else:
                expected += line + "\n"
        if command:
            found.append((command, expected))
    return found


def pattern(expected: str) -> str:
    """A regular expression in which a line ``…`` matches any lines."""
    return "".join(
        r"(?:.*\n)*?" if line == "…" else re.escape(line) + r"\n" for line in expected.splitlines()
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_the_snippets_of_a_page_print_what_it_says(page: Path, tmp_path: Path) -> None:
    for shown in ("docs", "domains"):
        (tmp_path / shown).symlink_to(REPOSITORY / shown)
    shim = tmp_path / ".bin" / "bbtc"
    commands().install(shim)
    python = shim.parent / "python"
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    path = f"{shim.parent}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    for command, expected in sessions(page):
        if command.startswith("make "):
            continue  # the README's two commands: the test run itself, and the demo in the build
        done = subprocess.run(
            command,
            shell=True,
            cwd=tmp_path,
            env={**os.environ, "PATH": path, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=120,
            check=False,
        )
        printed = "".join(line.rstrip() + "\n" for line in done.stdout.splitlines())
        assert re.fullmatch(pattern(expected), printed), f"$ {command}\n{printed}"
