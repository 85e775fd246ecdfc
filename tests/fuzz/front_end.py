"""What must hold for any bytes at all: :func:`check_input`, shared by the fuzz run and its regressions."""

from __future__ import annotations

import time

from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.files.sources import decode_source
from bbtc.limits import Limits
from bbtc.pipeline import ground_model, parse_all, resolve_model, select
from bbtc.source import SourceFile
from bbtc.syntax.ast import Document
from bbtc.syntax.parser import parse
from bbtc.syntax.printer import print_document

SECONDS = 10.0
"""Longest processor time that one small input may take."""

_TASK_SECONDS = 2.0


def check_input(data: bytes) -> str:
    """How far the bytes came: ``refused``, ``parsed``, ``resolved``, ``grounded`` or ``limit``.

    Raises ``AssertionError`` if printing loses anything or time runs away, and whatever the front
    end lets through that is not a diagnostic.
    """
    start = time.process_time()
    reached = _run(data)
    taken = time.process_time() - start
    assert taken < SECONDS, f"took {taken:.1f} s"
    return reached


def _run(data: bytes) -> str:
    report, reached = Report(), "refused"
    try:
        source = decode_source("fuzz.pddl", data)
        (document,) = parse_all([source], report)
        report.raise_errors()
        reached = "parsed"
        _check_printing(document)
        inputs = select([document], report)
        report.raise_errors()
        assert inputs is not None
        model = resolve_model(inputs, report, checks=True)
        reached = "resolved"
        if inputs.problem is not None:
            ground_model(model, report, _limits())
            reached = "grounded"
    except LimitReached as error:
        _check_messages(error, report)
        return "limit"
    except BbtcError as error:
        _check_messages(error, report)
        return reached
    _check_messages(None, report)
    return reached


def _limits() -> Limits:
    return Limits(
        seconds=_TASK_SECONDS,
        actions=2_000,
        facts=20_000,
        bindings=200_000,
        memory=1 << 31,  # that of the whole process, which grows over a long run
        initial_states=64,
    )


def _check_printing(document: Document) -> None:
    """Parsing what was printed gives an equal tree, and printing that gives the same text."""
    text = print_document(document)
    report = Report()
    again = parse(SourceFile("printed.pddl", text), report)
    assert not report.errors, f"what was printed is refused: {report.errors[0].render()}"
    assert again.definitions == document.definitions, "parsing what was printed gives another tree"
    assert print_document(again) == text, "printing twice gives another text"


def _check_messages(error: BbtcError | None, report: Report) -> None:
    """Every message can be shown, and an error says something."""
    shown = [*report, *(error.diagnostics if error else ())]
    assert shown or error is None, "refused without a message"
    for diagnostic in shown:
        assert diagnostic.render().strip()
        assert diagnostic.message
