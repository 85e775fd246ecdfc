"""Layout over the corpus of public files: it changes no tree, no comment, and is stable.

The files are those of the corpus that parse; continuous integration takes each 40th of them, and
``BBTC_LONG=1`` all (``tests.corpus`` counts which parse, and that what is printed holds the same words).
"""

from __future__ import annotations

from pathlib import Path

from bbtc.diagnostics import BbtcError, Report
from bbtc.files.sources import read_source
from bbtc.source import SourceFile
from bbtc.syntax import ast
from bbtc.syntax.layout import WIDTH
from bbtc.syntax.parser import parse
from bbtc.syntax.printer import print_document
from tests.long_form import amount

EVERY = amount(40, 1)


def test_layout_keeps_trees_and_comments_and_is_stable(corpus: Path) -> None:
    files = sorted(file for file in corpus.rglob("*pddl") if file.is_file())[::EVERY]
    tried, wrong = 0, []
    for file in files:
        document = _read(file)
        if document is not None:
            tried += 1
            wrong += [f"{file.relative_to(corpus)}: {fault}" for fault in _faults(document)]
    print(f"{tried} of {len(files)} files parse")
    assert not wrong, "\n".join(wrong)
    assert tried > 0.8 * len(files)


def _read(file: Path) -> ast.Document | None:
    """The file's tree, if it has no syntax errors."""
    report = Report()
    try:
        document = parse(read_source(str(file)), report)
    except BbtcError:
        return None
    return None if report.errors else document


def _faults(document: ast.Document) -> list[str]:
    text = print_document(document)
    report = Report()
    again = parse(SourceFile("printed.pddl", text), report)
    if report.errors:
        return [f"what is printed is refused: {report.errors[0].render()}"]
    faults = []
    if again.definitions != document.definitions:
        faults.append("parsing what is printed gives another tree")
    if again.comments != document.comments:
        faults.append("comments are lost or moved behind code, or away from it")
    if print_document(again) != text:
        faults.append("printing twice gives another text")
    # A word has no place to break, nor has a name behind what opens its form.
    long = [line for line in text.splitlines() if len(line) > WIDTH and ";" not in line]
    if any(len(line.split()) > 2 for line in long if not line.startswith("(define (")):
        faults.append(f"a line is too long: {long[0]}")
    return faults
