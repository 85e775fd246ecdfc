"""Doing jobs in several processes at once."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path

from bbtc.builder.job import Job, Made, broken, perform

_START = "from bbtc.builder.worker import main; main()"


def processors() -> int:
    """How many jobs this process may do at once."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0)) or 1
    return os.cpu_count() or 1


def do_all(jobs: Sequence[Job], at_once: int) -> Iterator[Made]:
    """The results, in the order in which they are ready. With one job at a time, or one job, it is done in
    this process. A process that dies costs its job, no other. Raises ``KeyboardInterrupt``."""
    at_once = min(at_once, len(jobs))
    if at_once <= 1:
        yield from map(_perform_here, jobs)
        return
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    ready: queue.SimpleQueue[Made | BaseException] = queue.SimpleQueue()
    for job in jobs:
        waiting.put(job)
    workers = [_Worker() for _ in range(at_once)]
    try:
        for worker in workers:
            threading.Thread(target=worker.serve, args=(waiting, ready), daemon=True).start()
        for _ in jobs:
            made = ready.get()
            if isinstance(made, BaseException):
                raise made
            yield made
    finally:
        for worker in workers:
            worker.end()


def _perform_here(job: Job) -> Made:
    with _interrupted_at_once():
        return perform(job)


class _Interrupted(BaseException):
    """What Ctrl-C raises in place of ``KeyboardInterrupt``, which planners take as a wish for the best tree
    so far; a build has no use for that."""


@contextlib.contextmanager
def _interrupted_at_once() -> Iterator[None]:
    def stop(_number: int, _frame: object) -> None:
        raise _Interrupted

    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN  # by whoever started us
    if ignored or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    except _Interrupted:
        raise KeyboardInterrupt from None
    finally:
        signal.signal(signal.SIGINT, before)


class _Worker:
    """A process, and the thread that gives it jobs."""

    def __init__(self) -> None:
        self._ended = False
        self._process = self._start()

    @staticmethod
    def _start() -> subprocess.Popen[bytes]:
        # Its modules are found where ours were; its folder holds none that could take their place.
        paths = os.pathsep.join(str(Path(path).absolute()) for path in sys.path if path)
        return subprocess.Popen(  # noqa: S603 - this Python, and a fixed program
            [sys.executable, "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=Path(os.sep).absolute(),
            env={**os.environ, "PYTHONPATH": paths},
        )

    def serve(self, waiting: queue.SimpleQueue[Job], ready: queue.SimpleQueue[Made | BaseException]) -> None:
        """Do jobs until there are no more."""
        try:
            while not self._ended:
                try:
                    job = waiting.get_nowait()
                except queue.Empty:
                    return
                ready.put(self._do(job))
        except BaseException as error:  # noqa: BLE001 - the thread that waits must hear of it
            ready.put(error)

    def _do(self, job: Job) -> Made:
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        try:
            pickle.dump(job, stdin)
            stdin.flush()
            made = pickle.load(stdout)  # noqa: S301 - from a process of our own
        except (EOFError, OSError, pickle.UnpicklingError):
            status = self._process.wait()
            if not self._ended:
                self._process = self._start()
            return broken(job.entry.name, f"the process that built it ended with status {status}")
        assert isinstance(made, Made)
        return made

    def end(self) -> None:
        """End the process, whatever it is doing."""
        self._ended = True
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
