"""Standard streams that are closed, full, or too poor for a letter, and Ctrl-C at any moment: no traceback,
no talk of a bug, the documented status."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.builder.projects import COIN, REPOSITORY
from tests.long_form import LONG

BBTC = f"{shlex.quote(sys.executable)} -m bbtc.cli.main"
needs_full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("streams")
    (made / "coin.pddl").write_text(COIN)
    for command in ("plan coin.pddl -q --target 0.5 -o coin.json", "compile coin.pddl -o task.json"):
        assert sh(made, f"{BBTC} {command}").returncode == 0
    for name in ("coin", "task"):  # names that only artefacts can hold
        text = (made / f"{name}.json").read_text()
        (made / f"letters-{name}.json").write_text(text.replace("heads", "köpfe"))
    return made


def sh(folder: Path, command: str, **env: str) -> subprocess.CompletedProcess[str]:
    """Run a shell's command; nothing it says may be of the wrong kind."""
    done = subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "NO_COLOR": "1", **env},
    )
    assert "Traceback" not in done.stderr + done.stdout
    assert "bug in bbtc" not in done.stderr
    assert "Exception ignored" not in done.stderr
    return done


TO_STDOUT = ("simulate coin.json", "compile coin.pddl", "run --batch coin.json", "explain BBT0001")


@needs_full
@pytest.mark.parametrize("command", [*TO_STDOUT, "--help", "export --list"])
def test_a_full_stdout_is_an_error(folder: Path, command: str) -> None:
    done = sh(folder, f"{BBTC} {command} >/dev/full")
    assert done.returncode == 1
    assert "error[BBT0004]: cannot write" in done.stderr
    assert "No space left on device" in done.stderr


@pytest.mark.parametrize("command", TO_STDOUT)
def test_a_closed_stdout_is_an_error_where_something_was_to_be_written(folder: Path, command: str) -> None:
    done = sh(folder, f"{BBTC} {command} >&-")
    assert done.returncode == 1
    assert "error[BBT0004]: cannot write the standard output: it is closed" in done.stderr


@pytest.mark.parametrize("target", ["2>&-", pytest.param("2>/dev/full", marks=needs_full)])
@pytest.mark.parametrize(
    ("command", "status"),
    [("plan coin.pddl --target 0.5 -o made.json", 0), ("check no-such-file", 1), ("nonsense", 2)],
)
def test_who_cannot_hear_messages_gets_the_result_and_the_status(
    folder: Path, command: str, status: int, target: str
) -> None:
    (folder / "made.json").unlink(missing_ok=True)
    assert sh(folder, f"{BBTC} {command} {target}").returncode == status
    assert (folder / "made.json").exists() == command.startswith("plan")


def test_no_file_takes_the_number_of_a_closed_stream(folder: Path) -> None:
    """What goes to stderr would go into it."""
    done = sh(folder, f"{BBTC} plan coin.pddl --target 0.5 -o clean.json --depfile clean.d <&- >&- 2>&-")
    assert done.returncode == 0
    assert (folder / "clean.d").read_text() == "clean.json: coin.pddl\n"


def test_a_closed_stdin_cannot_be_read(folder: Path) -> None:
    done = sh(folder, f"{BBTC} check - <&-")
    assert (done.returncode, done.stderr) == (1, "error[BBT0001]: cannot read <stdin>: it is closed\n")


def test_a_reader_that_has_gone_is_no_reason_for_words(folder: Path) -> None:
    assert sh(folder, f"{BBTC} run --batch coin.json | true").stderr == ""


@pytest.mark.parametrize("encoding", ["ascii", "cp1252:strict"])
def test_a_terminal_that_cannot_show_a_letter_shows_something_else(folder: Path, encoding: str) -> None:
    for command, status in (
        ("run --batch letters-coin.json", 0),
        ("simulate letters-coin.json", 0),
        ("plan letters-task.json --target 0.5", 0),
        ("check köpfe", 1),
    ):
        assert sh(folder, f"{BBTC} {command}", PYTHONIOENCODING=encoding).returncode == status


# --- Ctrl-C ----------------------------------------------------------------------------------

# The nth module that is looked for brings the signal, from the first that the program needs to the last.
_INTERRUPTED = """
import os, signal, sys
class Watch:
    left = int(sys.argv.pop(1))
    def find_spec(self, name, path=None, target=None):
        Watch.left -= 1
        if Watch.left == 0:
            os.kill(os.getpid(), signal.SIGINT)
from bbtc.cli.main import main
sys.meta_path.insert(0, Watch())
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("moment", range(1, 700, 1 if LONG else 100))
def test_ctrl_c_while_modules_load_is_status_130(folder: Path, moment: int) -> None:
    command = [sys.executable, "-c", _INTERRUPTED, str(moment), "plan", "coin.pddl", "--target", "0.5"]
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler) and None,
    )
    assert done.returncode in ((130,) if moment < 200 else (0, 130)), done.stderr
    assert "Traceback" not in done.stderr
    assert "KeyboardInterrupt" not in done.stderr
    assert "bug in bbtc" not in done.stderr
