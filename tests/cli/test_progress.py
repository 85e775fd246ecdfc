"""Progress on stderr: on a terminal only, gone at the end, never in the way of other output."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bbtc.cli import output
from bbtc.cli.output import ProgressLine
from bbtc.limits import Stage
from tests.conftest import REPOSITORY
from tests.planner.test_bounds import coins

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")

# The program, with progress shown from the start and at every look.
_EAGER = (
    "import bbtc.cli.output as output; output.QUIET = output.PAUSE = 0.0\n"
    "from bbtc.cli.main import main; main()"
)


@pytest.fixture
def problem(tmp_path: Path) -> str:
    file = tmp_path / "coins.pddl"
    file.write_text(coins(8))
    return str(file)


def on_terminal(*arguments: str, **environment: str) -> tuple[str, str]:
    """What the program writes to stderr, a terminal, and to stdout, a pipe."""
    import pty

    master, slave = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", _EAGER, *arguments],
        stdout=subprocess.PIPE,
        stderr=slave,
        cwd=REPOSITORY,
        env={**os.environ, "COLUMNS": "80", **environment},
    ) as run:
        os.close(slave)
        shown = bytearray()
        while True:
            try:
                piece = os.read(master, 4096)
            except OSError:  # closed by the program's end
                break
            if not piece:
                break
            shown += piece
        assert run.stdout is not None
        written = run.stdout.read().decode()
    os.close(master)
    return shown.decode(), written


def screen(shown: str) -> list[str]:
    """The lines that remain on a terminal after everything was shown."""
    lines = []
    for line in shown.replace("\r\n", "\n").split("\n"):
        left = ""
        for part in line.split("\r"):
            left = part + left[len(part) :]
        lines.append(left.rstrip())
    return [line for line in lines if line]


def test_a_terminal_shows_what_is_done_and_keeps_only_the_messages(problem: str) -> None:
    shown, written = on_terminal("plan", problem, "--bounds")
    assert "exploration, " in shown
    assert " states, " in shown
    assert screen(shown) == []
    assert written.startswith("coins/all: goal ")


def test_bounds_close_before_the_eyes(problem: str) -> None:
    shown, _ = on_terminal("plan", problem, "--bounds", "--max-states", "100")
    assert "best probability between 0 and " in shown
    assert screen(shown) == []


def test_messages_stand_on_lines_of_their_own(tmp_path: Path) -> None:
    file = tmp_path / "coins.pddl"
    file.write_text(coins(4))
    problem = str(file)
    shown, _ = on_terminal("plan", problem, "--strategy", "policy", "--target", "0.01", "-o", os.devnull)
    piped = subprocess.run(
        [sys.executable, "-c", _EAGER, "plan", problem, "--strategy", "policy", "--target", "0.01"],
        capture_output=True, text=True, check=True, cwd=REPOSITORY,
    )  # fmt: skip
    assert "\r" in shown.replace("\r\n", "")
    assert screen(shown) == piped.stderr.splitlines()


def test_no_terminal_no_progress(problem: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _EAGER, "plan", problem, "--bounds"],
        capture_output=True, text=True, check=False, cwd=REPOSITORY,
    )  # fmt: skip
    assert done.stderr == ""


def test_machines_get_no_progress_even_on_a_terminal(problem: str) -> None:
    shown, _ = on_terminal("plan", problem, "--bounds", "--format", "json")
    assert shown.strip() == "[]"


def test_progress_uses_no_escape_sequences(problem: str) -> None:
    for environment in ({}, {"NO_COLOR": "1"}):
        shown, _ = on_terminal("plan", problem, "--bounds", **environment)
        assert "\x1b" not in shown


def test_a_short_run_shows_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ProgressLine()
    line.watch(Stage("exploration", 256))
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(output, "QUIET", 0.0)
    line.watch(Stage("exploration", 12_345, (0.25, 1.0)))
    line.watch(Stage("exploration", 12_346))
    assert capsys.readouterr().err == "\rexploration, 12,345 states, best probability between 0.25 and 1, 0 s"
    line.erase()
    line.erase()
    assert capsys.readouterr().err.strip("\r") == " " * 68
