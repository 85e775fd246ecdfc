"""Exported trees do what the semantics page says: same actions, same end, same final state."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from bbtc.tree.nodes import Tree
from tests.replay.engines import BtcppReplay, PyTreesReplay
from tests.replay.random_trees import random_tree
from tests.replay.reference import varied_runs
from tests.replay.script import TIMINGS, Run, Script

TREES = 250


def lively_trees(latched: float) -> Iterator[tuple[Tree, list[tuple[Script, Run]]]]:
    """Random trees that act, each with some of its runs."""
    found = seed = 0
    while found < TREES:
        seed += 1
        tree = random_tree(seed, latched)
        runs = varied_runs(tree.task, tree.root, seed)
        if runs:
            found += 1
            yield tree, runs


@pytest.mark.parametrize("latched", [1.0, 0.6], ids=["latched", "mixed"])
@pytest.mark.parametrize("engine", [PyTreesReplay, BtcppReplay])
def test_random_trees_run_as_in_the_reference(
    engine: type[PyTreesReplay] | type[BtcppReplay], latched: float
) -> None:
    if engine is BtcppReplay:
        pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    for tree, runs in lively_trees(latched):
        replay = engine(tree)
        for script, expected in runs:
            for timing in TIMINGS:
                assert replay.run(script, timing) == expected, (timing, script, replay.source)
