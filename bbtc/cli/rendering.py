"""Diagnostics as text, JSON, SARIF 2.1.0, or GitHub workflow commands."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from bbtc.codes import CODES, Code
from bbtc.diagnostics import Diagnostic, Severity
from bbtc.pages import page, site
from bbtc.printable import escaped, printable_line
from bbtc.source import Span
from bbtc.version import __version__

SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def render(diagnostics: Sequence[Diagnostic], form: str, *, color: bool = False) -> str:
    """The diagnostics in one of the forms ``text``, ``json``, ``sarif`` and ``github``; ends with
    a newline unless it is empty."""
    if form == "json":
        return escaped(json.dumps([_as_json(d) for d in diagnostics], indent=2, ensure_ascii=False)) + "\n"
    if form == "sarif":
        return escaped(json.dumps(_as_sarif(diagnostics), indent=2, ensure_ascii=False)) + "\n"
    if form == "github":
        return "".join(f"{_as_github(d)}\n" for d in diagnostics)
    return "".join(f"{_colored(d) if color else d.render()}\n" for d in diagnostics)


_COLORS = {Severity.ERROR: "\x1b[31;1m", Severity.WARNING: "\x1b[33;1m", Severity.NOTE: "\x1b[36;1m"}


def _colored(diagnostic: Diagnostic) -> str:
    label = f"{diagnostic.severity.value}[{diagnostic.code}]"
    return diagnostic.render().replace(label, f"{_COLORS[diagnostic.severity]}{label}\x1b[0m", 1)


def _region(span: Span) -> dict[str, int]:
    line, column = span.source.position(span.start)
    end_line, end_column = span.source.position(max(span.start, span.end))
    return {"startLine": line, "startColumn": column, "endLine": end_line, "endColumn": end_column}


def _place(span: Span | None) -> dict[str, object]:
    return {"file": span.source.name, **_region(span)} if span else {}


def _as_json(diagnostic: Diagnostic) -> dict[str, object]:
    data: dict[str, object] = {
        "code": diagnostic.code,
        "title": CODES[diagnostic.code].title,
        "severity": diagnostic.severity.value,
        "message": "\n".join([diagnostic.message, *diagnostic.lines]),
        "hint": diagnostic.hint,
        "place": _place(diagnostic.span) or None,
    }
    data["related"] = [{"message": r.message, "place": _place(r.span) or None} for r in diagnostic.related]
    return data


def _location(span: Span) -> dict[str, object]:
    place = {"artifactLocation": {"uri": _uri(span.source.name)}, "region": _region(span)}
    return {"physicalLocation": place}


def _uri(name: str) -> str:
    """The name of a file as a reference: relative, or with a scheme where it is absolute."""
    path = Path(name)
    return path.as_uri() if path.is_absolute() else quote(os.fsencode(path.as_posix()), safe="/")


def _as_sarif(diagnostics: Sequence[Diagnostic]) -> dict[str, object]:
    codes = sorted({d.code for d in diagnostics})
    published = site() if codes else None
    return {
        "$schema": SARIF_SCHEMA,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {
                    "driver": {
                        "name": "bbtc",
                        "version": __version__,
                        "rules": [_sarif_rule(CODES[code], published) for code in codes],
                    }
                },
                "columnKind": "unicodeCodePoints",
                "results": [_sarif_result(d, codes.index(d.code)) for d in diagnostics],
            }
        ],
    }


def _sarif_rule(code: Code, published: str | None) -> dict[str, object]:
    """What is known of a code. Its page is part of it: it can be read where the pages are not at hand. Its
    address is told only where it is published: the ``helpUri`` of SARIF is absolute."""
    text = page(code.code)
    return {
        "id": code.code,
        "shortDescription": {"text": code.title},
        **({"helpUri": code.help_uri(published)} if published else {}),
        "help": {"text": text, "markdown": text},
        "defaultConfiguration": {"level": code.severity.value},
    }


def _sarif_result(diagnostic: Diagnostic, rule: int) -> dict[str, object]:
    text = diagnostic.told + (f"\nhint: {diagnostic.hint}" if diagnostic.hint else "")
    result: dict[str, object] = {
        "ruleId": diagnostic.code,
        "ruleIndex": rule,
        "level": diagnostic.severity.value,
        "message": {"text": text},
    }
    if diagnostic.span:
        result["locations"] = [_location(diagnostic.span)]
    related = [{"message": {"text": r.message}, **_location(r.span)} for r in diagnostic.related if r.span]
    if related:
        result["relatedLocations"] = related
    return result


def _as_github(diagnostic: Diagnostic) -> str:
    level = {"error": "error", "warning": "warning", "note": "notice"}[diagnostic.severity.value]
    properties = {"title": f"{diagnostic.code} {CODES[diagnostic.code].title}"}
    if diagnostic.span:
        region = _region(diagnostic.span)
        properties = {
            "file": diagnostic.span.source.name,
            "line": str(region["startLine"]),
            "col": str(region["startColumn"]),
            "endLine": str(region["endLine"]),
            "endColumn": str(region["endColumn"]),
            **properties,
        }
    text = diagnostic.told + (f"\nhint: {diagnostic.hint}" if diagnostic.hint else "")
    listed = ",".join(f"{key}={_escape(value, ':,')}" for key, value in properties.items())
    return f"::{level} {listed}::{_escape(text)}"


def _escape(text: str, more: str = "") -> str:
    """Percent-encode what would end a workflow command or one of its properties; nothing else that does not
    print is left."""
    return "".join(f"%{ord(c):02X}" if c in "%\r\n" + more else printable_line(c) for c in text)
