"""From source text to a syntax document, with every syntax error of the file."""

from __future__ import annotations

import gc
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from bbtc.diagnostics import Diagnostic, Related, Report, Severity
from bbtc.source import SourceFile, Span
from bbtc.syntax import ast, scan
from bbtc.syntax.balance import Balance
from bbtc.syntax.build import Builder
from bbtc.syntax.engine import Engine, Unexpected, make_tables
from bbtc.syntax.hints import Form, Place, explain, keywords, open_forms
from bbtc.syntax.leaves import SOURCE, Misuse

MAX_DEPTH = 100
"""Deepest nesting of parentheses that is read unless the caller allows more."""
_MAX_ERRORS = 20
# After an error the text is parsed again without the part at fault; in all, no more than this many
# characters are.
_RECOVERY_CHARACTERS = 20_000_000
# Sections whose parts stand on their own: an error in one part leaves the others readable.
_LISTS = frozenset((":init", ":predicates", ":functions", ":hidden"))
_FORM_END = re.compile(r"[()]")


def grammar_text() -> str:
    """The grammar of the language: package data in a wheel, ``grammar/bbtc.lark`` in a checkout."""
    packaged = files("bbtc").joinpath("grammar", "bbtc.lark")
    if packaged.is_file():
        return packaged.read_text("utf-8")
    return (Path(__file__).parents[2] / "grammar" / "bbtc.lark").read_text("utf-8")


@lru_cache(maxsize=1)
def _engine() -> Engine:
    return Engine(make_tables(grammar_text(), "document"), Builder())


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
    token = SOURCE.set(source)
    try:
        with _collector_paused():
            definitions = _definitions(text, source, report)
            comments = scan.comments(source)
    finally:
        SOURCE.reset(token)
    if not definitions and not report.errors:
        report.error("BBT0003", f"{source.name} holds no domain and no problem")
    return ast.Document(source, definitions, comments)


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Syntax nodes hold no cycles; looking for some again and again while the nodes grow in number
    takes as long as making them."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _definitions(text: str, source: SourceFile, report: Report) -> tuple[ast.Definition, ...]:
    try:
        return _engine().parse(text)  # type: ignore[no-any-return]
    except (Unexpected, Misuse):
        return _recovered(text, source, report)


def _recovered(text: str, source: SourceFile, report: Report) -> tuple[ast.Definition, ...]:
    """What can be read of a text with errors; the errors go to the report."""
    foreign, text = scan.foreign_characters(text)
    balance = Balance(text).run()
    # A quotation mark or the like may well be followed by a parenthesis that is none of the language's.
    lines = {source.position(fault.start)[0] for fault in foreign}
    counted = [fault for fault in balance.faults if source.position(fault.start)[0] not in lines]
    faults = [*foreign, *counted][:_MAX_ERRORS]
    edited = bytearray(balance.text, "ascii")
    work = 0
    definitions: tuple[ast.Definition, ...] = ()
    while len(faults) < _MAX_ERRORS:
        text = edited.decode("ascii")
        try:
            definitions = _engine().parse(text)
            break
        except Unexpected as error:
            accepted = _engine().accepted(error.stack)
            fault, forms = explain(Place(text, error.position, accepted, keywords(_engine().terminals)))
            at = error.position
        except Misuse as error:
            fault, at = _misuse(error), error.span.start
            forms = open_forms(text, at)
        if not _explained(fault, at, balance, faults) and not any(_near(fault, f) for f in foreign):
            faults.append(fault)
        start, end = _part(text, at, forms)
        work += len(text)
        if work > _RECOVERY_CHARACTERS or not text[start:end].strip():
            break
        scan.blank(edited, start, end)
    for fault in sorted(faults, key=lambda f: f.start):
        report.add(_diagnostic(fault, source))
    return definitions


def _misuse(error: Misuse) -> scan.Fault:
    _, start, end = error.span
    related = ("first given here", error.first.start, error.first.end) if error.first else None
    return scan.Fault(error.code, error.message, start, end, error.hint, related)


def _near(fault: scan.Fault, foreign: scan.Fault) -> bool:
    """Is this error about a word with foreign characters?"""
    return fault.start <= foreign.end and foreign.start <= fault.end


def _explained(fault: scan.Fault, at: int, balance: Balance, faults: list[scan.Fault]) -> bool:
    """Is an error what a parenthesis too many leaves behind? That parenthesis then stands right before
    the error, not at the end of the section, where the count showed it."""
    for extra in balance.extras:
        known = balance.faults[extra.fault]
        if known in faults and extra.section <= at < extra.start and balance.text[:at].rstrip().endswith(")"):
            place = balance.text[:at].rstrip()
            index = faults.index(known)
            message = "this parenthesis closes its form too early"
            related = ("this is left outside", fault.start, fault.end)
            faults[index] = faults[index]._replace(
                message=message, start=len(place) - 1, end=len(place), hint="remove it", related=related
            )
            return True
    return False


def _part(text: str, at: int, forms: list[Form]) -> tuple[int, int]:
    """The smallest part of a text around an error without which the rest can be read."""
    if len(forms) > 2 and forms[1].word in _LISTS:
        start = forms[2].start
    elif len(forms) == 2 and forms[1].word in _LISTS and not text.startswith(")", at):
        start = at
    elif len(forms) > 1:
        # An error in `(domain name)` takes the definition with it.
        start = forms[1].start if forms[1].word not in ("domain", "problem") else forms[0].start
    else:
        start = at
    return start, _form_end(text, start)


def _form_end(text: str, start: int) -> int:
    """Where the form, the words or the parenthesis that starts at an offset ends."""
    if not text.startswith("(", start):
        words = re.compile(r"\)|(?:[^\s()]+\s*)*").match(text, start)
        return words.end() if words else start + 1
    depth = 0
    for match in _FORM_END.finditer(text, start):
        depth += 1 if match.group() == "(" else -1
        if not depth:
            return match.end()
    return len(text)


def _diagnostic(fault: scan.Fault, source: SourceFile) -> Diagnostic:
    related: tuple[Related, ...] = ()
    if fault.related:
        message, start, end = fault.related
        related = (Related(message, Span(source, start, end)),)
    span = Span(source, min(fault.start, len(source.text)), min(fault.end, len(source.text)))
    return Diagnostic(fault.code, fault.message, span, fault.hint, Severity.ERROR, related)
