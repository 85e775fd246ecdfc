"""Diagnostics: messages with a stable code, a place and a hint, collected and raised together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import cast

from bbtc.codes import CODES, Severity, exit_status
from bbtc.exit_status import ExitStatus
from bbtc.printable import printable, printable_line
from bbtc.source import Span

__all__ = ["BbtcError", "Diagnostic", "LimitReached", "Related", "Report", "Severity", "Unreadable"]

_OF_CODE = cast("Severity", None)


@dataclass(frozen=True, slots=True)
class Related:
    """A second place that explains a diagnostic (the declaration it clashes with)."""

    message: str
    span: Span | None


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One message. ``code`` is a key of :data:`bbtc.codes.CODES`. ``message`` and ``hint`` are one line each;
    ``lines`` are those of a file, or of a difference, that are shown below the message. ``severity`` is that
    of the code unless a lesser one is given. ``about`` are the names that tell it from others of its code in
    its place; ``path`` leads to its place in a tree or an artefact as long as no text has it."""

    code: str
    message: str
    span: Span | None = None
    hint: str | None = None
    severity: Severity = _OF_CODE
    related: tuple[Related, ...] = ()
    lines: tuple[str, ...] = ()
    about: tuple[str, ...] = ()
    path: tuple[str | int, ...] = ()

    def __post_init__(self) -> None:
        if self.code not in CODES:
            raise ValueError(f"undocumented diagnostic code {self.code}")
        gravest = CODES[self.code].severity
        if cast("Severity | None", self.severity) is None:
            object.__setattr__(self, "severity", gravest)
        elif self.severity.rank < gravest.rank:
            raise ValueError(f"{self.code} is no {self.severity.value}")

    @property
    def told(self) -> str:
        """The message with its lines. Nothing in it steers a terminal, whatever names it cites."""
        return "\n".join([printable(self.message), *map(printable_line, self.lines)])

    def render(self) -> str:
        """The message as text: place, severity, code, excerpt with caret, hint."""
        head = f"{self.severity.value}[{self.code}]: {self.told}"
        lines = [f"{printable(self.span.place)}: {head}" if self.span else head]
        if self.span:
            lines.append(self.span.excerpt())
        for related in self.related:
            place = f"{related.span.place}: " if related.span else ""
            lines.append(printable(f"  note: {place}{related.message}"))
        if self.hint:
            lines.append(printable(f"  hint: {self.hint}"))
        return "\n".join(lines)


@dataclass(slots=True)
class Report:
    """Collects the diagnostics of a run: root causes first, then in source order within a file."""

    _recorded: dict[Diagnostic, None] = field(default_factory=dict)

    def error(
        self,
        code: str,
        message: str,
        span: Span | None = None,
        hint: str | None = None,
        related: Iterable[Related] = (),
    ) -> None:
        """Record an error."""
        self.add(Diagnostic(code, message, span, hint, Severity.ERROR, tuple(related)))

    def warning(
        self,
        code: str,
        message: str,
        span: Span | None = None,
        hint: str | None = None,
        related: Iterable[Related] = (),
    ) -> None:
        """Record a warning."""
        self.add(Diagnostic(code, message, span, hint, Severity.WARNING, tuple(related)))

    def add(self, diagnostic: Diagnostic) -> None:
        """Record a diagnostic unless the very same one stands already."""
        self._recorded.setdefault(diagnostic)

    def retract(self, code: str, within: Span) -> None:
        """Take back what was recorded under the code about places within another: something else tells it."""
        self._recorded = {
            each: None
            for each in self._recorded
            if each.code != code
            or each.span is None
            or each.span.source is not within.source
            or not within.start <= each.span.start < within.end
        }

    @property
    def errors(self) -> list[Diagnostic]:
        """The diagnostics that stop a command."""
        return [d for d in self._recorded if d.severity is Severity.ERROR]

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(sorted(self._recorded, key=_place_key))

    def raise_errors(self) -> None:
        """Raise :class:`BbtcError` with everything recorded, if any of it is an error."""
        if self.errors:
            raise BbtcError(tuple(self))


def _place_key(diagnostic: Diagnostic) -> tuple[bool, str, int]:
    span, follows = diagnostic.span, not CODES[diagnostic.code].root_cause
    return (follows, span.source.name, span.start) if span else (follows, "", -1)


class BbtcError(Exception):
    """The input cannot be processed; carries every diagnostic of the run."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(d.render() for d in self.diagnostics))

    def __reduce__(self) -> tuple[type[BbtcError], tuple[object, ...]]:
        return type(self), (self.diagnostics,)  # else a pickle would hold the text alone

    @classmethod
    def single(cls, code: str, message: str, span: Span | None = None, hint: str | None = None) -> BbtcError:
        """An error of one diagnostic."""
        return cls([Diagnostic(code, message, span, hint)])

    @property
    def exit_status(self) -> ExitStatus:
        """What a command ends with that this stops."""
        errors = [each.code for each in self.diagnostics if each.severity is Severity.ERROR]
        return exit_status(errors) or ExitStatus.ERRORS


class Unreadable(Exception):
    """A part of an input cannot be read. What reads the whole takes note of it, and reads on."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        self.diagnostic = diagnostic
        super().__init__(diagnostic.message)


class LimitReached(BbtcError):
    """A limit (time, states, nodes, memory) stopped the work."""
