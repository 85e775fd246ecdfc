"""Every engine that a tree is compared in, and what has been compared, for the end of the test run."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Literal, TypeAlias, TypeVar

import pytest

from bbtc.replay.engines import BtcppReplay, PyTreesReplay, Replay
from bbtc.tree.nodes import Tree
from tests.long_form import LONG
from tests.replay.oldest import OldestReplay, oldest_py_trees

T = TypeVar("T")
Runtime: TypeAlias = Literal["embedded", "imported"]
Make: TypeAlias = Callable[[Tree, Runtime], Replay | OldestReplay]
"""From a tree to the engine that runs it; the second argument is an option of the py_trees export."""

EngineName: TypeAlias = Literal["py_trees", "py_trees 2.2", "BehaviorTree.CPP"]
ENGINES: tuple[EngineName, ...] = ("py_trees", "py_trees 2.2", "BehaviorTree.CPP")


@contextmanager
def engine(name: EngineName) -> Iterator[tuple[str, Make]]:
    """The engine's name with its version, and how to make it run a tree. Skips where it is missing."""
    if name == "py_trees":
        pytest.importorskip("py_trees", reason="py_trees is not installed")
        from py_trees.version import __version__ as version

        yield f"py_trees {version}", PyTreesReplay
    elif name == "py_trees 2.2":
        with oldest_py_trees() as process:
            yield f"py_trees {process.version}", process.replay
    else:
        if importlib.util.find_spec("behaviortreepy") is None:
            pytest.skip("no wheel of behaviortreepy for this platform")
        yield "BehaviorTree.CPP 4.8.2", lambda tree, _: BtcppReplay(tree)


def part_for(name: EngineName, trees: Sequence[T]) -> Sequence[T]:
    """Those of random trees that an engine runs: in the short form the oldest py_trees has every other one,
    as the newest has the same modules."""
    return trees[::2] if name == "py_trees 2.2" and not LONG else trees


class Compared:
    """Counts what a test compares: tell it with :meth:`add`; the test run prints the sums at its end."""

    def __init__(self, record: Callable[[str, object], None], what: str) -> None:
        self._record = record
        self.what = what

    def add(self, **counts: int) -> None:
        """More has been compared."""
        for unit, number in counts.items():
            self._record("compared", (self.what, unit, number))
