"""Reading on after a syntax error: every error of a file in one run, and none that only follows from another.

1. Characters that the language does not use are reported and replaced.
2. Parentheses are balanced (:mod:`bbtc.syntax.balance`).
3. What remains is parsed; at an error, the smallest part without which the rest can be read is blanked,
   and the text is parsed again.
"""

from __future__ import annotations

import re
from typing import TypeAlias

from bbtc.diagnostics import Diagnostic, Related, Report, Severity
from bbtc.source import SourceFile
from bbtc.syntax import ast
from bbtc.syntax.balance import Balance
from bbtc.syntax.engine import Engine, Unexpected
from bbtc.syntax.hints import Form, Place, explain, keywords, open_forms
from bbtc.syntax.leaves import Misuse
from bbtc.syntax.scan import blank, foreign_characters

Parser: TypeAlias = Engine[tuple[ast.Definition, ...]]
MAX_ERRORS = 20
"""Syntax errors reported for one file."""
# All parses after the first take no more than this many characters in all.
_RECOVERY_CHARACTERS = 20_000_000
# Sections whose parts stand on their own: an error in one part leaves the others readable.
_LISTS = frozenset((":init", ":init-belief", ":predicates", ":functions", ":hidden"))
_PARENTHESIS = re.compile(r"[()]")
_WORDS = re.compile(r"\)|(?:[^\s()]+\s*)*")
_FIELD = re.compile(r"[()]|(?<![^\s()]):[a-z-]+", re.IGNORECASE | re.ASCII)


def recovered(text: str, source: SourceFile, report: Report, engine: Parser) -> tuple[ast.Definition, ...]:
    """What can be read of a text with errors (comments blanked); the errors go to the report."""
    recovery = _Recovery(text, source, engine)
    definitions = recovery.run()
    faults = sorted(recovery.faults, key=_start)
    for each in faults[:MAX_ERRORS]:
        report.add(each)
    if len(faults) >= MAX_ERRORS:
        message = f"only the first {MAX_ERRORS} syntax errors of {source.name} are shown"
        report.add(Diagnostic("BBT0101", message, severity=Severity.NOTE))
    return definitions


class _Recovery:
    """The faults of a text, gathered step by step."""

    def __init__(self, text: str, source: SourceFile, engine: Parser) -> None:
        self._source, self._engine = source, engine
        self._keywords = keywords(engine.terminals)
        self._foreign, text = foreign_characters(text, source)
        self._balance = Balance(text, source).run()
        # A quotation mark or the like may well be followed by a parenthesis that is none of the language's.
        lines = {source.position(_start(each))[0] for each in self._foreign}
        counted = [each for each in self._balance.faults if source.position(_start(each))[0] not in lines]
        self.faults = [*self._foreign, *counted]
        self._blanked: list[int] = []

    def run(self) -> tuple[ast.Definition, ...]:
        """Parse until the text has no further error, or too many."""
        source, edited = self._source, bytearray(self._balance.text, "ascii")
        work = 0
        while len(self.faults) < MAX_ERRORS and work <= _RECOVERY_CHARACTERS:
            text = edited.decode("ascii")
            work += len(text)
            try:
                return self._engine.parse(text, self._source)
            except Unexpected as error:
                place = Place(
                    source, text, error.position, self._engine.accepted(error.stack), self._keywords
                )
                found, forms = explain(place)
                start, end = self._part(place, forms)
            except Misuse as error:
                at = _start(error.diagnostic)
                found, forms = error.diagnostic, open_forms(text, at)
                start, end = self._part(Place(source, text, at, (), self._keywords), forms)
            self._note(found, text, forms)
            if not text[start:end].strip():
                break
            self._blanked.append(start)
            blank(edited, start, end)
        return ()

    def _note(self, found: Diagnostic, text: str, forms: list[Form]) -> None:
        """Keep a fault, unless it follows from one that is known."""
        if any(_start(found) <= _end(each) and _start(each) <= _end(found) for each in self._foreign):
            return
        if found.code == "BBT0111" and len(forms) > 1:
            # A part is missing, maybe because it was blanked.
            section = range(forms[1].start, _form_end(text, forms[1].start))
            if any(start in section for start in self._blanked):
                return
        if not self._left_outside(found):
            self.faults.append(found)

    def _left_outside(self, found: Diagnostic) -> bool:
        """Settle an error with what the count of parentheses showed at the end of its section.

        If a form is left outside by a parenthesis too many, that one stands right before the form.
        Any other error explains the count, which then needs no message of its own.
        """
        at = _start(found)
        before = self._balance.text[:at].rstrip()
        form = self._balance.text.startswith("(", at)
        ends = [self._balance.open_end] if self._balance.open_end else []
        for shown in (*self._balance.extras, *ends):
            known = self._balance.faults[shown.fault]
            if known not in self.faults or not shown.section <= at < shown.start:
                continue
            if known.code == "BBT0102" or not form or not before.endswith(")"):
                self.faults.remove(known)
                return False
            self.faults[self.faults.index(known)] = Diagnostic(
                known.code,
                "this parenthesis closes its form too early",
                self._source.span(len(before) - 1, len(before)),
                "remove it",
                related=(Related("this is left outside", found.span),),
            )
            return True
        return False

    def _part(self, place: Place, forms: list[Form]) -> tuple[int, int]:
        """The smallest part of a text around an error without which the rest can be read."""
        text, at = place.text, place.position
        if len(forms) < 2:
            return at, _form_end(text, at)
        section = forms[1]
        if section.word in _LISTS and len(forms) > 2:
            return forms[2].start, _form_end(text, forms[2].start)
        if section.word in _LISTS and not text.startswith(")", at):
            return at, _form_end(text, at)
        if section.field:
            word = _FIELD.match(text, at)
            known = {keyword for words in self._keywords.values() for keyword in words}
            # At a field, it is the one before that lacks its value.
            within = at - 1 if word and word.group().lower() in known else at
            return _field_around(text, within, section.start)
        # An error in `(domain name)` takes the definition with it.
        start = forms[0].start if section.word in {"domain", "problem"} else section.start
        return start, _form_end(text, start)


def _field_around(text: str, at: int, section: int) -> tuple[int, int]:
    """The field of a section in which an offset lies: from its keyword up to the next one."""
    start, depth = section, 0
    for match in _FIELD.finditer(text, section):
        mark = match.group()
        if mark == "(":
            depth += 1
        elif mark == ")":
            depth -= 1
            if not depth:
                return start, match.start()
        elif depth == 1 and match.start() <= at:
            start = match.start()
        elif depth == 1:
            return start, match.start()
    return start, len(text)


def _form_end(text: str, start: int) -> int:
    """Where the form, the words or the parenthesis that starts at an offset ends."""
    if not text.startswith("(", start):
        words = _WORDS.match(text, start)
        return words.end() if words else start + 1
    depth = 0
    for match in _PARENTHESIS.finditer(text, start):
        depth += 1 if match.group() == "(" else -1
        if not depth:
            return match.end()
    return len(text)


def _start(found: Diagnostic) -> int:
    return found.span.start if found.span else 0


def _end(found: Diagnostic) -> int:
    return found.span.end if found.span else 0
