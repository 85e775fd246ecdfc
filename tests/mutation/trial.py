"""Trying mutants: copies of the checkout, the tests that reach a mutant, and what became of each."""

from __future__ import annotations

import hashlib
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Literal, TypeAlias

import pytest

from tests.mutation.mutants import Mutant, is_change, modules, mutants_of
from tests.mutation.reach import IMPORTED, Reach, function_around, lines_of, reach_of

Fate: TypeAlias = Literal["killed", "timeout", "survived"]


@dataclass(frozen=True, slots=True)
class Project:
    """A checkout: for each package to mutate, the tests (files or folders) that are to notice, the quick and
    relevant ones first. ``copied`` are the files of a copy of it."""

    root: Path
    packages: Mapping[str, tuple[str, ...]]
    copied: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Tried:
    """What became of a mutant, and what noticed it: the first failing test, if one was named."""

    mutant: Mutant
    fate: Fate
    by: str
    seconds: float


def drawn(project: Project, count: int, seed: int) -> list[Mutant]:
    """A sample of the mutants, by a seed: as many of each package as of the next. What it takes of code that
    stays does not hang on code that changes."""

    def chance(mutant: Mutant) -> bytes:
        _, *known = mutant.key
        return hashlib.sha256("\n".join((str(seed), *known)).encode()).digest()

    left: dict[str, list[Mutant]] = {}
    for package in project.packages:
        files = modules(project.root, package)
        left[package] = [mutant for file in files for mutant in mutants_of(project.root, file)]
    for every in left.values():
        every.sort(key=chance, reverse=True)
    found: list[Mutant] = []
    while len(found) < count and any(left.values()):
        for every in left.values():
            while every and len(found) < count:
                mutant = every.pop()
                if is_change((project.root / mutant.file).read_text("utf-8"), mutant):
                    found.append(mutant)
                    break
    return found


def test_files(project: Project, package: str) -> list[str]:
    """The files of tests that are to notice what is wrong with a package."""
    files: dict[str, None] = {}
    for place in project.packages[package]:
        path = project.root / place
        found = sorted(path.rglob("test_*.py")) if path.is_dir() else [path]
        files.update((each.relative_to(project.root).as_posix(), None) for each in found)
    return list(files)


def selection(project: Project, reach: Reach, mutant: Mutant, most: float = inf) -> list[str]:
    """The tests to run for a mutant, quick ones first, as many as take at most so many seconds together:
    those that run the changed lines; where no test does (a line may have no instruction of its own), those
    that run the function; for what runs while modules are imported, those that run anything of the module."""
    source = (project.root / mutant.file).read_text("utf-8")
    lines = lines_of(source, mutant.start, mutant.end)
    function = function_around(source, mutant.line)
    tests = reach.running(mutant.file, lines) or reach.running(mutant.file, function)
    if IMPORTED in tests or not function:
        tests = reach.running(mutant.file, range(source.count("\n") + 2))
    return reach.quick_first(tests - {IMPORTED}, most)


class Copies:
    """Copies of a checkout, one for each worker; the checkout itself is never touched."""

    def __init__(self, project: Project, folder: Path, number: int) -> None:
        self.project = project
        self.all: list[Path] = []
        self._free: queue.Queue[Path] = queue.Queue()
        for place in range(number):
            copy = folder / str(place) / project.root.name
            for name in project.copied:
                target = copy / name
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(project.root / name, target)
            self.all.append(copy)
            self._free.put(copy)

    @contextmanager
    def one(self) -> Iterator[Path]:
        """A copy that nobody else uses meanwhile."""
        copy = self._free.get()
        try:
            yield copy
        finally:
            self._free.put(copy)


def run_tests(copy: Path, arguments: Sequence[str], seconds: float) -> tuple[int | None, str]:
    """The exit status of pytest (None: it took too long), and what it printed. All that it started is ended
    with it."""
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments]
    # Modules that change within a second would be taken from what was compiled before.
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("BBTC_LONG", None)
    process = subprocess.Popen(
        command,
        cwd=copy,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        output, _ = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        return None, ""
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return process.returncode, output


def first_failure(output: str) -> str:
    """The first test that failed, as pytest names it; if none is named, the end of what it printed."""
    failed = [line for line in output.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    return failed[0].split(" - ")[0].partition(" ")[2] if failed else output[-200:]


def measured(project: Project, copies: Copies, packages: Iterable[str], jobs: int) -> Reach:
    """Run the tests of packages without a mutant, and note which lines each of them runs. Raises
    ``RuntimeError`` if one fails: then they would kill every mutant and say nothing."""
    files = list(dict.fromkeys(file for package in packages for file in test_files(project, package)))
    with copies.one() as copy:
        data = copy / ".coverage"
        covered = [f"--cov={name}" for name in project.packages]
        status, output = run_tests(
            copy,
            ["-q", "-vv", "-n", str(jobs if jobs > 1 else 0), *covered, "--cov-context=test", "--cov-report=",
             "--durations=0", *files],
            7200,
        )  # fmt: skip
        if status != 0:
            raise RuntimeError(f"the tests fail without a mutant: {first_failure(output)}")
        reach = reach_of(copy, data, output)
        data.unlink()
    return reach


def tried(copies: Copies, reach: Reach, mutant: Mutant, seconds: float, most: float = inf) -> Tried:
    """What the tests say of a mutant; ``most`` as in :func:`selection`. No test that reaches it: it survives.
    A status of pytest that tells of no tests is an error of the trial; what fails while it is imported is
    noticed, too."""
    tests = selection(copies.project, reach, mutant, most)
    begun = time.monotonic()
    if not tests:
        return Tried(mutant, "survived", "", 0.0)
    with copies.one() as copy, tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".txt") as listed:
        path = copy / mutant.file
        source = path.read_text("utf-8")
        path.write_text(mutant.applied(source), "utf-8")
        listed.write("\n".join(tests))
        listed.flush()
        try:
            status, output = run_tests(copy, ["-x", "-q", "-n", "0", f"@{listed.name}"], seconds)
        finally:
            path.write_text(source, "utf-8")
    if status == pytest.ExitCode.NO_TESTS_COLLECTED:
        raise RuntimeError(f"no tests were found for {mutant.file}")
    fate: Fate = "timeout" if status is None else "survived" if status == 0 else "killed"
    return Tried(mutant, fate, "" if fate == "survived" else first_failure(output), time.monotonic() - begun)


def try_all(
    project: Project,
    mutants: Sequence[Mutant],
    jobs: int,
    seconds: float,
    tell: Callable[[Tried], None],
    most: float = inf,
) -> list[Tried]:
    """What became of each mutant, in their order. Raises ``RuntimeError`` if the tests fail without any.
    ``seconds``: for the tests of one mutant; ``most`` as in :func:`selection`."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies = Copies(project, Path(folder), jobs)
        packages = [name for name in project.packages if any(m.file.startswith(f"{name}/") for m in mutants)]
        reach = measured(project, copies, packages, jobs)

        def one(mutant: Mutant) -> Tried:
            done = tried(copies, reach, mutant, seconds, most)
            tell(done)
            return done

        with ThreadPoolExecutor(jobs) as pool:
            return list(pool.map(one, mutants))
