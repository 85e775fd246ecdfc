"""Fast Downward's translator, to compare with: from the package ``up-fast-downward``, if it is installed.

It is GPL software: it runs in processes of its own, and nothing of it stands here.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

_WORKER = Path(__file__).with_name("downward_worker.py")
_INSIDE = "downward/builds/release/bin"


def translator() -> Path | None:
    """The folder that holds the translator's package; None where it is not installed."""
    spec = find_spec("up_fast_downward")
    if spec is None or spec.origin is None:
        return None
    folder = Path(spec.origin).parent / _INSIDE
    return folder if (folder / "fast_downward" / "translate").is_dir() else None


@dataclass(frozen=True)
class Explored:
    """What ``instantiate.explore`` found, with the wall-clock and processor seconds, and the process's peak
    memory."""

    reachable: bool
    actions: int
    names: tuple[str, ...]
    seconds: float
    processor: float
    kilobytes: int


def explore(domain: Path, problem: Path, *, names: bool = False, timeout: float = 600) -> Explored:
    """Ground a pair of files. Raises :class:`subprocess.SubprocessError` if it cannot."""
    answer = json.loads(_run("names" if names else "explore", [domain, problem], timeout))
    return Explored(**{**answer, "names": tuple(answer["names"])})


def parse_seconds(pairs: Sequence[tuple[Path, Path]], timeout: float = 600) -> list[float | None]:
    """The seconds that parsing each pair takes; None for one that is refused."""
    files = [file for pair in pairs for file in pair]
    seconds: list[float | None] = json.loads(_run("parse", files, timeout))["seconds"]
    return seconds


def _run(what: str, files: Sequence[Path], timeout: float) -> str:
    folder = translator()
    assert folder is not None
    command = [sys.executable, str(_WORKER), str(folder), what, *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=timeout)
    return done.stdout.strip().splitlines()[-1]
