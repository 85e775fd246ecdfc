"""What one worker of a test run works out, and the others need not."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

_folder: Path | None = None


def share_in(folder: Path) -> None:
    """Let the workers leave results to one another in a folder of this test run."""
    global _folder
    _folder = folder / "shared"


def shared(name: str, make: Callable[[], T]) -> T:
    """What ``make`` returns, or returned in another worker, under a name."""
    if _folder is None:
        return make()
    file = _folder / f"{name}.pickle"
    if file.exists():
        found: T = pickle.loads(file.read_bytes())
        return found
    made = make()
    _folder.mkdir(exist_ok=True)
    scratch = file.with_suffix(f".{os.getpid()}")
    scratch.write_bytes(pickle.dumps(made))
    scratch.replace(file)
    return made
