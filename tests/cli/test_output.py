"""Where commands write: devices and pipes are written to, never renamed over."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

DOMAIN = Path(__file__).parents[2] / "domains" / "household"
COMPILE = [
    *(sys.executable, "-m", "bbtc.cli.main", "compile"),
    *(str(DOMAIN / "domain.pddl"), str(DOMAIN / "look-for-soda.pddl"), "-o"),
]
pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes exist on Unix only")


def test_a_named_pipe_gets_the_artefact_and_stays_one(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
    reader.start()
    done = subprocess.run([*COMPILE, str(pipe)], capture_output=True, check=False, timeout=60)
    reader.join(60)
    assert done.returncode == 0, done.stderr
    assert got[0].startswith(b'{\n  "format": "bbtc-task"')
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert [file.name for file in tmp_path.iterdir()] == ["pipe"]


def test_a_device_stays_a_device_even_through_a_link(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(os.devnull)
    done = subprocess.run([*COMPILE, str(link)], capture_output=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert link.is_symlink()
    assert stat.S_ISCHR(Path(os.devnull).stat().st_mode)


def test_a_device_that_is_full_is_an_error(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full")
    done = subprocess.run([*COMPILE, "/dev/full"], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert "error[BBT0004]: cannot write /dev/full" in done.stderr
