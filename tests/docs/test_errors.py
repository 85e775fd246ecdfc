"""The pages of the codes: each exists, and its examples show what it says.

A page holds a wrong and a right text, or console snippets (run by ``test_snippets``), or, where no
small example would show it everywhere, words alone.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from bbtc import pipeline
from bbtc.codes import CODES
from bbtc.diagnostics import BbtcError, Diagnostic, Report
from bbtc.limits import MOST_NODES, Limits
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse
from tests.cli.program import bbtc
from tests.long_form import amount

REPOSITORY = Path(__file__).parents[2]
PAGES = REPOSITORY / "docs" / "errors"
EXAMPLE = re.compile(r"^## (Wrong|Right)\n\n```pddl\n(.*?)^```$", re.MULTILINE | re.DOTALL)
WORDS_ALONE = {
    "BBT0408",
    "BBT0502",
    "BBT0504",
    "BBT0613",
    "BBT0702",
    "BBT0703",
    "BBT0705",
    "BBT0706",
    "BBT1006",
    "BBT0803",
    "BBT0804",
}

ALSO = {"BBT0315": {"BBT0316", "BBT0412"}, "BBT0316": {"BBT0412"}, "BBT0412": {"BBT0316"}}
"""Codes that come together: what a check warns about, planning stops at."""


def examples(code: str) -> dict[str, str]:
    """The wrong and the right text of a page, if it has them."""
    return dict(EXAMPLE.findall((PAGES / f"{code}.md").read_text("utf-8")))


TITLES = {code: each.title for code, each in CODES.items()}
WITH_EXAMPLES = [code for code in CODES if (PAGES / f"{code}.md").exists() and examples(code)]


LIMITS = Limits(diagram_nodes=amount(20_000, MOST_NODES))
"""Fewer nodes are sooner too many."""


def diagnostics(text: str) -> list[Diagnostic]:
    """All that ``check`` and ``compile`` tell about a text."""
    report = Report()
    try:
        document = parse(SourceFile("example.pddl", text), report)
        report.raise_errors()
        inputs = pipeline.select([document], report)
        assert inputs is not None
        model = pipeline.resolve_model(inputs, report, checks=False)
        pipeline.check_documents([document], report, limits=LIMITS)
        if inputs.problem is not None:
            pipeline.ground_model(model, report, LIMITS)
    except BbtcError as error:
        for diagnostic in error.diagnostics:
            report.add(diagnostic)
    return list(report)


@pytest.mark.parametrize("code", CODES)
def test_every_code_has_a_page_with_its_title(code: str) -> None:
    text = (PAGES / f"{code}.md").read_text("utf-8")
    assert text.startswith(f"# {code}: {CODES[code].title}\n\n")
    shown = f"[{code}]" in text and "```console" in text
    assert shown or set(examples(code)) == {"Wrong", "Right"} or code in WORDS_ALONE


def test_no_page_is_left_over() -> None:
    assert {path.stem for path in PAGES.glob("BBT*.md")} == CODES.keys()


def test_the_index_lists_every_code() -> None:
    index = (PAGES / "README.md").read_text("utf-8")
    assert dict(re.findall(r"^\| \[(BBT\d{4})\]\(\1\.md\) \| (.*) \|$", index, re.MULTILINE)) == {
        code: each.title for code, each in CODES.items()
    }


@pytest.mark.parametrize("code", WITH_EXAMPLES)
def test_the_wrong_example_gives_exactly_this_code(code: str) -> None:
    assert {diagnostic.code for diagnostic in diagnostics(examples(code)["Wrong"])} == {code} | ALSO.get(
        code, set()
    )


@pytest.mark.parametrize("code", WITH_EXAMPLES)
def test_the_right_example_gives_nothing(code: str) -> None:
    assert [diagnostic.render() for diagnostic in diagnostics(examples(code)["Right"])] == []


def explain(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run ``bbtc explain``."""
    return bbtc("explain", *arguments)


@pytest.mark.parametrize("spelling", ["BBT0202", "bbt0202", "0202", "202"])
def test_explain_prints_the_page(spelling: str) -> None:
    done = explain(spelling)
    assert (done.returncode, done.stdout) == (0, (PAGES / "BBT0202.md").read_text("utf-8"))


def test_explain_without_a_code_lists_all() -> None:
    assert [line.split("  ", 1) for line in explain().stdout.splitlines()] == [
        [each.code, each.title] for each in CODES.values()
    ]


def test_an_unknown_code_is_wrong_usage_and_gets_near_ones() -> None:
    done = explain("BBT0299")
    assert done.returncode == 2
    assert "BBT0301" in done.stderr
