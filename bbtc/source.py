"""Source files, spans in them, and the excerpt shown under a message."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

from bbtc.printable import printable_line

_EXCERPT_WIDTH = 160


@dataclass(frozen=True, slots=True)
class Reading:
    """How to read files: which of several problems is meant (by name), whether names that are declared
    nowhere are let through where planners read them (``lenient``), and whether hidden facts stay such where
    they could be done without (``keep_hidden``), so that a plan can guess them."""

    problem: str | None = None
    lenient: bool = False
    keep_hidden: bool = False


AS_WRITTEN = Reading()


@dataclass(frozen=True, slots=True, eq=False)
class SourceFile:
    """A text and the name it is shown under (a path as the user gave it, or ``<stdin>``)."""

    name: str
    text: str
    _line_starts: list[int] = field(default_factory=list, repr=False)

    @property
    def line_starts(self) -> list[int]:
        """Offset of the first character of each line (computed once, at first use)."""
        if not self._line_starts:
            starts = [0]
            find = self.text.find
            at = find("\n")
            while at >= 0:
                starts.append(at + 1)
                at = find("\n", at + 1)
            self._line_starts.extend(starts)
        return self._line_starts

    def span(self, start: int, end: int) -> Span:
        """The place from one offset to another, as far as the text goes."""
        return Span(self, min(start, len(self.text)), min(end, len(self.text)))

    def position(self, offset: int) -> tuple[int, int]:
        """1-based line and column of a character offset."""
        starts = self.line_starts
        line = bisect_right(starts, offset)
        return line, offset - starts[line - 1] + 1

    def line(self, number: int) -> str:
        """Text of a 1-based line, without its line end."""
        starts = self.line_starts
        end = starts[number] - 1 if number < len(starts) else len(self.text)
        return self.text[starts[number - 1] : end].rstrip("\r")


class Span(NamedTuple):
    """A half-open range of characters ``[start, end)`` of a source file."""

    source: SourceFile
    start: int
    end: int

    @property
    def text(self) -> str:
        """The characters the span covers."""
        return self.source.text[self.start : self.end]

    @property
    def place(self) -> str:
        """``file:line:column`` of the first character."""
        line, column = self.source.position(self.start)
        return f"{self.source.name}:{line}:{column}"

    def excerpt(self) -> str:
        """The source line and a caret line under the span (cut to its first line)."""
        line, column = self.source.position(self.start)
        text = self.source.line(line)
        length = max(1, min(self.end - self.start, len(text) - column + 1))
        first = max(0, column - 1 - _EXCERPT_WIDTH // 2) if len(text) > _EXCERPT_WIDTH else 0
        shown = text[first : first + _EXCERPT_WIDTH]
        length = min(length, max(1, len(shown) - (column - 1 - first)))
        # Tabs stay tabs in the caret line, so that it lines up whatever the tab width; other
        # control characters of a hostile file never reach the terminal.
        clean = printable_line(shown)
        pad = "".join("\t" if c == "\t" else " " for c in shown[: column - 1 - first])
        gutter = f"{line:5d} | "
        return f"{gutter}{clean}\n{' ' * (len(gutter) - 2)}| {pad}{'^' * length}"
