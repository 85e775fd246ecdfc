"""What becomes of a command: its exit status, and a word about what went wrong with it."""

from __future__ import annotations

import io
import signal
import sys

import click

from bbtc.cli.group import cli
from bbtc.cli.output import tell
from bbtc.exit_status import ExitStatus
from bbtc.files.read_write import system_trouble
from bbtc.printable import printable
from bbtc.watch import process_started

_interrupts: list[int] = []
"""The times that Ctrl-C was heard."""


def run() -> int:
    """Run the command of the command line; its exit status. Raises ``KeyboardInterrupt``."""
    debug = "--debug" in sys.argv
    if signal.getsignal(signal.SIGINT) not in {signal.SIG_IGN, signal.SIG_DFL, None}:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        status = cli.main(standalone_mode=False, obj=process_started())
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except click.ClickException as error:
        told = io.StringIO()
        error.show(told)
        tell("\n".join(map(printable, told.getvalue().split("\n"))), nl=False)
        return error.exit_code
    except click.Abort:
        tell("interrupted")
        return ExitStatus.INTERRUPTED
    except BrokenPipeError:
        return ExitStatus.ERRORS  # the reader of our output has gone (`bbtc … | head`): not worth a message
    except Exception as error:
        if _interrupts:  # while a module of another language loaded, which made something else of it
            tell("interrupted")
            return ExitStatus.INTERRUPTED
        if debug:
            raise
        return _told(error)
    return status if isinstance(status, int) else 0


def _interrupt(_number: int, _frame: object) -> None:
    _interrupts.append(1)
    raise KeyboardInterrupt


def _told(error: Exception) -> int:
    trouble = system_trouble(error)
    if trouble is not None:
        tell(f"error[BBT0004]: cannot write: {trouble}")
        return ExitStatus.ERRORS
    tell(
        f"internal error: {type(error).__name__}: {printable(str(error))}\n"
        "This is a bug in bbtc, not in your input. Please report it with the input and the output of "
        "the same command with `bbtc --debug`."
    )
    return ExitStatus.INTERNAL
