"""Real build tools: how the tests find and run them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.forked import commands

REPOSITORY = Path(__file__).parents[2]


def recipe(name: str) -> str:
    """The block after a mark in the page on build systems."""
    page = (REPOSITORY / "docs" / "build-systems.md").read_text("utf-8")
    found = re.search(rf"^<!-- {re.escape(name)} -->\n\n```\w+\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


def tool(name: str) -> str:
    """The path of a program: of this environment, else of the PATH; skips the test where there is none."""
    beside = Path(sys.executable).with_name(name)
    if beside.exists() and name == "cmake":
        import cmake

        beside = Path(cmake.CMAKE_BIN_DIR, name)  # what the script beside us runs, once it has loaded itself
    found = str(beside) if beside.exists() else shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def program(folder: Path) -> Path:
    """A program ``bbtc`` in a folder, which runs this repository's and notes each run in ``runs.txt``."""
    script = folder / "bin" / "bbtc"
    commands().install(script, f'echo "$1" >> "{folder}/runs.txt"')
    return script


def runs(folder: Path) -> list[str]:
    """The commands that were run since last asked."""
    notes = folder / "runs.txt"
    found = notes.read_text().split() if notes.exists() else []
    notes.unlink(missing_ok=True)
    return found


def run(*command: str | Path, cwd: Path, path: Path | None = None, status: int = 0) -> str:
    """What a command prints; it must end with the status."""
    env = {**os.environ, "NO_COLOR": "1"}
    if path is not None:
        env["PATH"] = f"{path}{os.pathsep}{env['PATH']}"
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == status, f"{' '.join(map(str, command))}\n{done.stdout}"
    return done.stdout


def edit(file: Path, before: str, after: str) -> None:
    """Replace a text in a file."""
    text = file.read_text()
    assert before in text
    time.sleep(0.05)  # times of files are not exact everywhere
    file.write_text(text.replace(before, after))
