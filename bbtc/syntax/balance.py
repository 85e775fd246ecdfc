"""Where parentheses are missing or too many.

A missing parenthesis shows at the end of the file only, far from the mistake. But a section such as
``(:action`` stands right in a definition, and a field such as ``:effect`` right in its section: where
one of them stands deeper, something before it is not closed; where a section stands outside a definition,
something before it closes too much. The layout tells more: a parenthesis that starts a line closes what
starts with the same indentation.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import NamedTuple

from bbtc.diagnostics import Diagnostic, Related
from bbtc.source import SourceFile, Span
from bbtc.syntax.scan import blank

# A parenthesis with the word after it, or a field.
_MARK = re.compile(r"\(\s*([^\s()?]*)|\)|(?<![^\s()])(?::[a-z-]+|define(?=\s*\())", re.IGNORECASE | re.ASCII)
_INDENT = re.compile(r"[ \t]*")
MAX_FAULTS = 100
"""With more than these, the text is not PDDL with a slip."""
_SECTIONS = frozenset(
    (
        *(":requirements", ":types", ":constants", ":predicates", ":functions"),
        *(":action", ":derived", ":axiom", ":sensor", ":template", ":durative-action", ":constraints"),
        ":exogenous",
        *(":variable", ":obs-variable", ":default-sensing-model", ":observable", ":sticky"),
        *(":observables", ":observations", ":observation", ":init-belief"),
        *(":domain", ":objects", ":init", ":hidden", ":goal", ":goal-probability", ":goal-reward", ":metric"),
    )
)
_FIELDS = {
    ":action": frozenset(
        (
            *(":parameters", ":precondition", ":effect", ":repeats", ":uninterruptible"),
            *(":observe", ":sensing-model", ":observation", ":while", ":on-abort"),
            *(":duration", ":timeout", ":timeout-probability", ":on-timeout"),
        )
    ),
    ":durative-action": frozenset((":parameters", ":duration", ":condition", ":effect")),
    ":exogenous": frozenset((":parameters", ":precondition", ":effect", ":per", ":before")),
    ":observation": frozenset((":parameters", ":condition", ":distribution")),
    ":template": frozenset((":parameters", ":precondition", ":effect", ":body")),
    ":sensor": frozenset((":parameters", ":condition", ":sense", ":sensed", ":repeats")),
    ":axiom": frozenset((":parameters", ":vars", ":context", ":body", ":implies", ":head")),
}


class Opener(NamedTuple):
    """An opening parenthesis, the word after it in lower case, the white space before its line, and
    its column."""

    start: int
    word: str
    indent: str
    column: int

    @property
    def shown(self) -> str:
        """As a message names it."""
        return f"`({self.word}`"


def _under(opener: Opener, indent: str) -> bool:
    """Does an indentation line up with an opener, or with its line?"""
    return indent == opener.indent or (len(indent) == opener.column and not indent.strip(" "))


class Extra(NamedTuple):
    """A fault that may come from a mistake in a section: its number, the section's start, and where
    the fault shows."""

    fault: int
    section: int
    start: int


@dataclass(slots=True)
class Balance:
    """The unbalanced parentheses of a text, and the text with the sections that hold them blanked."""

    text: str
    source: SourceFile
    faults: list[Diagnostic] = field(default_factory=list)
    extras: list[Extra] = field(default_factory=list)
    open_end: Extra | None = None
    """The fault that the last definition is never closed, and its last section."""
    _edited: bytearray = field(default_factory=bytearray)
    _stack: list[Opener] = field(default_factory=list)
    _suspect: Opener | None = None
    _closed: Opener | None = None
    _closed_at: int = 0
    _section: int = 0
    _closed_section: Opener | None = None
    _section_end: int = 0
    _broken: bool = False
    _headless: bool = False
    _line: tuple[int, int, str] = (0, -1, "")
    """Start and end of the current line, and its indentation."""
    _surplus_run: bool = False
    """The last mark was a closing parenthesis too many."""
    _surplus: int = 0

    def run(self) -> Balance:
        """Go through the text once, in linear time."""
        text = self.text
        self._edited = bytearray(text, "ascii")
        for match in _MARK.finditer(text):
            start = match.start()
            if start > self._line[1]:
                self._line = self._line_around(start)
            if text[start] == ")":
                self._close(start)
            elif text[start] == "(":
                self._open(start, match[1].lower())
            else:
                self._word(start, match.group().lower())
            if len(self.faults) > MAX_FAULTS:
                return self
        if self._stack:
            self._end()
        self.text = self._edited.decode("ascii")
        return self

    def _line_around(self, at: int) -> tuple[int, int, str]:
        start = self.text.rfind("\n", 0, at) + 1
        end = self.text.find("\n", at)
        indent = _INDENT.match(self.text, start)
        return start, end if end >= 0 else len(self.text), indent.group() if indent else ""

    def _open(self, start: int, word: str) -> None:
        stack = self._stack
        if word == "define" and stack:
            self._unclosed(stack if len(stack) == 1 else stack[1:], start, "`(define`")
            blank(self._edited, stack[1].start if len(stack) > 1 else start, start)
            if self._edited[start - 1 : start].isspace():
                self._edited[start - 1 : start] = b")"
            else:
                blank(self._edited, stack[0].start, start)
            stack.clear()
        elif word in _SECTIONS and len(stack) > 1:
            self._misplaced_section(start, word)
        elif word in _SECTIONS and not stack and self._closed is not None:
            # Only a parenthesis too many can have closed the definition before this section.
            self._extra(self._closed_at, f"closes the definition before `({word}`")
            stack.append(self._closed)
        if len(stack) == 1:
            self._section, self._suspect, self._broken = start, None, False
        self._surplus_run = False
        stack.append(Opener(start, word, self._line[2], start - self._line[0]))

    def _misplaced_section(self, start: int, word: str) -> None:
        outer = self._stack[1]
        if outer.word.startswith(":"):
            self._unclosed(self._stack[1:], start, f"`({word}`")
            blank(self._edited, outer.start, start)
        else:
            message = f"{outer.shown} cannot stand here: a definition holds sections such as `(:action`"
            self.faults.append(
                Diagnostic(
                    "BBT0101", message, self.source.span(outer.start, outer.start + 1 + len(outer.word))
                )
            )
            blank(self._edited, outer.start, start)
            self._surplus += len(self._stack) - 1
        del self._stack[1:]

    def _word(self, start: int, word: str) -> None:
        """A keyword without a parenthesis of its own: a field, or a form that lacks it."""
        lacks = word in _SECTIONS if len(self._stack) == 1 else word == "define" and not self._stack
        if not lacks:
            self._field(start, word)
            return
        end = start + len(word)
        self.faults.append(
            Diagnostic(
                "BBT0101", f"`{word}` lacks its parenthesis", self.source.span(start, end), f"write `({word}`"
            )
        )
        if self._edited[start - 1 : start].isspace():
            self._edited[start - 1] = ord("(")
            self._open(start - 1, word)
        else:
            # At the start of the file there is no place for the parenthesis.
            self._open(start, word)
            self._headless = True

    def _field(self, start: int, word: str) -> None:
        stack, closed = self._stack, self._closed_section
        if len(stack) > 2 and word in _FIELDS.get(stack[1].word, ()):
            self._unclosed(stack[2:], start, f"`{word}`")
            self._broken = True
            del stack[2:]
        elif len(stack) == 1 and closed is not None and word in _FIELDS.get(closed.word, ()):
            self._extra(self._section_end, f"closes {closed.shown} before `{word}`")
            stack.append(closed)

    def _close(self, start: int) -> None:
        if not self._stack:
            blank(self._edited, start, start + 1)
            if self._surplus:
                self._surplus -= 1
            elif not self._surplus_run:
                self._extra(start, "closes nothing")
            self._surplus_run = True
            return
        opener = self._stack.pop()
        line, _, indent = self._line
        # Does the first parenthesis of a line stand under another opener than the one it closes?
        leads = start == line + len(indent) and opener.start < line and not _under(opener, indent)
        if leads and self._suspect is None and any(_under(outer, indent) for outer in self._stack):
            self._suspect = opener
        if len(self._stack) == 1:
            self._closed_section, self._section_end = opener, start
            if self._broken:
                blank(self._edited, opener.start, start + 1)
        elif not self._stack and opener.word == "define":
            self._closed, self._closed_at = opener, start
            if self._headless:
                blank(self._edited, opener.start, start + 1)
                self._headless = False

    def _end(self) -> None:
        stack, end = self._stack, len(self.text)
        if len(stack) > 1 or self._suspect is not None:
            group = stack[1:] or stack
            if stack[0].word == "define" and len(stack) > 1:
                blank(self._edited, stack[1].start, end)
            elif self._suspect is not None:
                blank(self._edited, self._section, end)
        else:
            group = stack
        if len(group) == 1 and group[0].word == "define" and self._suspect is None:
            self.open_end = Extra(len(self.faults), self._section, end)
        self._unclosed(group, end, "the file ends")
        if stack[0].word == "define" and not self._headless:
            self._edited += b")"
        else:
            blank(self._edited, stack[0].start, end)

    def _unclosed(self, group: list[Opener], at: int, found: str) -> None:
        place = group[-1]
        if self._suspect is not None and self._suspect.start >= self._section:
            place = self._suspect
        self._suspect = None
        open_still = Related(f"still open where {found} starts", Span(self.source, at, at + 1))
        related = (open_still,) if at < len(self.text) else ()
        end = place.start + 1 + len(place.word)
        self.faults.append(
            Diagnostic(
                "BBT0102",
                f"{place.shown} is never closed",
                self.source.span(place.start, end),
                related=related,
            )
        )

    def _extra(self, start: int, why: str) -> None:
        blank(self._edited, start, start + 1)
        self.extras.append(Extra(len(self.faults), self._section, start))
        message = f"this parenthesis {why}"
        self.faults.append(
            Diagnostic(
                "BBT0103", message, self.source.span(start, start + 1), "remove it, or open one before it"
            )
        )
