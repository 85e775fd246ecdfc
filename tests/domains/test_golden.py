"""Golden files of every artefact of every problem; the same bytes under every hash seed."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys

import pytest

from tests.conftest import GOLDEN, Golden
from tests.domains.problems import PROBLEMS, REPOSITORY, Problem, artefacts
from tests.long_form import LONG


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


def digests(share: str) -> str:
    """The SHA-256 of every artefact of a share of the problems, as JSON."""
    found = {
        f"{problem}/{name}": hashlib.sha256(data).hexdigest()
        for problem in _share(share)
        for name, data in artefacts(problem, saved=True).items()
    }
    return json.dumps(found, indent=0)


def _share(share: str) -> list[Problem]:
    quick = {problem.domain: problem for problem in PROBLEMS if str(problem) not in LARGE}
    return PROBLEMS if LONG else [*quick.values()][SEEDS.index(share) :: len(SEEDS)]


SEEDS = ["1", "4242"]
LARGE = {"hospital/one-box", "hospital/two-boxes", "service-robot/two-goals"}
"""Which take longer than all others: in the short form they are planned once, above, with whatever seed this
process has."""


@pytest.mark.parametrize("seed", SEEDS)
def test_artefacts_are_the_same_under_every_hash_seed(seed: str) -> None:
    """And a plan made from the saved task is the plan made from the sources."""
    run = f"from tests.domains.test_golden import digests; print(digests({seed!r}))"
    done = subprocess.run(
        [sys.executable, "-c", run],
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert {path.rpartition("/")[0] for path in found} == set(map(str, _share(seed)))
    for path, digest in found.items():
        assert digest == hashlib.sha256((GOLDEN / path).read_bytes()).hexdigest(), path
