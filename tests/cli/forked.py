"""Runs the program many times at little cost: in children of a process that has loaded everything."""

from __future__ import annotations

import atexit
import ctypes
import io
import json
import os
import resource
import selectors
import signal
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
LONGEST = 300  # seconds of a run; then it counts as hanging
_WORDS = "coin.pddl -q --target 0.75 -o tree.json"
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

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

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
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        wanted = [str(folder), arguments, stdin.decode("latin-1"), most_bytes, most_memory, powerless]
        self._process.stdin.write(json.dumps(wanted) + "\n")
        self._process.stdin.flush()
        status, seconds, out, err = json.loads(self._process.stdout.readline())
        return Done(status, out.encode("latin-1"), err.encode("latin-1"), seconds)


@cache
def commands() -> Commands:
    """The process, which ends with this one."""
    process = subprocess.Popen(
        [sys.executable, __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1"},
    )
    atexit.register(process.communicate)
    return Commands(process)


# --- in the process --------------------------------------------------------------------------


def _main() -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    _warm_up()
    for line in sys.stdin:
        folder, arguments, stdin, *bounds = json.loads(line)
        with tempfile.TemporaryFile() as given:
            given.write(stdin.encode("latin-1"))
            given.seek(0)
            pipes = [os.pipe(), os.pipe()]
            child = os.fork()
            if not child:
                os.dup2(given.fileno(), 0)
                for number, (_, into) in enumerate(pipes, 1):
                    os.dup2(into, number)
                _child(folder, arguments, *bounds)
        for _, into in pipes:
            os.close(into)
        told = _read([out_of for out_of, _ in pipes])
        _, status, used = os.wait4(child, 0)
        seconds = used.ru_utime + used.ru_stime
        answers.write(json.dumps([os.waitstatus_to_exitcode(status), seconds, *told]) + "\n")
        answers.flush()


def _read(pipes: list[int]) -> list[str]:
    """What is written to pipes until their ends, a character for each byte."""
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
    return [data.decode("latin-1") for data in told.values()]


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
    folder: str, arguments: list[str], most_bytes: int | None, most_memory: int | None, powerless: bool
) -> None:
    signal.alarm(LONGEST)
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
