"""The glossary leads to code that is there, and leaves no part of the package out."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
PACKAGE = REPOSITORY / "bbtc"
ROW = re.compile(
    r"^\| (?P<term>[^|]+) \| (?P<means>[^|]+) \| (?P<source>[^|]+) \| (?P<where>[^|]+) \|$", re.MULTILINE
)
PLACE = re.compile(r"`(?P<path>[\w/]+(?:/|\.py))`(?: \(`(?P<name>\w+)`\))?")

ROWS = {
    row["term"]: row
    for row in ROW.finditer((REPOSITORY / "docs" / "glossary.md").read_text("utf-8").replace("\\*", "∗"))
    if row["term"] not in {"term", "---"}
}
WITHOUT_WORDS = {"cli", "syntax", "files", "cmake"}
"""Parts that have no words of their own: those of commands, parsers and files are everybody's."""


def defined_in(file: Path) -> set[str]:
    """What a module defines at its top."""
    names: set[str] = set()
    for node in ast.parse(file.read_text("utf-8")).body:
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.AnnAssign(target=ast.Name(id=name)):
                names.add(name)
            case ast.Assign(targets=[ast.Name(id=name)]):
                names.add(name)
            case _:
                pass
    return names


def test_the_terms_of_the_field_are_there() -> None:
    terms = ", ".join(ROWS)
    for term in (
        "MDP", "SSP", "MaxProb", "Bellman update", "qualitative reachability", "multi-policy",
        "end component", "strong cyclic", "contingent", "belief", "state", "Kleene logic", "determinisation",
        "latched", "guard", "template", "attempt", "target", "node status", "plan status", "policy",
    ):  # fmt: skip
        assert re.search(rf"(?:^|, ){term}(?:,|$)", terms), term
    assert "scheduler" in ROWS["policy"]["source"]


@pytest.mark.parametrize("term", ROWS)
def test_a_term_is_told_in_a_sentence_and_leads_to_code(term: str) -> None:
    row = ROWS[term]
    assert re.fullmatch(r"[A-Z\"].*[^.]\.", row["means"]), "one sentence"
    assert not re.search(r"[a-z)]\. [A-Z]", row["means"]), "one sentence"
    places = list(PLACE.finditer(row["where"]))
    assert places
    for place in places:
        path = PACKAGE / place["path"]
        assert path.is_dir() if place["path"].endswith("/") else path.is_file(), place["path"]
        if place["name"]:
            assert place["name"] in defined_in(path), f"{place['path']} defines no {place['name']}"
    named = set(re.findall(r"`([^`]+)`", row["where"]))
    assert named == {part for place in places for part in place.groups() if part}, "a place in another form"


def test_every_part_of_the_package_has_an_entry() -> None:
    named = {place["path"] for row in ROWS.values() for place in PLACE.finditer(row["where"])}
    folders = {
        path.parent.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("__init__.py")
        if path.parent != PACKAGE and len(list(path.parent.glob("*.py"))) > 1
    }
    wings = {folder for folder in folders if "/" not in folder} | {
        folder for folder in folders if folder.startswith("planner/")
    }
    assert "planner/mdp" in wings
    assert {wing for wing in wings if not any(path.startswith(f"{wing}/") for path in named)} <= WITHOUT_WORDS


def test_pages_lead_to_the_glossary() -> None:
    for page in (
        "README.md",
        "docs/index.md",
        "docs/architecture.md",
        "docs/planner.md",
        "docs/semantics.md",
    ):
        assert "glossary.md" in (REPOSITORY / page).read_text("utf-8"), page
    assert "glossary.md" in (REPOSITORY / "mkdocs.yml").read_text("utf-8")
