"""From source text to a syntax document, with every syntax error of the file."""

from __future__ import annotations

from functools import lru_cache

from bbtc.collector import collector_paused
from bbtc.diagnostics import Report
from bbtc.limits import MOST_WORLDS
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast, scan
from bbtc.syntax.build import Builder
from bbtc.syntax.engine import Engine, TooDeep, Unexpected
from bbtc.syntax.leaves import Misuse
from bbtc.syntax.recover import Parser, recovered
from bbtc.syntax.tables import tables

MAX_DEPTH = 100
"""Deepest nesting of parentheses that is read unless the caller allows more."""


@lru_cache(maxsize=1)
def _engine() -> Parser:
    return Engine(tables(), Builder())


def parse(source: SourceFile, report: Report, max_depth: int = MAX_DEPTH) -> ast.Document:
    """The syntax tree of a file.

    Every syntax error goes to the report; the document then lacks the sections (or facts, or
    declarations) that hold one. Parentheses nested deeper than ``max_depth`` are an error, too: what
    follows the parser may recurse.
    """
    text = scan.without_comments(source.text)
    deep = scan.too_deep(text, max_depth)
    if deep is not None:
        report.error(
            "BBT0005", f"parentheses are nested more than {max_depth} deep", Span(source, deep, deep + 1)
        )
        return ast.Document(source)
    crowded = scan.too_many_branches(text, source, MOST_WORLDS)
    if crowded is not None:
        report.add(crowded)
        return ast.Document(source)
    with collector_paused():
        definitions = _definitions(text, source, report, max_depth)
        comments = scan.comments(source)
    if not definitions and not report.errors:
        report.error("BBT0003", f"{source.name} holds no domain and no problem")
    return ast.Document(source, definitions, comments)


def _definitions(text: str, source: SourceFile, report: Report, max_depth: int) -> tuple[ast.Definition, ...]:
    try:
        # Every form that is open has a state on the stack: in a shallow stack nothing is too deep.
        return _engine().parse(text, source, max_depth)
    except (TooDeep, Unexpected, Misuse):
        deep = scan.too_deep(text, max_depth)
    if deep is not None:
        report.error(
            "BBT0005", f"parentheses are nested more than {max_depth} deep", Span(source, deep, deep + 1)
        )
        return ()
    try:
        return _engine().parse(text, source)
    except (Unexpected, Misuse):
        return recovered(text, source, report, _engine())
