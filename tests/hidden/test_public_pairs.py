"""Every well-formed pair of a public contingent domain and problem compiles, unless a component has too many
worlds."""

from __future__ import annotations

from pathlib import Path

import pytest

from bbtc import pipeline
from bbtc.diagnostics import BbtcError, Report
from bbtc.limits import Limits
from bbtc.source import SourceFile
from tests.conftest import corpus_folder
from tests.corpus import read_corpus
from tests.long_form import amount

FAMILIES = ("contingent", "contingent-prob")
LARGE = 150_000  # bytes of domain and problem; the largest take half a minute
UNREACHABLE = {"contingent/sdr-sokoban/sokoban-p.old.pddl"}
"""A problem with walls around a stone."""


def _pairs() -> list[tuple[str, str]]:
    folder = corpus_folder()
    if folder is None:
        return []
    corpus = read_corpus(folder)
    found = [
        (domain, problem)
        for family in FAMILIES
        for problem in corpus.families[family]
        for domain in corpus.partners.get(problem, ())
    ]
    small = [pair for pair in found if sum((folder / path).stat().st_size for path in pair) < LARGE]
    return found if amount(0, 1) else small[::6]


@pytest.mark.parametrize(("domain", "problem"), _pairs(), ids=lambda path: path.replace("/", "-"))
def test_a_pair_compiles_unless_it_has_too_many_worlds(domain: str, problem: str, corpus: Path) -> None:
    report = Report()
    sources = [
        SourceFile(path, (corpus / path).read_text("utf-8", errors="replace")) for path in (domain, problem)
    ]
    try:
        inputs = pipeline.select(pipeline.parse_all(sources, report, Limits()), report)
        report.raise_errors()
        assert inputs is not None
        model = pipeline.resolve_model(inputs, report, checks=False)
    except BbtcError as error:
        pytest.skip(f"not well-formed: {error.diagnostics[0].message}")
    codes: set[str] = set()
    try:
        pipeline.ground_model(model, report, Limits())
    except BbtcError as error:
        codes = {diagnostic.code for diagnostic in error.diagnostics}
    allowed = {"BBT0412"} if problem in UNREACHABLE else {"BBT0415"}
    assert codes in (set(), allowed)
