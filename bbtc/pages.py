"""The pages of the codes."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from bbtc.codes import CODES


def page(code: str) -> str:
    """The page of a registered code, in Markdown: package data in a wheel, ``docs/errors/`` in a
    checkout. Raises ``KeyError`` for a code that is not registered."""
    packaged = files("bbtc") / "errors" / CODES[code].page
    if packaged.is_file():
        return packaged.read_text("utf-8")
    return (Path(__file__).parents[1] / "docs" / "errors" / CODES[code].page).read_text("utf-8")


def site() -> str | None:
    """Where the pages are published: the URL "Documentation" of the installed package's metadata
    (``[project.urls]`` of ``pyproject.toml``). None if it names none."""
    from importlib.metadata import PackageNotFoundError, metadata

    try:
        urls = metadata("bbtc").get_all("Project-URL") or []
    except PackageNotFoundError:
        return None
    named = dict(each.split(", ", 1) for each in urls)
    return named.get("Documentation")
