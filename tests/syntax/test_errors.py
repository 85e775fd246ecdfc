"""What users read when a file is malformed: `errors/*.pddl`, each with its `.txt`."""

from __future__ import annotations

from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.files.sources import decode_source
from bbtc.syntax.parser import parse
from bbtc.syntax.tables import grammar_text

CASES = sorted((Path(__file__).parent / "errors").glob("*.pddl"))


def _messages(path: Path) -> str:
    report = Report()
    parse(decode_source(path.name, path.read_bytes()), report)
    return "\n".join(diagnostic.render() for diagnostic in report) + "\n"


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_messages_are_as_written_down(path: Path, request: pytest.FixtureRequest) -> None:
    expected = path.with_suffix(".txt")
    actual = _messages(path)
    if request.config.getoption("--update-golden"):
        expected.write_text(actual, "utf-8")
    assert expected.exists(), "no expectation; run with --update-golden and read it"
    assert actual == expected.read_text("utf-8")


def test_no_message_names_a_terminal_of_the_grammar() -> None:
    terminals = {
        line.split(":")[0].split(".")[0] for line in grammar_text().splitlines() if line[:1].isupper()
    }
    shouted = {word.strip("`'(),.:") for path in CASES for word in _messages(path).split()}
    assert "FLAT" in terminals
    assert not terminals & shouted
