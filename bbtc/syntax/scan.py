"""What is seen in a text before it is parsed: comments, depth of nesting, characters that no name holds."""

from __future__ import annotations

import re
from itertools import accumulate

from bbtc.diagnostics import Diagnostic
from bbtc.source import SourceFile, Span
from bbtc.syntax.ast import Comment

_COMMENT = re.compile(r";[^\r\n]*")
_NOT_PARENTHESES = re.compile(r"[^()]+")
_PIECE = 1 << 16  # characters, after which a hostile text is looked at more closely
_STEP = {"(": 1, ")": -1}
_FOREIGN = re.compile(r"[^ \t\r\n\f\v()a-zA-Z0-9_.*+@#$%!~?:=<>/-]+")


def comments(source: SourceFile) -> tuple[Comment, ...]:
    """The comments of a file, in order."""
    text = source.text
    found = []
    for match in _COMMENT.finditer(text):
        start = match.start()
        before = text[text.rfind("\n", 0, start) + 1 : start].rpartition("\r")[2]
        content = match.group().rstrip()
        found.append(Comment(content, not before.strip(), Span(source, start, start + len(content))))
    return tuple(found)


def without_comments(text: str) -> str:
    """The text, as long as before, with spaces for comments."""
    return _COMMENT.sub(lambda match: " " * len(match.group()), text) if ";" in text else text


def too_deep(text: str, limit: int) -> int | None:
    """Offset of the first parenthesis that is nested deeper than a limit."""
    # What nearly every file passes runs without a loop in Python.
    depth = 0
    for start in range(0, len(text), _PIECE):
        parentheses = _NOT_PARENTHESES.sub("", text[start : start + _PIECE])
        if max(accumulate(map(_STEP.__getitem__, parentheses), initial=depth)) > limit:
            break
        depth += 2 * parentheses.count("(") - len(parentheses)
    else:
        return None
    depth = 0
    for match in re.finditer(r"[()]", text):
        # A closing parenthesis too many counts for nothing: it is reported elsewhere.
        depth = max(0, depth + _STEP[match.group()])
        if depth > limit:
            return match.start()
    return None


_DRAW_CODES = {"oneof": "BBT0404", "probabilistic": "BBT0403"}
_INIT = re.compile(r"\(\s*:init(?=[\s()])", re.IGNORECASE)
_MARK = re.compile(r"\(\s*(oneof|probabilistic)?(?![^\s()])|[()]", re.IGNORECASE)


def too_many_branches(text: str, source: SourceFile, most: int) -> Diagnostic | None:
    """What is said of the first draw in ``:init`` with more branches than ``most``, each in parentheses: such
    files, often of many megabytes, are refused before all of it is read."""
    for init in _INIT.finditer(text) if len(text) > 3 * most else ():
        forms: list[str] = []
        starts: list[int] = []
        branches: list[int] = []
        for mark in _MARK.finditer(text, init.start()):
            if mark.group() == ")":
                del forms[-1], starts[-1], branches[-1]
                if not forms:
                    break
                continue
            if forms:
                branches[-1] += 1
                if branches[-1] > most and forms[-1]:
                    message = f"a `{forms[-1]}` in `:init` has more than {most:,} branches"
                    hint = "worlds are listed one by one: draw facts that are independent on their own"
                    place = source.span(starts[-1], text.index(forms[-1], starts[-1]) + len(forms[-1]))
                    return Diagnostic(_DRAW_CODES[forms[-1].lower()], message, place, hint)
            forms.append(mark[1] or "")
            starts.append(mark.start())
            branches.append(0)
    return None


_MEANT = {
    **dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212", "write a plain `-`"),
    **dict.fromkeys("\u00a0\u2002\u2003\u2009\u202f\ufeff", "write a plain space"),
    ",": "spaces separate names and forms; commas do not",
}
"""What to write for characters that word processors and pages put in, and for commas."""


def foreign_characters(text: str, source: SourceFile) -> tuple[list[Diagnostic], str]:
    """The places where characters stand that the language does not use, and the text with an
    underscore for each of these."""
    faults = []
    for match in _FOREIGN.finditer(text):
        shown = repr(match.group()[:10])
        what = f"characters {shown}" if len(match.group()) > 1 else f"character {shown}"
        hint = _MEANT.get(match.group(), "names hold letters, digits and _ - . * + @ # $ % ! ~")
        faults.append(Diagnostic("BBT0104", f"{what} cannot stand here", source.span(*match.span()), hint))
    return faults, _FOREIGN.sub(lambda match: "_" * len(match.group()), text) if faults else text


def blank(text: bytearray, start: int, end: int) -> None:
    """Write spaces over everything in a range but line ends."""
    if end == start + 1 and text[start : start + 1] not in b"\r\n":
        text[start] = 0x20
        return
    text[start:end] = re.sub(rb"[^\r\n]", b" ", bytes(text[start:end]))
