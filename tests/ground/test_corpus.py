"""Grounding of public problems: the small ones against enumeration."""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from pathlib import Path

import pytest

from bbtc.analysis.resolve import resolve
from bbtc.diagnostics import Report
from bbtc.ground.instantiate import instantiate
from bbtc.limits import Limits
from bbtc.model.domain import Model
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse
from tests.conftest import corpus_folder
from tests.ground import reference
from tests.planner.examples import published

CORPUS = corpus_folder()
pytestmark = pytest.mark.skipif(CORPUS is None, reason="no corpus beside the repository")

_MOST_BINDINGS = 3000
_PER_FOLDER = 1


def _model(domain: str, problem: str) -> Model:
    assert CORPUS is not None
    report = Report()
    found = {}
    for path in dict.fromkeys((domain, problem)):
        text = Path(CORPUS, path).read_text("utf-8", errors="replace")
        for definition in parse(SourceFile(path, text), report).definitions:
            found[definition.kind] = definition
    model = resolve(found["domain"], found["problem"], report)
    report.raise_errors()
    assert model is not None
    return model


def _optima() -> Iterator[tuple[str, str]]:
    """Problems of the corpus that were small enough to be solved by enumeration."""
    if CORPUS is None:
        return
    seen: dict[str, int] = {}
    for domain, problem, *_ in published():
        folder = problem.rpartition("/")[0]
        if (CORPUS / problem).is_file() and seen.setdefault(folder, 0) < _PER_FOLDER:
            seen[folder] += 1
            yield domain, problem


@pytest.mark.parametrize(("domain", "problem"), list(_optima()), ids=lambda path: path.replace("/", "-"))
def test_the_actions_are_those_that_enumeration_finds(domain: str, problem: str) -> None:
    model = _model(domain, problem)
    bindings = sum(
        prod(len(reference.objects_of(model, p.types)) for p in schema.parameters)
        for schema in model.schemas.values()
    )
    if bindings > _MOST_BINDINGS:
        pytest.skip(f"{bindings} bindings are too many to enumerate here")
    task = instantiate(model, Report(), Limits())
    _, actions = reference.relaxed(model)
    assert [action.name for action in task.actions] == sorted(actions)


def test_a_tireworld_has_a_move_for_each_road_and_a_change_for_each_spare() -> None:
    folder = "fond/triangle-tireworld"
    model = _model(f"{folder}/domain.pddl", f"{folder}/p11.pddl")
    expected = {
        (("move-car" if fact.predicate == "road" else "changetire"), fact.args)
        for fact in model.init.facts
        if fact.predicate in {"road", "spare-in"}
    }
    task = instantiate(model, Report(), Limits())
    assert {(action.schema, action.args) for action in task.actions} == expected
    assert len(expected) == 681
