"""The shared examples with their optima, and small tasks written by hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.syntax.reader import read_source
from tests.conftest import corpus_folder, shared_folder

BUDGETS = (1, 2, 3, 4, 6, 8, 12)


@dataclass(frozen=True)
class Optimum:
    """What is known of a problem: P*, and the best with a number of actions."""

    files: tuple[Path, ...]
    best: float
    within: tuple[tuple[int, float], ...]

    @property
    def name(self) -> str:
        """For test ids."""
        return "/".join(self.files[-1].parts[-2:])

    def task(self) -> Task:
        """The ground task. Raises ``BbtcError`` where it cannot be loaded."""
        return compile_sources([read_source(str(file)) for file in self.files], Report(), Limits(seconds=60))


def cases() -> list[Optimum]:
    """The small domains on which greedy expansion fails or is poor."""
    folder = shared_folder()
    if folder is None or not (folder / "cases").is_dir():
        return []
    found = []
    for line in (folder / "cases" / "optima.tsv").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        name, best, *within = line.split("\t")
        budgets = tuple((int(k[1:]), float(p)) for k, p in (item.split("=") for item in within))
        found.append(Optimum((folder / "cases" / f"{name}.pddl",), float(best), budgets))
    return found


def corpus_optima() -> list[Optimum]:
    """Public problems with their optima, computed by others' means."""
    folder = corpus_folder()
    if folder is None or not (folder / "optima.tsv").is_file():
        return []
    found = []
    for line in (folder / "optima.tsv").read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            continue
        domain, problem, best, _, within, *_ = line.split("\t")
        budgets = tuple(zip((2, 4, 8, 16), map(float, within.split(",")), strict=True))
        found.append(Optimum((folder / domain, folder / problem), float(best), budgets))
    return found


def public(folder: str, problem: str) -> Optimum:
    """A public problem by name, without its optimum; skips the test where the corpus is absent."""
    corpus = corpus_folder()
    if corpus is None:
        pytest.skip("no corpus: set BBTC_CORPUS, or put it at ../shared/corpus")
    return Optimum((corpus / folder / "domain.pddl", corpus / folder / f"{problem}.pddl"), -1, ())
