"""What users read when names, types or probabilities are wrong: `errors/*.pddl`, each with its `.txt`."""

from __future__ import annotations

from pathlib import Path

import pytest

from bbtc.codes import CODES
from bbtc.diagnostics import Report
from bbtc.pipeline import check_documents
from bbtc.source import Reading, SourceFile
from bbtc.syntax.parser import parse

CASES = sorted((Path(__file__).parent / "errors").glob("*.pddl"))


def _report(path: Path) -> Report:
    report = Report()
    document = parse(SourceFile(path.name, path.read_text("utf-8")), report)
    check_documents([document], report, Reading(lenient=path.stem == "lenient"))
    return report


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_messages_are_as_written_down(path: Path, request: pytest.FixtureRequest) -> None:
    expected = path.with_suffix(".txt")
    actual = "\n".join(diagnostic.render() for diagnostic in _report(path)) + "\n"
    if request.config.getoption("--update-golden"):
        expected.write_text(actual, "utf-8")
    assert expected.exists(), "no expectation; run with --update-golden and read it"
    assert actual == expected.read_text("utf-8")


def test_every_message_has_a_place() -> None:
    assert [d for path in CASES for d in _report(path) if d.span is None] == []


def test_every_code_of_names_and_checks_is_shown_by_a_case() -> None:
    shown = {diagnostic.code for path in CASES for diagnostic in _report(path)}
    assert {code for code in CODES if code[3:5] in {"02", "03"}} - shown == set()
