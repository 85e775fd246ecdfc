"""Examples with their optima: small domains of our own, and problems of the corpus."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from tests.conftest import corpus_folder

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
        return _task(self.files)


@cache
def _task(files: tuple[Path, ...]) -> Task:
    return compile_sources([read_source(str(file)) for file in files], Report(), Limits(seconds=60))


def cases() -> list[Optimum]:
    """The small domains on which greedy expansion fails or is poor."""
    folder = Path(__file__).parent / "cases"
    found = []
    for name, best, *within in _rows(folder / "optima.tsv"):
        budgets = tuple((int(k[1:]), float(p)) for k, p in (item.split("=") for item in within))
        found.append(Optimum((folder / f"{name}.pddl",), float(best), budgets))
    return found


def published() -> list[tuple[str, str, float, list[float]]]:
    """What others computed for public problems: domain and problem, as the corpus names them, P*, and the
    best with 2, 4, 8 and 16 actions."""
    return [
        (domain, problem, float(best), [float(each) for each in within.split(",")])
        for domain, problem, best, within in _rows(Path(__file__).parent / "published_optima.tsv")
    ]


def corpus_optima() -> list[Optimum]:
    """The public problems of the corpus whose optima are known; none where it is absent."""
    folder = corpus_folder()
    return [
        Optimum((folder / domain, folder / problem), best, tuple(zip((2, 4, 8, 16), within, strict=True)))
        for domain, problem, best, within in published()
        if folder is not None and (folder / problem).is_file()
    ]


def _rows(file: Path) -> list[list[str]]:
    lines = file.read_text(encoding="utf-8").splitlines()
    return [line.split("\t") for line in lines if not line.startswith("#")]


def public(folder: str, problem: str) -> Optimum:
    """A public problem by name, without its optimum; skips the test where the corpus is absent."""
    corpus = corpus_folder()
    if corpus is None:
        pytest.skip("no corpus: set BBTC_CORPUS, or put it at ../shared/corpus")
    domain = corpus / folder / "domain.pddl"
    if not domain.is_file():  # each problem has its own
        domain = corpus / folder / f"{problem.replace('problem', 'domain')}.pddl"
    return Optimum((domain, corpus / folder / f"{problem}.pddl"), -1, ())
