"""What goes to stderr: messages, and the line that shows progress."""

from __future__ import annotations

import contextlib
import shutil
import sys
import time
from dataclasses import dataclass, field
from typing import TextIO

import click

from bbtc.files.read_write import cannot_write
from bbtc.limits import Stage
from bbtc.printable import printable


def tell(text: str, *, nl: bool = True, color: bool | None = None) -> None:
    """Write to stderr. If nobody can hear it (it is closed, or its device is full), the work goes on, and its
    exit status tells how it went."""
    with contextlib.suppress(OSError):
        click.echo(text, err=True, nl=nl, color=color)


def show(text: str = "", *, nl: bool = True, color: bool | None = None) -> None:
    """Write to stdout. Raises :class:`BbtcError` where it is closed, and ``OSError``."""
    if sys.stdout is None:
        raise cannot_write("the standard output", "it is closed")
    click.echo(text, nl=nl, color=color)


def on_terminal(stream: TextIO | None) -> bool:
    """Is a standard stream, which may be closed, a terminal?"""
    return stream is not None and stream.isatty()


QUIET = 1.0
"""Seconds until something is shown at all."""

PAUSE = 0.1
"""Seconds between two looks."""


@dataclass(slots=True)
class ProgressLine:
    """One line on stderr, rewritten in place while something takes long; for terminals only. It uses
    no colors, and is erased before anything else is written there."""

    width: int = 0
    bounds: tuple[float, float] | None = None
    _started: float = field(default_factory=time.monotonic)
    _shown: float = field(default=0.0)

    @classmethod
    def on_terminal(cls) -> ProgressLine | None:
        """The line, or None if stderr is no terminal."""
        return cls() if on_terminal(sys.stderr) else None

    def watch(self, stage: Stage) -> None:
        """Show what is being done, if it takes long and some time has passed since."""
        self.bounds = stage.bounds or self.bounds
        now = time.monotonic()
        if now - self._started >= QUIET and now - self._shown >= PAUSE:
            self._shown = now
            self.show(self._text(stage, now - self._started))

    def _text(self, stage: Stage, seconds: float) -> str:
        parts = [stage.doing]
        if stage.states is not None:
            parts.append(f"{stage.states:,} states")
        if self.bounds is not None:
            parts.append(f"best probability between {self.bounds[0]:.4g} and {self.bounds[1]:.4g}")
        return ", ".join([*parts, f"{seconds:.0f} s"])

    def show(self, text: str) -> None:
        """Put a text in the place of what is shown."""
        text = printable(text)[: shutil.get_terminal_size().columns - 1]
        tell(f"\r{text:{self.width}}", nl=False)
        self.width = len(text)

    def erase(self) -> None:
        """Leave the line empty."""
        if self.width:
            tell(f"\r{'':{self.width}}\r", nl=False)
            self.width = 0
