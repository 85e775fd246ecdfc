"""Every well-formed pair of a public contingent domain and problem compiles."""

from __future__ import annotations

from pathlib import Path

import pytest

from bbtc import pipeline
from bbtc.diagnostics import BbtcError, Report
from bbtc.limits import Limits
from bbtc.source import SourceFile
from tests.conftest import corpus_folder
from tests.corpus import read_corpus
from tests.hidden import public_pairs
from tests.long_form import amount

FAMILIES = ("contingent", "contingent-prob")
DIALECTS = ("krep", "pomdp")
REFUSED = {
    # Parts of a condition that read one component and much that is seen.
    "krep/fsc-grid-axis": {"BBT0416"},
    "krep/fsc-grid-rot": {"BBT0416"},
    # Pits and breezes all over a square of ten by ten.
    "krep/wumpus-full": {"BBT0415"},
    # Files that only hold hidden facts, misspelt names, and a domain in which the goal cannot be reached.
    "krep/mv-localize": {"BBT0213"},
    "krep/mv-medpks": {"BBT0203", "BBT0213"},
    "krep/mv-rocksample": {"BBT0202", "BBT0203", "BBT0213"},
    "krep/mv-wumpus": {"BBT0203", "BBT0213", "BBT0412"},
    "pomdp/dtpddl-rovers": {"BBT0212"},
    # Without a goal: rewards are to be collected for 40 steps.
    "pomdp/ippc11-po-ppddl": {"BBT0411"},
    # A problem of another domain.
    "pomdp/po-pddl": {"BBT0202", "BBT0207", "BBT0211"},
}
"""By folder of the dialects: the codes that refuse some of its pairs."""
_SMALL = 30_000
LARGE = 150_000  # bytes of domain and problem; the largest take half a minute
UNREACHABLE = {"contingent/sdr-sokoban/sokoban-p.old.pddl"}
"""A problem with walls around a stone."""


def _in_dialects() -> list[tuple[str, str]]:
    folder = corpus_folder()
    if folder is None:
        return []
    found = list(public_pairs.pairs(folder, DIALECTS))
    small = [pair for pair in found if sum((folder / path).stat().st_size for path in pair) < _SMALL]
    return found if amount(0, 1) else small[::6]


@pytest.mark.parametrize(("domain", "problem"), _in_dialects(), ids=lambda path: path.replace("/", "-"))
def test_a_pair_in_a_dialect_compiles_or_is_refused_by_name(domain: str, problem: str, corpus: Path) -> None:
    found = public_pairs.fate(corpus, domain, problem)
    assert found == public_pairs.COMPILED or {*found.split()} <= REFUSED.get(
        public_pairs.place(problem), set()
    )


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
def test_a_pair_compiles(domain: str, problem: str, corpus: Path) -> None:
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
    assert codes == ({"BBT0412"} if problem in UNREACHABLE else set())
