"""Setting nested forms in lines of bounded width, with the comments between them.

A :class:`Doc` is a word, or a form: an opening text, items, and a closing text. A form stands on one line
if it fits and no comment is within; else every item gets a line of its own. A comment stays between
the words it stood between, at the end of a line if it stood there, and on its own line if it did; where
it stood apart from the code, as comments in a column do, it keeps its column.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cached_property

from bbtc.source import Span
from bbtc.syntax.ast import Comment

WIDTH = 100
"""Longest line, in characters, where a line can be broken."""
FORM = 80
"""Longest form of several words that stands on one line, indentation not counted."""
_STEP = 2
_TAB = 8


@dataclass(frozen=True)
class Doc:
    """A word (``items`` is None) or a form."""

    open: str
    items: tuple[Doc, ...] | None = None
    close: str = ""
    span: Span | None = None
    glued: int = 0
    """How many items stay on the opening line when the form is broken."""
    filled: bool = False
    """A broken form puts as many items on a line as fit."""
    broken: bool = False
    """The form is broken even if it fits on a line."""
    spaced: bool = False
    """An empty line stands before this item and after it."""
    airy: bool = False
    """An empty line that the author put between two items stays; ``broken`` is for the caller to say."""
    rows: bool = False
    """A broken form leaves the items together that stood on one line, if they fit on one."""
    hanging: bool = False
    """Items on further lines stand below the first one, which follows the opening text."""

    @cached_property
    def flat(self) -> str:
        """The form on one line."""
        if not self.items:
            return self.open + self.close
        inner = " ".join(item.flat for item in self.items)
        space = "" if not self.open or self.open.endswith("(") else " "
        return f"{self.open}{space}{inner}{self.close}"

    @cached_property
    def always_broken(self) -> bool:
        """Is this form, or one within it, broken even if it fits?"""
        return self.broken or any(item.always_broken for item in self.items or ())


@dataclass(frozen=True, slots=True)
class _Trailing:
    """A comment behind code: on which line, how long the code is, and where the comment stood."""

    line: int
    code: int
    column: int
    apart: bool
    """It stood more than a space behind the code."""


@dataclass(slots=True)
class Setter:
    """Sets forms and comments."""

    comments: tuple[Comment, ...]
    _lines: list[str] = field(default_factory=list)
    _line: str = ""
    _ended: bool = False
    """The current line ends in a comment."""
    _starts: list[int] = field(default_factory=list)
    _trailing: list[_Trailing] = field(default_factory=list)

    def run(self, doc: Doc) -> str:
        """The text of a form whose items are those of a whole file."""
        self._starts = [comment.span.start for comment in self.comments]
        self._items(doc, 0, 0, self._within(doc))
        self._lines.append(self._line)
        self._align()
        text = "\n".join(line.rstrip() for line in self._lines).strip("\n")
        return f"{text}\n" if text else ""

    def _within(self, doc: Doc) -> list[Comment]:
        """The comments within a form, in order."""
        if not self.comments or doc.span is None:
            return []
        _, start, end = doc.span
        return list(self.comments[bisect_left(self._starts, start) : bisect_left(self._starts, end)])

    def _newline(self, indent: int) -> None:
        if self._line.strip():
            self._lines.append(self._line)
        self._line = " " * indent
        self._ended = False

    def _empty_line(self) -> None:
        if self._line.strip():
            self._lines.append(self._line)
            self._line = ""
        if self._lines and self._lines[-1]:
            self._lines.append("")

    def _form(self, doc: Doc, indent: int, tail: int) -> None:
        """Write a form at the end of the current line. ``tail`` characters follow it there."""
        if doc.items is None:
            self._line += doc.open
            return
        comments = self._within(doc)
        if not comments and not doc.always_broken and self._fits(doc, tail):
            self._line += doc.flat
            return
        self._line += doc.open
        self._items(doc, indent, tail, comments)
        if self._ended:
            self._newline(indent)
        self._line += doc.close

    def _fits(self, doc: Doc, tail: int) -> bool:
        flat = len(doc.flat)
        return len(self._line) + flat + tail <= WIDTH and (flat <= FORM or doc.filled or doc.rows)

    def _items(self, doc: Doc, indent: int, tail: int, comments: list[Comment]) -> None:
        """Write the items of a broken form, and the comments between them."""
        items = doc.items or ()
        # A form in parentheses indents its items; a field or a branch does so to their items only.
        inner = indent + _STEP if doc.close else indent
        if doc.hanging and not comments:
            inner = len(self._line) + (not doc.open.endswith("("))
        together = _rows(items, WIDTH - inner - tail - len(doc.close)) if doc.rows else frozenset()
        waiting = iter(comments)
        comment = next(waiting, None)
        anything = False
        for number, item in enumerate(items):
            led = False
            while comment is not None and item.span is not None and comment.span.start < item.span.start:
                self._comment(comment, inner, item.spaced and not led, anything)
                led, anything = led or comment.own_line, True
                comment = next(waiting, None)
            # Skip the comments that the item itself will write.
            while comment is not None and item.span is not None and comment.span.start < item.span.end:
                comment = next(waiting, None)
            last = number == len(items) - 1
            after = tail + len(doc.close) if last else 0
            on_line = number < doc.glued or number in together
            on_line = on_line or (doc.filled and len(self._line) + 1 + len(item.flat) + after <= WIDTH)
            if (on_line or (number == 0 and not doc.open)) and not self._ended:
                if self._line.strip() and not self._line.endswith("("):
                    self._line += " "
                # What ends the opening line opens the indentation in its place.
                self._form(item, indent if last and number < doc.glued else inner, after)
            else:
                apart = item.spaced or (number > 0 and items[number - 1].spaced)
                kept = (led or (doc.airy and anything)) and _follows_empty_line(item.span)
                if (apart and not led) or kept:
                    self._empty_line()
                self._newline(inner)
                self._form(item, inner, after)
            anything = True
        while comment is not None:
            self._comment(comment, inner, False, anything)
            comment, anything = next(waiting, None), True

    def _comment(self, comment: Comment, indent: int, spaced: bool, anything: bool) -> None:
        """Write a comment; ``anything``: something of its form stands before it."""
        if not comment.own_line and not self._ended:
            code = self._line.rstrip()
            if code:
                self._trailing.append(_trailing(comment, len(self._lines), len(code)))
                self._line = f"{code} {comment.text}"
            else:
                self._line += comment.text
        else:
            if spaced or (anything and _follows_empty_line(comment.span)):
                self._empty_line()
            self._newline(indent)
            self._line += comment.text
        self._ended = True

    def _align(self) -> None:
        """Give the comments their columns back: those on adjacent lines that shared one share one."""
        run: list[_Trailing] = []
        for each in [*self._trailing, None]:
            if each and run and each.line == run[-1].line + 1 and each.column == run[-1].column:
                run.append(each)
                continue
            if any(one.apart for one in run):
                texts = [self._lines[one.line][one.code + 1 :] for one in run]
                column = min(run[0].column, WIDTH - max(map(len, texts)))
                column = max(column, *(one.code + 1 for one in run))
                for one, text in zip(run, texts, strict=True):
                    self._lines[one.line] = self._lines[one.line][: one.code].ljust(column) + text
            run = [each] if each else []


def _trailing(comment: Comment, line: int, code: int) -> _Trailing:
    source, start, _ = comment.span
    before = source.text[source.text.rfind("\n", 0, start) + 1 : start]
    gap = before[len(before.rstrip()) :]
    return _Trailing(line, code, len(before.expandtabs(_TAB)), len(gap.expandtabs(_TAB)) > 1)


def _rows(items: tuple[Doc, ...], width: int) -> frozenset[int]:
    """The items that may stand on one line with the item before them, as they do in the source."""
    rows: list[list[int]] = []
    for number, item in enumerate(items):
        before = items[number - 1].span if number else None
        if before and item.span and "\n" not in item.span.source.text[before.end : item.span.start]:
            rows[-1].append(number)
        else:
            rows.append([number])
    if len(rows) == 1:
        return frozenset()
    return frozenset(
        number
        for row in rows
        if sum(len(items[number].flat) + 1 for number in row) <= width
        and not any(items[number].always_broken or len(items[number].flat) > FORM for number in row)
        for number in row[1:]
    )


def has_empty_lines(items: tuple[Doc, ...]) -> bool:
    """Did the author put an empty line between two of the items?"""
    return any(_follows_empty_line(item.span) for item in items[1:])


def _follows_empty_line(span: Span | None) -> bool:
    """Does a span stand first on its line, and below an empty one?"""
    if span is None:
        return False
    text = span.source.text
    line = text.rfind("\n", 0, span.start)
    if line < 0 or text[line : span.start].strip():
        return False
    return not text[text.rfind("\n", 0, line) + 1 : line].strip()
