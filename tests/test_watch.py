"""The watch over limits: it ends what does not look at the clock, and leaves alone what must not be ended."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bbtc.diagnostics import LimitReached
from bbtc.limits import Limits
from bbtc.tree.deep import FRAME_BYTES, stack_room
from bbtc.watch import process_started, watching
from tests.conftest import REPOSITORY

needs_timers = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers on this system")


def forever() -> None:
    while True:
        pass


def dream(limits: Limits) -> None:
    limits.tell("a dream")
    forever()


def hoard(kept: list[bytearray]) -> None:
    while True:
        kept.append(bytearray(b"1") * (1 << 20))
        time.sleep(0.002)


@needs_timers
def test_what_does_not_look_at_the_clock_is_ended() -> None:
    with (
        watching(Limits(seconds=0.2)) as (_, limits),
        pytest.raises(LimitReached, match=r"0\.2 s ended a dream"),
    ):
        dream(limits)


@needs_timers
def test_memory_is_watched_too() -> None:
    gc.collect()
    kept: list[bytearray] = []
    left = Limits(memory=0).memory_left
    if left is None:
        pytest.skip("the system does not tell what is taken")
    with watching(Limits(memory=-left + (50 << 20))), pytest.raises(LimitReached, match="MiB of memory"):
        hoard(kept)
    assert len(kept) < 200


@needs_timers
def test_who_swallows_a_limit_is_ended_a_second_time() -> None:
    with watching(Limits(seconds=0.1)):
        with pytest.raises(LimitReached):
            forever()
        with pytest.raises(LimitReached):
            forever()


@needs_timers
def test_nothing_is_ended_once_the_watch_is_off() -> None:
    with watching(Limits(seconds=0.1)) as (watch, _):
        watch.off()
        time.sleep(0.3)


@needs_timers
def test_the_timer_of_others_is_left_as_it_was() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with watching(Limits(seconds=60)):
        assert signal.getsignal(signal.SIGALRM) != before
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_other_threads_are_not_watched() -> None:
    found: list[BaseException] = []

    def work() -> None:
        try:
            with watching(Limits(seconds=0.01)):
                time.sleep(0.2)
        except BaseException as error:  # noqa: BLE001 - whatever it is
            found.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert not found


class _Met(os.PathLike[str]):
    """A path that a signal comes in the middle of asking for, when a limit is met."""

    def __init__(self, path: str) -> None:
        self.path, self.asked = path, 0

    def __fspath__(self) -> str:
        self.asked += 1
        with watching(Limits(seconds=0.0)) as (watch, _):
            watch.look(signal.SIGALRM, sys._getframe())
        return self.path


def test_a_process_is_started_and_a_folder_removed_whole(tmp_path: Path) -> None:
    """Else nobody would end the process, and a file might be closed twice."""
    with pytest.raises(LimitReached):
        os.fspath(_Met("true"))
    program = _Met(sys.executable)
    with subprocess.Popen([program, "-c", "pass"]) as process:
        assert process.wait() == 0
    (tmp_path / "full" / "empty").mkdir(parents=True)
    folder = _Met(str(tmp_path / "full"))
    shutil.rmtree(folder)
    assert program.asked
    assert folder.asked
    assert not (tmp_path / "full").exists()


def test_a_module_is_imported_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slowly_imported.py").write_text("import time\ntime.sleep(0.4)\nwhole = True\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with watching(Limits(seconds=0.1)):
        try:
            import slowly_imported  # type: ignore[import-not-found]
        finally:
            assert sys.modules["slowly_imported"].whole
        assert slowly_imported.whole
        with pytest.raises(LimitReached):
            forever()


def test_the_start_of_the_process_is_known() -> None:
    """A process that slept for a second before it asked."""
    if not Path("/proc/self/stat").exists():
        pytest.skip("the system does not tell")
    program = (
        "import time; time.sleep(1); from bbtc.watch import *; print(time.monotonic() - process_started())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=REPOSITORY
    )
    assert float(done.stdout) >= 1
    assert process_started() <= time.monotonic()


@pytest.fixture
def endless_input() -> Iterator[int]:
    """A pipe that somebody holds open and writes nothing to."""
    reader, writer = os.pipe()
    yield reader
    os.close(reader)
    os.close(writer)


@needs_timers
@pytest.mark.parametrize("command", ["check", "fmt", "compile", "plan"])
def test_reading_what_never_comes_ends_at_the_limit(endless_input: int, command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bbtc.cli.main", command, "-", "--time-limit", "1"],
        stdin=endless_input, capture_output=True, text=True, check=False, cwd=REPOSITORY, timeout=120,
    )  # fmt: skip
    assert done.returncode == 3, done.stderr
    assert "the time limit of 1 s ended reading" in done.stderr


# --- room on the stack -----------------------------------------------------------------------


def test_the_stack_holds_as_many_frames_as_there_is_room_for() -> None:
    """The deepest recursion allowed, of the kinds that happen: in a process of its own, which it might
    end."""
    program = """
import sys
from dataclasses import dataclass
from bbtc.tree.deep import stack_room

@dataclass(frozen=True, slots=True)
class Nested:
    part: object

def plain(): return plain()
def drawn(): return any(drawn() for _ in (1,))
def built(): return tuple([built() for _ in (1,)])
def walked():
    yield from walked()
def nested(depth):
    value = None
    for _ in range(depth):
        value = Nested((value,))
    return value

def until_the_end(call):
    try:
        call()
    except RecursionError:
        return
    raise SystemExit("no end")

before = sys.getrecursionlimit()
with stack_room():
    frames = sys.getrecursionlimit()
    for call in (plain, drawn, built, lambda: next(walked())):
        until_the_end(call)
    one, other = nested(2 * frames), nested(2 * frames)
    until_the_end(lambda: one == other)
    for _ in range(2 * frames):  # taken apart from the outside
        one, other = one.part[0], other.part[0]
assert sys.getrecursionlimit() == before
print(frames)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=REPOSITORY
    )
    assert done.returncode == 0, done.stderr
    resource = pytest.importorskip("resource")
    soft, _ = resource.getrlimit(resource.RLIMIT_STACK)
    assert int(done.stdout) * FRAME_BYTES < soft or soft == resource.RLIM_INFINITY


def test_other_threads_get_no_more_room() -> None:
    found: list[int] = []

    def look() -> None:
        with stack_room():
            found.append(sys.getrecursionlimit())

    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert found == [sys.getrecursionlimit()]
