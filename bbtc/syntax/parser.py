"""From source text to a syntax document, with every syntax error of the file."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from bbtc.diagnostics import Report
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast
from bbtc.syntax.build import Builder
from bbtc.syntax.engine import Engine, Unexpected, make_tables
from bbtc.syntax.leaves import SOURCE, Misuse

_COMMENT = re.compile(r";[^\r\n]*")


def grammar_text() -> str:
    """The grammar of the language: package data in a wheel, ``grammar/bbtc.lark`` in a checkout."""
    packaged = files("bbtc").joinpath("grammar", "bbtc.lark")
    if packaged.is_file():
        return packaged.read_text("utf-8")
    return (Path(__file__).parents[2] / "grammar" / "bbtc.lark").read_text("utf-8")


@lru_cache(maxsize=1)
def _parser() -> Engine:
    return Engine(make_tables(grammar_text(), "document"), Builder())


def parse(source: SourceFile, report: Report) -> ast.Document:
    """Parse a file. Syntax errors go to the report, and the sections that hold them are left out."""
    comments = []
    for match in _COMMENT.finditer(source.text):
        line = source.text.rfind("\n", 0, match.start()) + 1
        own = not source.text[line : match.start()].strip()
        comments.append(ast.Comment(match.group().rstrip(), own, Span(source, *match.span())))
    text = _COMMENT.sub(lambda match: " " * len(match.group()), source.text)
    token = SOURCE.set(source)
    definitions: tuple[ast.Definition, ...] = ()
    try:
        definitions = _parser().parse(text)
    except Unexpected as error:
        at = error.position
        report.error("BBT0101", "cannot be read", Span(source, at, at + 1))
    except Misuse as error:
        report.error(error.code, error.message, error.span, error.hint)
    finally:
        SOURCE.reset(token)
    return ast.Document(source, definitions, tuple(comments))
