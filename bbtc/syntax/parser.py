"""From source text to a syntax document, with every syntax error of the file."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import cast

from lark import Lark
from lark.exceptions import UnexpectedInput

from bbtc.diagnostics import Report
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast
from bbtc.syntax.build import SOURCE, Builder, Misuse

_COMMENT = re.compile(r";[^\r\n]*")


def grammar_text() -> str:
    """The grammar of the language: package data in a wheel, ``grammar/bbtc.lark`` in a checkout."""
    packaged = files("bbtc").joinpath("grammar", "bbtc.lark")
    if packaged.is_file():
        return packaged.read_text("utf-8")
    return (Path(__file__).parents[2] / "grammar" / "bbtc.lark").read_text("utf-8")


@lru_cache(maxsize=1)
def _parser() -> Lark:
    return Lark(
        grammar_text(),
        parser="lalr",
        lexer="contextual",
        start="document",
        transformer=Builder(),
        g_regex_flags=re.IGNORECASE | re.ASCII,
        maybe_placeholders=False,
    )


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
        definitions = cast("tuple[ast.Definition, ...]", _parser().parse(text))
    except UnexpectedInput as error:
        at = error.pos_in_stream or -1
        at = at if 0 <= at < len(text) else len(text)
        report.error("BBT0101", "cannot be read", Span(source, at, at + 1))
    except Misuse as error:
        report.error(error.code, error.message, error.span, error.hint)
    finally:
        SOURCE.reset(token)
    return ast.Document(source, definitions, tuple(comments))
