"""The pictures of docs/ are what `make pictures` draws."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.program import bbtc

REPOSITORY = Path(__file__).parents[2]
PAGE = REPOSITORY / "docs" / "pictures.md"


def test_the_pictures_are_up_to_date(tmp_path: Path) -> None:
    if shutil.which("make") is None:
        pytest.skip("no make")
    recipe = subprocess.run(
        ["make", "-n", "pictures", "BBTC=bbtc", f"OUT={tmp_path}"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    commands = [shlex.split(line) for line in recipe.splitlines() if line.startswith("bbtc ")]
    drawn = set()
    for _, name, *arguments in commands:
        check = ["--check"] if name == "export" else []
        done = bbtc(name, *arguments, *check)
        assert done.returncode == 0, done.stderr
        drawn |= {argument for argument in arguments if argument.startswith("docs/pictures/")}
    kept = {str(path.relative_to(REPOSITORY)) for path in (REPOSITORY / "docs" / "pictures").iterdir()}
    assert drawn == kept


def test_the_page_shows_the_text_formats_as_they_are() -> None:
    page = PAGE.read_text()
    for name, language in (("household.mmd", "mermaid"), ("household.txt", "text")):
        assert f"```{language}\n{(PAGE.parent / 'pictures' / name).read_text()}```" in page
