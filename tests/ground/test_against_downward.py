"""Ground actions of public problems are those that Fast Downward finds.

Neither counts actions that do nothing: those whose effects all stand under conditions that can never be
met. Fast Downward splits an action at disjunctions, so of ADL problems the names are compared, each once.
"""

from __future__ import annotations

import csv
import re
import subprocess
from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.ground.instantiate import instantiate
from bbtc.limits import Limits
from bbtc.pipeline import parse_all, resolve_model, select
from tests import downward
from tests.conftest import corpus_folder
from tests.corpus import read_corpus

CORPUS = corpus_folder()
pytestmark = [
    pytest.mark.skipif(CORPUS is None, reason="no corpus beside the repository"),
    pytest.mark.skipif(downward.translator() is None, reason="the package up-fast-downward is not installed"),
]

# What is not STRIPS, by the names of the corpus's index; `not` may stand in effects.
_ADL = {"when", "forall", "exists", "or", "imply"}
_BEYOND = {"derived", "numeric", "pddl3", "either"}
# Cells blocked from the start stay so: bbtc leaves out the actions that need them free, Fast Downward does
# not look at negative conditions.
_STRICTER = {"nurikabe-sat18-adl"}
_SECONDS = 20
_LARGEST = 30_000  # bytes of a problem; the smallest of each folder


def _pairs(*, adl: bool) -> list[tuple[str, str]]:
    if CORPUS is None:
        return []
    corpus = read_corpus(CORPUS)
    with (CORPUS / "INDEX.tsv").open(newline="", encoding="utf-8") as lines:
        rows = {row["path"]: row for row in csv.DictReader(lines, delimiter="\t", quoting=csv.QUOTE_NONE)}
    found: dict[str, list[tuple[int, str, str]]] = {}
    for problem in corpus.families["classical"]:
        for domain in corpus.partners.get(problem, ()):
            size = int(rows[problem]["bytes"])
            used = {*rows[problem]["features"].split(","), *rows[domain]["features"].split(",")}
            odd = domain in corpus.odd or problem in corpus.odd
            if size <= _LARGEST and not used & _BEYOND and bool(used & _ADL) == adl and not odd:
                found.setdefault(str(Path(problem).parent), []).append((size, domain, problem))
    return [pair[1:] for pairs in found.values() for pair in sorted(pairs)[:1]]


@pytest.mark.parametrize(("domain", "problem"), _pairs(adl=False), ids=lambda path: path.replace("/", "-"))
def test_the_actions_are_those_that_fast_downward_finds(domain: str, problem: str) -> None:
    ours, found = _names(domain, problem)
    if _has_negative_conditions(domain):
        # Fast Downward leaves negative conditions out of its relaxation; enumeration agrees with bbtc.
        assert set(ours) <= set(found)
    else:
        assert ours == found


@pytest.mark.parametrize(("domain", "problem"), _pairs(adl=True), ids=lambda path: path.replace("/", "-"))
def test_the_names_of_adl_actions_are_those_that_fast_downward_finds(domain: str, problem: str) -> None:
    ours, found = _names(domain, problem)
    if Path(domain).parent.name in _STRICTER:
        assert set(ours) < set(found)
    else:
        assert ours == sorted({*found})


def _names(domain: str, problem: str) -> tuple[list[str], list[str]]:
    """The names of our actions and of theirs, sorted."""
    assert CORPUS is not None
    try:
        theirs = downward.explore(CORPUS / domain, CORPUS / problem, names=True, timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        pytest.skip(f"Fast Downward takes longer than {_SECONDS} s")
    if not theirs.reachable:
        pytest.skip("the goal cannot be reached")
    report = Report()
    inputs = select(parse_all([read_source(str(CORPUS / f)) for f in (domain, problem)], report), report)
    report.raise_errors()
    assert inputs is not None
    task = instantiate(resolve_model(inputs, report, checks=False), report, Limits())
    ours = sorted(f"({' '.join((action.schema, *action.args))})".lower() for action in task.actions)
    return ours, sorted(name.replace(" )", ")") for name in theirs.names)


def _has_negative_conditions(domain: str) -> bool:
    """Whether `not` stands between a precondition and the effect after it."""
    assert CORPUS is not None
    text = re.sub(r";[^\n]*", "", (CORPUS / domain).read_text("latin-1")).lower()
    return any("(not" in part.split(":effect")[0] for part in text.split(":precondition")[1:])
