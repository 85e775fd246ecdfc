"""``bbtc run``: every tick in a pipe; step by step, with keys, on a terminal."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pty = pytest.importorskip("pty", reason="terminals of this kind exist on Unix only")

TREE = Path(__file__).parents[1] / "golden" / "household" / "look-for-soda" / "tree.json"
COMMAND = [sys.executable, "-m", "bbtc.cli.main", "run", str(TREE)]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, check=False, timeout=60)


def test_a_run_in_a_pipe_shows_every_tick_and_how_it_ends() -> None:
    done = run("--outcomes", "1,2")
    assert done.returncode == 0
    ticks = re.findall(r"^tick \d+: .*$", done.stdout, re.MULTILINE)
    assert ticks == [
        "tick 1: luminousity_ok() = false, seen(soda) = unknown",
        "tick 2: light_on(): luminousity_ok() = true",
        "tick 3: detect(soda): seen(soda) = true",
    ]
    assert done.stdout.endswith("end: success\n")
    assert "▸ │     ├─ [detect(soda)]" in done.stdout
    assert "\x1b" not in done.stdout


def test_the_same_seed_gives_the_same_run() -> None:
    assert run("--seed", "5").stdout == run("--seed", "5").stdout
    assert len({run("--seed", str(seed)).stdout for seed in range(6)}) > 1


def test_a_run_is_cut_after_so_many_steps() -> None:
    assert "end:" not in run("--steps", "1").stdout
    assert run("--steps", "0").stdout.count("tick") == 1


@pytest.mark.parametrize("outcomes", ["7", "0", "1,x", "-1", "1,3"])
def test_an_outcome_that_is_not_there_is_wrong_usage(outcomes: str) -> None:
    done = run("--outcomes", outcomes)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "Error:" in done.stderr


class Terminal:
    """The command in a terminal of 24 lines: what it shows, and keys for it."""

    def __init__(self, *arguments: str) -> None:
        self.pid, self.fd = pty.fork()
        if not self.pid:
            env = {**os.environ, "LINES": "24", "COLUMNS": "100", "TERM": "xterm"}
            env.pop("NO_COLOR", None)
            os.execve(sys.executable, [*COMMAND, *arguments], env)

    def screen(self) -> str:
        """What stands on the screen once the command waits for a key."""
        shown = b""
        end = time.monotonic() + 60
        while b"q quit]" not in shown.rpartition(b"\x1b[2J")[2]:
            if time.monotonic() > end:
                os.kill(self.pid, signal.SIGKILL)
                pytest.fail(f"no screen within a minute, only {shown!r}")
            if select.select([self.fd], [], [], 0.2)[0]:
                shown += os.read(self.fd, 65536)
        return shown.rpartition(b"\x1b[2J")[2].decode()

    def press(self, key: str) -> str:
        os.write(self.fd, key.encode())
        return self.screen()

    def quit(self) -> int:
        os.write(self.fd, b"q")
        while True:
            try:
                if not os.read(self.fd, 65536):
                    break
            except OSError:  # the other end is closed
                break
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


def test_keys_choose_outcomes_and_step_back() -> None:
    terminal = Terminal()
    assert "tick 1:" in terminal.screen()
    assert "tick 2: light_on()" in terminal.press("1")
    failed = terminal.press("1")
    assert "tick 3: detect(soda): seen(soda) = false" in failed
    assert "\x1b[31m" in failed  # a status in red
    assert "tick 2:" in terminal.press("b")
    assert "tick 2:" in terminal.press("9")  # no such outcome: nothing happens
    won = terminal.press("2")
    assert "end: success" in won
    assert "choose one" not in won
    assert "tick 3:" in terminal.press("1")  # the run has ended
    assert "tick 1:" in terminal.press("r")
    assert terminal.quit() == 0


def test_the_screen_is_never_longer_than_the_terminal() -> None:
    terminal = Terminal("--full")
    assert len(terminal.screen().splitlines()) <= 24
    assert terminal.quit() == 0
