"""For mkdocs: links from the pages to files of the repository that are not pages become their names."""

from __future__ import annotations

import re
from typing import Any

_OUTSIDE = re.compile(
    r"\[([^\]]+)\]\(((?:\.\./)+(?:domains|grammar|bbtc|tests|README\.md|CHANGELOG\.md|LICENSE)[^)]*)\)"
)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page, without links that lead out of the site."""
    return _OUTSIDE.sub(r"`\1`", markdown)
