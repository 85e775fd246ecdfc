"""Setting nested forms in lines of bounded width, with the comments between them.

A :class:`Doc` is a word, or a form: an opening text, items, and a closing text. A form stands on one line
if it fits and no comment is within; else every item gets a line of its own. A comment stays between
the words it stood between, at the end of a line if it stood there, and on its own line if it did.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cached_property

from bbtc.source import Span
from bbtc.syntax.ast import Comment

WIDTH = 100
"""Longest line, in characters, where a line can be broken."""
_STEP = 2


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


@dataclass(slots=True)
class Setter:
    """Sets forms and comments."""

    comments: tuple[Comment, ...]
    _lines: list[str] = field(default_factory=list)
    _line: str = ""
    _ended: bool = False
    """The current line ends in a comment."""
    _starts: list[int] = field(default_factory=list)

    def run(self, doc: Doc) -> str:
        """The text of a form whose items are those of a whole file."""
        self._starts = [comment.span.start for comment in self.comments]
        self._items(doc, 0, 0, self._within(doc))
        self._lines.append(self._line)
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
        if not comments and not doc.always_broken and len(self._line) + len(doc.flat) + tail <= WIDTH:
            self._line += doc.flat
            return
        self._line += doc.open
        self._items(doc, indent, tail, comments)
        if self._ended:
            self._newline(indent)
        self._line += doc.close

    def _items(self, doc: Doc, indent: int, tail: int, comments: list[Comment]) -> None:
        """Write the items of a broken form, and the comments between them."""
        items = doc.items or ()
        # A form in parentheses indents its items; a field or a branch does so to their items only.
        inner = indent + _STEP if doc.close else indent
        waiting = iter(comments)
        comment = next(waiting, None)
        for number, item in enumerate(items):
            led = False
            while comment is not None and item.span is not None and comment.span.start < item.span.start:
                self._comment(comment, inner, item.spaced and not led)
                led = led or comment.own_line
                comment = next(waiting, None)
            # Skip the comments that the item itself will write.
            while comment is not None and item.span is not None and comment.span.start < item.span.end:
                comment = next(waiting, None)
            last = number == len(items) - 1
            self._place(doc, number, inner, tail + len(doc.close) if last else 0, led)
        while comment is not None:
            self._comment(comment, inner, False)
            comment = next(waiting, None)

    def _place(self, doc: Doc, number: int, indent: int, tail: int, led: bool) -> None:
        """Write one item, on the current line or on a new one."""
        items = doc.items or ()
        item = items[number]
        stays = number < doc.glued or (doc.filled and len(self._line) + 1 + len(item.flat) + tail <= WIDTH)
        first = number == 0 and not doc.open
        if (first or stays) and not self._ended:
            if not first and self._line.strip() and not self._line.endswith("("):
                self._line += " "
        else:
            apart = item.spaced or (number > 0 and items[number - 1].spaced)
            if (apart and not led) or (led and item.span is not None and _follows_empty_line(item.span)):
                self._empty_line()
            self._newline(indent)
        self._form(item, indent, tail)

    def _comment(self, comment: Comment, indent: int, spaced: bool) -> None:
        if not comment.own_line and not self._ended:
            self._line += f" {comment.text}" if self._line.strip() else comment.text
        else:
            if spaced or _follows_empty_line(comment.span):
                self._empty_line()
            self._newline(indent)
            self._line += comment.text
        self._ended = True


def _follows_empty_line(span: Span) -> bool:
    """Is the line above the one on which a span starts empty?"""
    text = span.source.text
    line = text.rfind("\n", 0, span.start)
    return line >= 0 and not text[text.rfind("\n", 0, line) + 1 : line].strip()
