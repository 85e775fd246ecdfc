"""A watch over limits that needs nobody's help: it looks at clock and memory whatever is being done.

Long computations look at their limits themselves (:meth:`bbtc.limits.Limits.check_time`). What does not,
because it is short for all inputs but the largest, is ended by a timer of the operating system: its signal
interrupts Python code, and reading and writing, as Ctrl-C does. Only calls into libraries written in C are
waited for.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

from bbtc.limits import Limits, Stage

_PAUSE = 0.05  # seconds between two looks
_LEAST_OVERTIME = 1.0  # seconds
_OVERTIME = 0.1  # of the time limit


@dataclass(slots=True)
class Watch:
    """The limits being watched; None while nothing is. Once one is met, what is being done has some seconds
    to end by itself until it is interrupted again."""

    limits: Limits | None = None
    _doing: str = "reading the input"
    _again: float = field(default=0.0)

    def over(self, limits: Limits) -> Limits:
        """Watch these limits, in place of others; the limits to work with, which tell the watch what is
        being done."""
        self.limits, self._again = limits, 0.0
        told = limits.watcher

        def note(stage: Stage) -> None:
            self._doing = stage.doing
            if told is not None:
                told(stage)

        return replace(limits, watcher=note)

    def off(self) -> None:
        """Watch nothing: what is being done now is the last thing, and has to come to its end."""
        self.limits = None

    def look(self, _number: int, frame: FrameType | None) -> None:
        """What the timer's signal calls. Raises :class:`bbtc.diagnostics.LimitReached`."""
        limits = self.limits
        if limits is None or time.monotonic() < self._again:
            return
        if limits.met and not undivided(frame):
            self._again = time.monotonic() + max(_LEAST_OVERTIME, _OVERTIME * (limits.seconds or 0.0))
            limits = replace(limits, watcher=None)
            limits.check_time(self._doing)
            limits.check_memory(self._doing)  # which may have been looked at a moment ago


_WHOLE = {("subprocess", "__init__"), ("shutil", "rmtree")}
"""Modules and functions of Python's that start a process, and remove a folder."""


def undivided(frame: FrameType | None) -> bool:
    """Is something being done that must not be left half done? A module that is left half imported may never
    be imported again, a process that is left half started is ended by nobody, and who is interrupted while
    closing files may close them twice."""
    while frame is not None:
        code = frame.f_code
        if code.co_filename.startswith("<frozen importlib"):
            return True
        if (frame.f_globals.get("__name__"), code.co_name) in _WHOLE:
            return True
        frame = frame.f_back
    return False


@contextlib.contextmanager
def watching(limits: Limits) -> Iterator[tuple[Watch, Limits]]:
    """Watch over limits for as long as the context lasts: a :class:`bbtc.diagnostics.LimitReached` may be
    raised anywhere in it. The watch, and the limits to work with. Outside the main thread, and on systems
    without such timers, nothing is watched."""
    watch = Watch()
    told = watch.over(limits)
    bounded = limits.seconds is not None or limits.memory is not None
    main = threading.current_thread() is threading.main_thread()
    if not bounded or not main or not hasattr(signal, "setitimer"):
        yield watch, told
        return
    before: Any = signal.signal(signal.SIGALRM, watch.look)
    timer = signal.setitimer(signal.ITIMER_REAL, _PAUSE, _PAUSE)
    try:
        yield watch, told
    finally:
        watch.off()
        signal.setitimer(signal.ITIMER_REAL, *timer)
        signal.signal(signal.SIGALRM, signal.SIG_DFL if before is None else before)


def process_started() -> float:
    """The moment (of ``time.monotonic``) at which this process was started, as far as the system tells it;
    else now."""
    now = time.monotonic()
    try:
        # After the name, which may hold anything: field 22, in ticks since the machine was started.
        ticks = int(Path("/proc/self/stat").read_bytes().rpartition(b")")[2].split()[19])
        running = time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return now
    return now - running if running >= 0 else now
