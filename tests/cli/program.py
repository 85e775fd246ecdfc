"""The program ``bbtc``, run in a folder: a process of its own, with its exit status and its streams."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.conftest import REPOSITORY


def bbtc(
    *arguments: str | Path, folder: Path = REPOSITORY, stdin: str | bytes = b"", powerless: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run it to its end; what it prints is UTF-8. ``powerless``: root, too, may not write everywhere."""
    words, given = [str(each) for each in arguments], stdin.encode() if isinstance(stdin, str) else stdin
    if hasattr(os, "fork"):
        from tests.cli.forked import commands

        done = commands().run(folder, *words, stdin=given, powerless=powerless)
        return subprocess.CompletedProcess(words, done.status, done.stdout.decode(), done.stderr.decode())
    run = subprocess.run(
        [sys.executable, "-m", "bbtc.cli.main", *words],
        cwd=folder, input=given, capture_output=True, check=False, timeout=300,
    )  # fmt: skip
    return subprocess.CompletedProcess(words, run.returncode, run.stdout.decode(), run.stderr.decode())
