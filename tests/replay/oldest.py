"""The oldest py_trees that exported modules run in, in a process of its own.

``make test`` installs it into ``build/py_trees-2.2``; without a network it is not there, and what
needs it is skipped.
"""

from __future__ import annotations

import atexit
import functools
import os
import pickle
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import pytest

from bbtc.replay.script import Run, Script, Timing
from bbtc.tree.nodes import Tree
from tests.replay.ticks import Tick, TickScript, trace

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDER = REPOSITORY / "build" / "py_trees-2.2"


class OldestPyTrees:
    """A process that replays trees in the oldest py_trees."""

    def __init__(self) -> None:
        path = os.pathsep.join([str(FOLDER), str(REPOSITORY)])
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.replay.oldest"],
            cwd=REPOSITORY,
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self.version: str = self.ask(("version", None))

    def ask(self, question: object) -> Any:
        """The answer to a question."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        pickle.dump(question, self._process.stdin)
        self._process.stdin.flush()
        answer = pickle.load(self._process.stdout)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def replay(self, tree: Tree, runtime: Literal["embedded", "imported"] = "embedded") -> OldestReplay:
        """A tree in it; the one before it is forgotten."""
        self.ask(("tree", (tree, runtime)))
        return OldestReplay(self)

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=60)


class OldestReplay:
    """The tree that was given last."""

    source = ""

    def __init__(self, process: OldestPyTrees) -> None:
        self._process = process

    def runs(self, jobs: Iterable[tuple[Script, Timing]]) -> list[Run]:
        """Replay many scripts."""
        found: list[Run] = self._process.ask(("runs", list(jobs)))
        return found

    def trace(self, script: TickScript) -> list[Tick]:
        """What happens in every tick of a script."""
        found: list[Tick] = self._process.ask(("trace", script))
        return found


@functools.cache
def _process() -> OldestPyTrees:
    """One for all tests: it takes as long to load as many of them."""
    process = OldestPyTrees()
    atexit.register(process.close)
    return process


@contextmanager
def oldest_py_trees() -> Iterator[OldestPyTrees]:
    """The process; skips the test where that version is not installed."""
    if not (FOLDER / "py_trees").is_dir():
        pytest.skip("no py_trees 2.2 in build/py_trees-2.2: `make build/py_trees-2.2/py_trees` puts it there")
    try:
        yield _process()
    except BaseException:
        _process.cache_clear()  # an answer may be on its way
        raise


def _answers() -> Iterator[object]:
    """The worker: questions from stdin, until it ends."""
    import py_trees
    import py_trees.version

    from bbtc.replay.engines import PyTreesReplay

    assert Path(py_trees.__file__).is_relative_to(FOLDER)
    replay: PyTreesReplay | None = None
    while True:
        try:
            kind, content = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            if kind == "version":
                yield py_trees.version.__version__
            elif kind == "tree":
                replay = PyTreesReplay(*content)
                yield None
            else:
                assert replay is not None
                yield replay.runs(content) if kind == "runs" else trace(replay, content)
        except Exception as error:  # noqa: BLE001
            yield error


if __name__ == "__main__":
    for answer in _answers():
        pickle.dump(answer, sys.stdout.buffer)
        sys.stdout.buffer.flush()
