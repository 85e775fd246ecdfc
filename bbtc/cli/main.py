"""The program ``bbtc``: from its first moment to its exit status, whatever happens to it.

This module imports nothing that takes time: until :func:`main` runs, Ctrl-C shows a traceback.
"""

from __future__ import annotations

import os
import sys

from bbtc.exit_status import ExitStatus

_INTERRUPTED = "interrupted"


def main() -> None:
    """Entry point of the program ``bbtc``."""
    try:
        _take_over_signals()
        _take_over_streams()
        import gc

        gc.set_threshold(10_000)  # planning makes many objects and few cycles; Python looks at every 700
        from bbtc.cli.outcome import run

        status: int = run()
    except KeyboardInterrupt:
        status = ExitStatus.INTERRUPTED
        _say(_INTERRUPTED)
    _end(status)


def _take_over_signals() -> None:
    import signal

    # Where it is something else, whoever started us wants it so.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
        sys.unraisablehook = _unraisable


def _leave(_number: int, _frame: object) -> None:
    """Ctrl-C while the program loads: there is nothing to clean up."""
    _say(_INTERRUPTED)
    os._exit(ExitStatus.INTERRUPTED)


def _unraisable(what: sys.UnraisableHookArgs) -> None:
    """Where an exception cannot be raised (in a destructor), Ctrl-C is not lost: it comes again."""
    if what.exc_type is KeyboardInterrupt:
        import _thread
        import threading

        threading.Timer(0.01, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(what)


def _take_over_streams() -> None:
    """No file that is opened may get the number of a standard stream that is closed: it would get its text,
    too. No letter may be too much for a terminal."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _say(text: str) -> None:
    """A line on stderr, if anybody can hear it."""
    import contextlib

    with contextlib.suppress(OSError):
        os.write(2, f"{text}\n".encode())


def _end(status: int) -> None:
    """Exit; what was printed is either out, or told to be lost."""
    import gc
    import signal

    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done; nothing is left to interrupt
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError as error:
            if stream is sys.stdout and not isinstance(error, BrokenPipeError):
                _say(f"error[BBT0004]: cannot write the standard output: {error.strerror}")
            if stream is sys.stdout and status == 0:
                status = ExitStatus.ERRORS
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # the interpreter flushes it again
    # A task may hold millions of objects, among which the interpreter need not look for cycles now.
    gc.freeze()
    sys.exit(status)


if __name__ == "__main__":
    main()
