"""A process that does jobs: pickled jobs on its standard input, pickled results on its standard output.

It ends when its input ends, in the middle of a job too, so that none outlives a build that was killed.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import sys
import threading
from typing import BinaryIO

from bbtc.builder.job import Job, Made, broken, perform

_INTERRUPTED = "it was interrupted"


def main() -> None:
    """Do jobs until there are no more."""
    # Ctrl-C goes to all processes of a terminal; the one that started this one decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    results = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a plugin prints must not get between
    jobs: queue.SimpleQueue[Job] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, jobs), daemon=True).start()
    while True:
        job = jobs.get()
        try:
            made = perform(job)
        except KeyboardInterrupt:
            made = broken(job.entry.name, _INTERRUPTED)
        pickle.dump(_sendable(made), results)
        results.flush()


def _receive(stream: BinaryIO, jobs: queue.SimpleQueue[Job]) -> None:
    try:
        while True:
            jobs.put(pickle.load(stream))  # noqa: S301 - from the process that started this one
    except (EOFError, OSError, pickle.UnpicklingError):
        os._exit(0)


def _sendable(made: Made) -> Made:
    """The result, if it can be sent; what a plugin put into it might not."""
    try:
        pickle.dumps(made)
    except Exception as error:  # noqa: BLE001 - whatever a stranger's object raises
        return broken(made.name, f"{type(error).__name__}: {error}")
    return made


if __name__ == "__main__":
    main()
