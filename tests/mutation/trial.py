"""Trying mutants: copies of the checkout, tests by package, and what became of each mutant."""

from __future__ import annotations

import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Literal, TypeAlias

from tests.mutation.mutants import Mutant, is_change, modules, mutants_of

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
    """A sample of the mutants, by a seed: as many of each package as of the next."""
    random = Random(seed)
    left: dict[str, list[Mutant]] = {}
    for package in project.packages:
        files = modules(project.root, package)
        left[package] = [mutant for file in files for mutant in mutants_of(project.root, file)]
    for every in left.values():
        random.shuffle(every)
    found: list[Mutant] = []
    while len(found) < count and any(left.values()):
        for every in left.values():
            while every and len(found) < count:
                mutant = every.pop()
                if is_change((project.root / mutant.file).read_text("utf-8"), mutant):
                    found.append(mutant)
                    break
    return found


def selection(project: Project, file: str) -> list[str]:
    """The tests to run for a module: those of its package, files that name the module before others."""
    package = next(name for name in project.packages if file.startswith(f"{name}/"))
    files: dict[str, None] = {}
    for place in project.packages[package]:
        path = project.root / place
        found = sorted(path.glob("test_*.py")) if path.is_dir() else [path]
        files.update((each.relative_to(project.root).as_posix(), None) for each in found)
    dotted = file.removesuffix(".py").replace("/", ".")
    parent, _, name = dotted.rpartition(".")
    wanted = (f"{dotted} ", f"{dotted}\n", f"from {parent} import {name}")

    def names_it(test: str) -> bool:
        text = (project.root / test).read_text("utf-8")
        return any(each in text for each in wanted)

    return sorted(files, key=lambda test: not names_it(test))  # stable: else as the project has them


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


def run_tests(copy: Path, tests: Sequence[str], seconds: float, jobs: int = 0) -> tuple[int | None, str]:
    """The exit status of pytest (None: it took too long), and the first test that failed. All that it started
    is ended with it."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-n", str(jobs), *tests]
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
    status: int | None
    try:
        output, _ = process.communicate(timeout=seconds)
        status = process.returncode
    except subprocess.TimeoutExpired:
        status, output = None, ""
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    failed = [line for line in output.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    return status, failed[0].split(" - ")[0].partition(" ")[2] if failed else output[-200:]


def tried(copies: Copies, mutant: Mutant, seconds: float) -> Tried:
    """What the tests say of a mutant. A status of pytest other than passed and failed (nothing collected,
    say) is an error of the trial, but for what fails while it is imported, which is noticed, too."""
    tests = selection(copies.project, mutant.file)
    begun = time.monotonic()
    with copies.one() as copy:
        path = copy / mutant.file
        source = path.read_text("utf-8")
        path.write_text(mutant.applied(source), "utf-8")
        try:
            status, by = run_tests(copy, tests, seconds)
        finally:
            path.write_text(source, "utf-8")
    fate: Fate = "timeout" if status is None else "survived" if status == 0 else "killed"
    if status == 5:
        raise RuntimeError(f"no tests were found for {mutant.file}")
    return Tried(mutant, fate, "" if fate == "survived" else by, time.monotonic() - begun)


def try_all(
    project: Project,
    mutants: Sequence[Mutant],
    jobs: int,
    seconds: float | None,
    tell: Callable[[Tried], None],
    *,
    trusted: bool = False,
) -> list[Tried]:
    """What became of each mutant, in their order. Raises ``RuntimeError`` if the tests fail without any: then
    they would kill every mutant and say nothing. ``seconds`` None: the tests of a mutant may take as long as
    all took without any, twice, and a minute. ``trusted``: the tests are known to pass."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies = Copies(project, Path(folder), jobs)
        begun = time.monotonic()
        if not trusted:
            _require_passing(project, copies, mutants, jobs)
        limit = seconds or 60 + 2 * jobs * (time.monotonic() - begun)

        def one(mutant: Mutant) -> Tried:
            done = tried(copies, mutant, limit)
            tell(done)
            return done

        with ThreadPoolExecutor(jobs) as pool:
            return list(pool.map(one, mutants))


def _require_passing(project: Project, copies: Copies, mutants: Sequence[Mutant], jobs: int) -> None:
    tests = list(dict.fromkeys(test for mutant in mutants for test in selection(project, mutant.file)))
    with copies.one() as copy:
        status, failed = run_tests(copy, tests, 3600, jobs if jobs > 1 else 0)
    if status != 0:
        raise RuntimeError(f"the tests fail without a mutant: {failed}")
