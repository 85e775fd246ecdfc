"""Fixtures shared by all tests: golden files, and the input collections beside the repository."""

from __future__ import annotations

import difflib
import gc
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests import profiles as _profiles  # noqa: F401 - loads one
from tests.sharing import share_in

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As in a shell's background job. Processes inherit it, and those that tests start shall hear Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)

REPOSITORY = Path(__file__).resolve().parent.parent
GOLDEN = Path(__file__).resolve().parent / "golden"

# Beside all that tests and Hypothesis hold, looking for cycles at every 700 new objects takes its time, and
# to look through everything, millions of objects in the end, seconds.
gc.set_threshold(20_000, 10, 1_000)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden",
        action="store_true",
        help="write the golden files that are missing or differ, instead of failing",
    )


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish() -> None:
    """Nobody needs to look for cycles in all that was made, when the process ends."""
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the sums of what tests say with ``record_property("compared", (what, unit, number))``."""
    sums: dict[str, dict[str, int]] = {}
    for report in terminalreporter.getreports("passed"):
        for name, value in report.user_properties:
            if name == "compared" and isinstance(value, list | tuple):
                what, unit, number = value
                units = sums.setdefault(str(what), {})
                units[str(unit)] = units.get(str(unit), 0) + int(str(number))
    if sums:
        terminalreporter.section("compared, without a difference")
    for what, units in sorted(sums.items()):
        counted = ", ".join(f"{number:,} {unit}" for unit, number in units.items())
        terminalreporter.write_line(f"{what}: {counted}")


@dataclass(frozen=True)
class Golden:
    """Compares artefacts with the files under ``tests/golden/``."""

    update: bool

    def __call__(self, path: str, actual: str | bytes) -> None:
        """Fail unless ``actual`` is, byte for byte, the content of ``tests/golden/<path>``."""
        file = GOLDEN / path
        data = actual.encode() if isinstance(actual, str) else actual
        expected = file.read_bytes() if file.exists() else None
        if data == expected:
            return
        if self.update:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        elif expected is None:
            pytest.fail(f"no golden file tests/golden/{path}; run with --update-golden and read it", False)
        else:
            pytest.fail(_drift(path, expected, data), pytrace=False)


def _drift(path: str, expected: bytes, actual: bytes) -> str:
    try:
        lines = expected.decode().splitlines(True), actual.decode().splitlines(True)
    except UnicodeDecodeError:
        return f"tests/golden/{path} differs (binary)"
    diff = list(difflib.unified_diff(*lines, f"golden/{path}", "now"))
    shown = "".join(line if line.endswith("\n") else f"{line}\n" for line in diff[:200])
    rest = f"… {len(diff) - 200} more lines\n" if len(diff) > 200 else ""
    return f"tests/golden/{path} drifted (--update-golden accepts it):\n{shown}{rest}"


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Golden:
    """Call it with a path under ``tests/golden/`` and the text or bytes that should stand there."""
    return Golden(bool(request.config.getoption("--update-golden")))


@pytest.fixture(scope="session", autouse=True)
def _sharing(tmp_path_factory: pytest.TempPathFactory) -> None:
    if "PYTEST_XDIST_WORKER" in os.environ:  # else the folder above is that of every test run
        share_in(tmp_path_factory.getbasetemp().parent)


@pytest.fixture(scope="session")
def repository() -> Path:
    """The top of this repository."""
    return REPOSITORY


def corpus_folder() -> Path | None:
    """The corpus of public planning files: ``$BBTC_CORPUS``, or ``corpus`` in the shared folder."""
    named = os.environ.get("BBTC_CORPUS")
    folder = Path(named) if named else REPOSITORY.parent / "shared" / "corpus"
    return folder if folder.is_dir() else None


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The corpus; skips the test where it is absent."""
    folder = corpus_folder()
    if folder is None:
        pytest.skip("no corpus: set BBTC_CORPUS, or put it at ../shared/corpus")
    return folder
