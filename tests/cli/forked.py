"""Runs the program many times at little cost: in children of a process that has loaded everything.

That process listens at a socket. Who wants a command run sends it the folder, the words, the environment and
the three streams, and hears of the end. A test does so by :meth:`Commands.run`; scripts, Make and the like by
a program ``bbtc`` that :meth:`Commands.install` writes for them.
"""

from __future__ import annotations

import ast
import atexit
import ctypes
import io
import os
import resource
import selectors
import signal
import socket
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).parents[2]
LONGEST = 300  # seconds of a run; then it counts as hanging
_MOST = 1 << 20  # bytes of a request
_WORDS = "coin.pddl -q --target 0.75 -o tree.json"
_RICH = tuple(
    f"{REPOSITORY}/domains/{name}.pddl"
    for name in ("charging/domain", "charging/after-a-shift", "corridors/domain", "delivery/domain")
)
"""They say between them nearly all there is to say: what reads it is made ready when it is first met."""
_WARM_UP = (
    f"plan {_WORDS} --depfile tree.d",
    f"plan {_WORDS} --strategy policy",
    "plan coin.pddl --bounds",
    "compile coin.pddl -o task.json",
    "simulate tree.json",
    "verify tree.json --engine own",
    "diff tree.json tree.json",
    "export tree.json --to dot",
    "export tree.json --to btcpp_project -o project",
    "import tree.json",
    "fmt coin.pddl",
    "run --batch tree.json",
    "check no-such-file",
    *(f"check {file}" for file in _RICH),
    "init starter",
    "build -m bbtc.yaml",
)


@dataclass(frozen=True)
class Done:
    """How a run ended; a negative status is a signal. ``seconds`` are of processor time."""

    status: int
    stdout: bytes
    stderr: bytes
    seconds: float

    @property
    def out(self) -> str:
        """What it printed."""
        return self.stdout.decode(errors="replace")

    @property
    def err(self) -> str:
        """What it told."""
        return self.stderr.decode(errors="replace")


class Commands:
    """The process."""

    def __init__(self, address: str) -> None:
        self._address = address

    def run(
        self,
        folder: Path,
        *arguments: str,
        stdin: bytes = b"",
        most_bytes: int | None = None,
        most_memory: int | None = None,
        powerless: bool = False,
    ) -> Done:
        """Run the program in a folder; ``most_bytes``: no file can be larger, as if the disk were full;
        ``most_memory``: so many bytes of address space; ``powerless``: without what lets root write
        everywhere."""
        environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1"}
        wanted = [str(folder), arguments, environment, most_bytes, most_memory, powerless]
        with socket.socket(socket.AF_UNIX) as connection, tempfile.TemporaryFile() as given:
            connection.connect(self._address)
            given.write(stdin)
            given.seek(0)
            (out, into_out), (err, into_err) = os.pipe(), os.pipe()
            socket.send_fds(connection, [b"."], [given.fileno(), into_out, into_err])
            os.close(into_out)
            os.close(into_err)
            connection.sendall(ascii(wanted).encode())
            connection.shutdown(socket.SHUT_WR)
            stdout, stderr = _read([out, err])
            status, seconds = connection.makefile("rb").read().split()
        return Done(int(status), stdout, stderr, float(seconds))

    def install(self, file: Path, before: str = "") -> None:
        """Write a program that does what ``bbtc`` does; ``before`` is for a shell to run first."""
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(
            f"#!/bin/sh\n{before}\n"
            f'exec "{sys.executable}" -I -S "{Path(__file__).with_name("ask.py")}" "{self._address}" "$@"\n'
        )
        file.chmod(0o755)


@cache
def commands() -> Commands:
    """The process, which ends with this one."""
    folder = tempfile.TemporaryDirectory()
    address = str(Path(folder.name, "socket"))
    process = subprocess.Popen(
        [sys.executable, __file__, address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1"},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"

    def end() -> None:
        process.communicate()
        folder.cleanup()

    atexit.register(end)
    return Commands(address)


def _read(pipes: list[int]) -> list[bytes]:
    """What is written to pipes until their ends."""
    told = {pipe: bytearray() for pipe in pipes}
    with selectors.DefaultSelector() as waiting:
        for pipe in pipes:
            waiting.register(pipe, selectors.EVENT_READ)
        while waiting.get_map():
            for key, _ in waiting.select():
                piece = os.read(key.fd, 1 << 16)
                told[key.fd] += piece
                if not piece:
                    waiting.unregister(key.fd)
                    os.close(key.fd)
    return [bytes(data) for data in told.values()]


# --- in the process --------------------------------------------------------------------------


def _main() -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(sys.argv[1])
        listener.listen(16)
        ready = os.dup(1)
        os.dup2(2, 1)
        _warm_up()
        os.write(ready, b"ready\n")
        os.close(ready)
        with selectors.DefaultSelector() as waiting:
            waiting.register(0, selectors.EVENT_READ)
            waiting.register(listener, selectors.EVENT_READ)
            while True:
                ready_ones = [key.fileobj for key, _ in waiting.select(1)]
                if 0 in ready_ones:
                    return  # who started this process has ended
                if ready_ones:
                    _serve(listener)
                _bury()


def _serve(listener: socket.socket) -> None:
    connection, _ = listener.accept()
    with connection:
        if not os.fork():
            # Several may be running at once: each has a process that waits for its end.
            listener.close()
            _, streams, _, _ = socket.recv_fds(connection, 1, 3)
            request: Any = ast.literal_eval(connection.makefile("rb").read(_MOST).decode())
            child = os.fork()
            if not child:
                connection.close()
                for number, stream in enumerate(streams):
                    os.dup2(stream, number)
                    os.close(stream)
                _child(*request)
            for stream in (0, 1, 2, *streams):
                os.close(stream)
            _, status, used = os.wait4(child, 0)
            seconds = used.ru_utime + used.ru_stime
            connection.sendall(f"{os.waitstatus_to_exitcode(status)} {seconds}".encode())
            os._exit(0)


def _bury() -> None:
    """Take note of the ends of those that have waited."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass


def _warm_up() -> None:
    from tests.builder.projects import COIN

    home = Path.cwd()
    sys.stderr = io.TextIOWrapper(io.BytesIO())
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("coin.pddl").write_text(COIN)
        Path("bbtc.yaml").write_text("trees: {c: {domain: coin.pddl, target: 0.5, exports: [dot]}}\n")
        for words in _WARM_UP:
            sys.stdout = io.TextIOWrapper(io.BytesIO())
            _run(words.split())
        os.chdir(home)
    sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__


def _run(arguments: list[str]) -> int:
    from bbtc.cli.outcome import run

    sys.argv = ["bbtc", *arguments]
    return run()


def _child(
    folder: str,
    arguments: list[str],
    environment: dict[str, str],
    most_bytes: int | None,
    most_memory: int | None,
    powerless: bool,
) -> None:
    signal.alarm(LONGEST)
    os.environ.clear()
    os.environ.update(environment)
    sys.stdin = io.TextIOWrapper(os.fdopen(0, "rb", closefd=False))
    sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False))
    sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", closefd=False), line_buffering=True)
    os.chdir(folder)
    for what, most in ((resource.RLIMIT_FSIZE, most_bytes), (resource.RLIMIT_AS, most_memory)):
        if most is not None:
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
    if powerless:
        _give_up_capabilities()
    from bbtc.cli.main import main

    sys.argv = ["bbtc", *arguments]
    status: object = 99
    try:
        main()
    except SystemExit as ended:
        status = ended.code
    except BaseException:  # noqa: BLE001 - told to who asked
        import traceback

        traceback.print_exc()
    os._exit(status if isinstance(status, int) else 98)


def _give_up_capabilities() -> None:
    """Let permissions hold for root, too (capset of Linux, with all sets empty)."""
    header, data = struct.pack("Ii", 0x20080522, 0), bytes(24)
    if os.geteuid() == 0 and ctypes.CDLL(None).capset(header, data) != 0:
        os._exit(97)


if __name__ == "__main__":
    sys.path.insert(0, str(REPOSITORY))
    _main()
