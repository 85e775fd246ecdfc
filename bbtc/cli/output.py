"""The line that shows progress on stderr."""

from __future__ import annotations

import shutil
import sys
import time
from dataclasses import dataclass, field

import click

from bbtc.limits import Stage

_QUIET = 1.0  # seconds until something is shown at all
_PAUSE = 0.1  # seconds between two looks


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
        return cls() if sys.stderr.isatty() else None

    def watch(self, stage: Stage) -> None:
        """Show what is being done, if it takes long and some time has passed since."""
        self.bounds = stage.bounds or self.bounds
        now = time.monotonic()
        if now - self._started >= _QUIET and now - self._shown >= _PAUSE:
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
        text = text[: shutil.get_terminal_size().columns - 1]
        click.echo(f"\r{text:{self.width}}", err=True, nl=False)
        self.width = len(text)

    def erase(self) -> None:
        """Leave the line empty."""
        if self.width:
            click.echo(f"\r{'':{self.width}}\r", err=True, nl=False)
            self.width = 0
