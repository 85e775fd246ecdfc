"""Runs the program many times at little cost: in children of a process that has loaded everything."""

from __future__ import annotations

import ctypes
import io
import json
import os
import resource
import signal
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
LONGEST = 60  # seconds of a run; then it counts as hanging
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
    """How a run ended; a negative status is a signal."""

    status: int
    out: str
    err: str


class Commands:
    """The process."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def run(
        self, folder: Path, *arguments: str, most_bytes: int | None = None, powerless: bool = False
    ) -> Done:
        """Run the program in a folder; ``most_bytes``: no file can be larger, as if the disk were full;
        ``powerless``: without what lets root write everywhere."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps([str(folder), arguments, most_bytes, powerless]) + "\n")
        self._process.stdin.flush()
        return Done(*json.loads(self._process.stdout.readline()))


@contextmanager
def commands() -> Iterator[Commands]:
    """The process, as long as it is wanted."""
    with subprocess.Popen(
        [sys.executable, __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1"},
    ) as process:
        yield Commands(process)
        process.kill()


# --- in the process --------------------------------------------------------------------------


def _main() -> None:
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    _warm_up()
    for line in sys.stdin:
        pipes = [os.pipe(), os.pipe()]
        child = os.fork()
        if not child:
            for number, (_, into) in enumerate(pipes, 1):
                os.dup2(into, number)
            _child(*json.loads(line))
        status = os.waitpid(child, 0)[1]
        told = []
        for out_of, into in pipes:  # which have room for all that is printed
            os.close(into)
            with os.fdopen(out_of, "rb") as stream:
                told.append(stream.read().decode(errors="replace"))
        answers.write(json.dumps([os.waitstatus_to_exitcode(status), *told]) + "\n")
        answers.flush()


def _warm_up() -> None:
    from tests.build.projects import COIN

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


def _child(folder: str, arguments: list[str], most_bytes: int | None, powerless: bool) -> None:
    signal.alarm(LONGEST)
    sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False))
    sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", closefd=False), line_buffering=True)
    os.chdir(folder)
    if most_bytes is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
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
