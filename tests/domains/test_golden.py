"""Golden files of every artefact of every problem; the same bytes under every hash seed."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys

import pytest

from tests.conftest import GOLDEN, Golden
from tests.domains.problems import PROBLEMS, REPOSITORY, Problem, artefacts, bbtc


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_artefacts_are_as_they_were(problem: Problem, golden: Golden) -> None:
    for name, data in artefacts(problem).items():
        golden(f"{problem}/{name}", data)


def test_every_golden_file_is_one_of_a_problem() -> None:
    """A renamed problem leaves no stale files behind."""
    domains = {problem.domain for problem in PROBLEMS}
    kept = {str(problem) for problem in PROBLEMS}
    found = {
        f"{folder.parent.name}/{folder.name}"
        for folder in GOLDEN.glob("*/*")
        if folder.parent.name in domains
    }
    assert found <= kept


@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_artefacts_can_be_read_back(problem: Problem) -> None:
    """A plan made from the saved task is the plan made from the sources."""
    folder = GOLDEN / str(problem)
    planned = bbtc("plan", "-", "-q", *problem.switches, stdin=(folder / "task.json").read_bytes())
    assert planned.status == 0, planned.err
    assert planned.out == (folder / "tree.json").read_bytes()


def digests() -> str:
    """The SHA-256 of every artefact, as JSON."""
    found = {
        f"{problem}/{name}": hashlib.sha256(data).hexdigest()
        for problem in PROBLEMS
        for name, data in artefacts(problem).items()
    }
    return json.dumps(found, indent=0)


@pytest.mark.parametrize("seed", ["1", "4242"])
def test_artefacts_are_the_same_under_every_hash_seed(seed: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from tests.domains.test_golden import digests; print(digests())"],
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    for path, digest in json.loads(done.stdout).items():
        assert digest == hashlib.sha256((GOLDEN / path).read_bytes()).hexdigest(), path
