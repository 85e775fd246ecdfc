"""The examples of the language reference: complete ones compile without any message, parts parse."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse
from tests.docs.test_errors import diagnostics

PAGE = Path(__file__).parents[2] / "docs" / "language.md"
EXAMPLE = re.compile(r"(?:^Part of a (domain|problem):\n\n)?^```pddl\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXAMPLES = [(kind, text) for kind, text in EXAMPLE.findall(PAGE.read_text("utf-8"))]
COMPLETE = [text for kind, text in EXAMPLES if not kind]
PARTS = [(kind, text) for kind, text in EXAMPLES if kind]


@pytest.mark.parametrize("text", COMPLETE, ids=lambda text: text.split()[2].strip(")"))
def test_a_complete_example_compiles_without_a_message(text: str) -> None:
    assert "(problem" in text
    assert [diagnostic.render() for diagnostic in diagnostics(text)] == []


@pytest.mark.parametrize(("kind", "text"), PARTS)
def test_a_part_is_of_the_language(kind: str, text: str) -> None:
    report = Report()
    document = parse(SourceFile("part.pddl", f"(define ({kind} part)\n{text})"), report)
    assert [diagnostic.render() for diagnostic in report] == []
    assert document.definitions[0].sections


def test_every_construct_of_the_design_has_an_example() -> None:
    shown = " ".join(text for _, text in EXAMPLES)
    words = re.findall(
        r"\S+",
        ":requirements :types either :constants :objects :predicates = not and or imply exists forall when "
        ":derived increase :metric probabilistic :goal-probability oneof :observe unknown known :template "
        "sequence fallback condition foreach action :goal :init :sensor",
    )
    assert [word for word in words if f"({word}" not in shown and f" {word} " not in shown] == []
