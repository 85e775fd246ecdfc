"""Exported trees do what the semantics page says, with actions that are not latched, too, and with
any outcomes: same actions, same end, same final state."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import pytest

from bbtc.replay.script import TIMINGS, Run, Script, Timing
from bbtc.tree.nodes import Tree
from tests.long_form import LONG, amount
from tests.replay.all_engines import ENGINES, Compared, EngineName, engine, part_for
from tests.replay.random_trees import random_tree
from tests.replay.reference import varied_runs
from tests.sharing import shared

TREES = amount(150, 1000)


@functools.cache
def lively_trees() -> list[tuple[Tree, list[tuple[Script, Run]]]]:
    """Random trees that act, each with some of its runs, worked out in one worker of a test run."""
    return shared("acting-trees", lambda: list(_lively_trees()))


def _lively_trees() -> Iterator[tuple[Tree, list[tuple[Script, Run]]]]:
    found = seed = 0
    while found < TREES:
        seed += 1
        tree = random_tree(seed, latched=0.6)
        runs = varied_runs(tree.task, tree.root, seed)
        if runs:
            found += 1
            yield tree, runs


@pytest.mark.parametrize("name", ENGINES)
def test_random_trees_run_as_in_the_reference(
    name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    with engine(name) as (version, make):
        compared = Compared(record_property, f"random trees with repeated actions: reference and {version}")
        for number, (tree, runs) in enumerate(part_for(name, lively_trees())):
            replay = make(tree, "embedded" if LONG or number % 3 == 0 else "imported")
            jobs = list(_jobs(runs, ENGINES.index(name)))
            done = replay.runs((script, timing) for script, _, timing in jobs)
            different = [row for row in zip(jobs, done, strict=True) if row[0][1] != row[1]]
            assert different == [], replay.source
            compared.add(trees=1, runs=len(jobs))


def _jobs(runs: list[tuple[Script, Run]], first: int) -> Iterator[tuple[Script, Run, Timing]]:
    """Each run with each timing; in the short form with one after the other, from some on."""
    for number, (script, expected) in enumerate(runs, first):
        for timing in TIMINGS if LONG else (TIMINGS[number % len(TIMINGS)],):
            yield script, expected, timing
