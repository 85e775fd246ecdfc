"""What the registry says of a code is what every finding of it is, and how a command ends that it stops."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from bbtc.cli.rendering import render
from bbtc.codes import CODES, exit_status
from bbtc.diagnostics import BbtcError, Diagnostic, Report, Severity
from bbtc.exit_status import ExitStatus
from bbtc.limits import Limits
from bbtc.source import SourceFile

REPOSITORY = Path(__file__).resolve().parent.parent
PAGES = REPOSITORY / "docs" / "errors"
A_LINE = SourceFile("a.pddl", "(a line)\n")


def test_the_commands_page_lists_the_exit_statuses() -> None:
    page = (REPOSITORY / "docs" / "commands.md").read_text(encoding="utf-8")
    table = page.partition("| exit status |")[2].partition("\n\n")[0]
    assert [int(each) for each in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)] == [*ExitStatus]


@pytest.mark.parametrize("code", CODES)
def test_a_finding_is_as_grave_as_its_code_unless_a_lesser_severity_is_given(code: str) -> None:
    every = [Severity.ERROR, Severity.WARNING, Severity.NOTE]
    gravest = CODES[code].severity
    assert Diagnostic(code, "found").severity is gravest
    for severity in every[every.index(gravest) :]:
        assert Diagnostic(code, "found", severity=severity).severity is severity
    for severity in every[: every.index(gravest)]:
        with pytest.raises(ValueError, match=code):
            Diagnostic(code, "found", severity=severity)


@pytest.mark.parametrize("page", sorted(PAGES.glob("BBT*.md")), ids=lambda each: each.stem)
def test_a_page_shows_nothing_graver_than_its_code(page: Path) -> None:
    shown = re.findall(rf"\b(error|warning|note)\[{page.stem}\]", page.read_text(encoding="utf-8"))
    ranks = [Severity(word).rank for word in shown]
    assert not ranks or min(ranks) == CODES[page.stem].severity.rank


@pytest.mark.parametrize(
    ("codes", "status"),
    [
        (["BBT0101"], 1),
        (["BBT0701"], 2),
        (["BBT0701", "BBT0501"], 2),
        (["BBT0701", "BBT0101"], 1),
        (["BBT0007"], 3),
        (["BBT0504"], 3),
        (["BBT0101", "BBT0007"], 1),
        (["BBT0101", "BBT1006"], 70),
    ],
)
def test_what_is_wrong_with_the_input_decides_how_a_command_ends(codes: list[str], status: int) -> None:
    assert exit_status(codes) == status
    assert BbtcError(Diagnostic(code, "found") for code in codes).exit_status == status


def test_limits_end_with_their_own_status() -> None:
    assert Limits.reached("too many", "--max-states").exit_status is ExitStatus.LIMIT


def test_warnings_beside_wrong_usage_do_not_make_it_an_error_of_the_input() -> None:
    report = Report()
    report.add(Diagnostic("BBT0701", "unknown format"))
    report.add(Diagnostic("BBT0301", "unused"))
    with pytest.raises(BbtcError) as raised:
        report.raise_errors()
    assert raised.value.exit_status is ExitStatus.USAGE


def test_sarif_has_the_page_and_the_severity_of_every_code() -> None:
    found = [Diagnostic(code, "found", A_LINE.span(0, 1)) for code in CODES]
    (run,) = json.loads(render(found, "sarif"))["runs"]
    rules = {each["id"]: each for each in run["tool"]["driver"]["rules"]}
    assert list(rules) == sorted(CODES)
    for code, rule in rules.items():
        text = (PAGES / f"{code}.md").read_text(encoding="utf-8")
        assert text.startswith(f"# {code}: {rule['shortDescription']['text']}\n")
        assert rule["help"] == {"text": text, "markdown": text}
        assert rule["defaultConfiguration"] == {"level": Diagnostic(code, "found").severity.value}
