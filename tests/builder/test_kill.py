"""Killing ``bbtc build`` at random moments never leaves a broken artefact, and the next run completes.

The short form kills a few times; ``BBTC_LONG=1`` kills a hundred times.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bbtc.builder.runner import build
from tests.builder.projects import REPOSITORY, bbtc, several
from tests.long_form import LONG, amount

TREES = 10
KILLS = amount(5, 100)


def artefacts(folder: Path) -> dict[str, bytes]:
    """What stands outside the build's own folder, and is not a source."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".bbtc" not in path.parts and path.suffix not in {".pddl", ".yaml"}
    }


def write_sources(folder: Path, chance: str) -> None:
    """Give every domain a probability."""
    for domain in sorted(folder.glob("d*.pddl")):
        before, _, rest = domain.read_text().partition("(probabilistic ")
        domain.write_text(f"{before}(probabilistic {chance} {rest.split(' ', 1)[1]}")


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_killed_build_leaves_whole_files_only(tmp_path: Path, jobs: str) -> None:
    chances = ("1/2", "3/5")
    expected = []
    for number, chance in enumerate(chances):
        folder = several(tmp_path / f"clean{number}", TREES, "[btcpp, dot]", per_domain=1)
        write_sources(folder, chance)
        assert build(folder / "bbtc.yaml", jobs=1).ok
        expected.append(artefacts(folder))
    assert expected[0].keys() == expected[1].keys()
    assert len(expected[0]) == 3 * TREES

    folder = several(tmp_path / "killed", TREES, "[btcpp, dot]", per_domain=1)
    start = time.monotonic()
    assert bbtc(folder, "build", "-j", jobs).returncode == 0
    whole = time.monotonic() - start
    rng = random.Random(f"kill {jobs}")
    next_jobs = jobs if LONG else "1"
    hits = 0
    for number in range(1, (KILLS + 1) // 2 + 1):
        write_sources(folder, chances[number % 2])
        process = subprocess.Popen(
            [sys.executable, "-m", "bbtc.cli.main", "build", "-j", jobs],
            cwd=folder,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        )
        time.sleep(rng.uniform(0, 1.1 * whole))
        if rng.random() < 0.5:
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()  # its workers end by themselves
        hits += process.wait() != 0
        for name, content in artefacts(folder).items():
            assert content in (expected[0][name], expected[1][name]), f"{name} is broken"
        if rng.random() < 0.5:  # else the next one starts from what this one left
            assert bbtc(folder, "build", "-j", next_jobs).returncode == 0
            assert artefacts(folder) == expected[number % 2]
            assert list((folder / ".bbtc/scratch").iterdir()) == []
    assert bbtc(folder, "build", "-j", next_jobs).returncode == 0
    assert artefacts(folder) == expected[number % 2]
    assert hits, "no build was killed while it ran"
