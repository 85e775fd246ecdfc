"""Random trees in every engine: each scenario of the exact simulation, with effects that land between
ticks, during the run of an action and within the tick that starts it, has the same actions in the
same order, the same end, and the same final state.

Usually 192 trees with those of at most 30 scenarios each (all of three trees in four) in which all happens
that happens in any, with one timing after the other, another one in each engine; ``BBTC_LONG=1`` takes 1,000
trees and up to 500 scenarios, each with every timing.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterator, Sequence

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import Scenario, scenarios
from bbtc.limits import Limits
from bbtc.replay.script import Timing, run_of, script_of
from bbtc.tree.nodes import Tree
from tests.long_form import LONG, amount
from tests.replay.all_engines import ENGINES, Compared, EngineName, Runtime, engine, part_for
from tests.replay.covering import covering
from tests.replay.random_trees import busy_tree
from tests.replay.reference import expected_run
from tests.sharing import shared

CHUNKS = 8
TREES = amount(24, 125)
"""Trees of a chunk."""

MOST = amount(30, 500)
"""Scenarios of a tree, the most probable first."""

TIMINGS: tuple[Timing, ...] = ("between", "during", "within")


@functools.cache
def lively_trees(chunk: int) -> list[tuple[int, Tree, list[Scenario]]]:
    """Random trees that end, each with its scenarios (see above), in one of
    which at least three actions start; and a number for each. One worker of a test run finds them."""
    return shared(f"lively-trees-{chunk}", lambda: list(_lively_trees(chunk)))


def _lively_trees(chunk: int) -> Iterator[tuple[int, Tree, list[Scenario]]]:
    found = 0
    for seed in itertools.count(chunk, CHUNKS):
        tree = busy_tree(seed, starts=3)
        runs = list(itertools.islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), MOST))
        if max(len(run.steps) for run in runs) >= 3:
            yield seed, tree, runs if LONG else covering(runs)
            found += 1
        if found == TREES:
            return


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("chunk", range(CHUNKS))
def test_random_trees_run_as_simulated(
    chunk: int, name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    with engine(name) as (version, make):
        compared = Compared(record_property, f"random trees: simulator and {version}")
        for seed, tree, runs in part_for(name, lively_trees(chunk)):
            runtime: Runtime = "imported" if seed % 3 else "embedded"
            replay = make(tree, runtime)
            jobs = list(_jobs(runs, ENGINES.index(name)))
            done = replay.runs((script_of(run), timing) for run, timing in jobs)
            rows = zip(jobs, done, strict=True)
            assert [(job, ran) for job, ran in rows if ran != run_of(job[0])] == [], seed
            compared.add(trees=1, scenarios=len(runs), runs=len(jobs))


def _jobs(runs: Sequence[Scenario], first: int) -> Iterator[tuple[Scenario, Timing]]:
    """Each scenario with each timing; in the short form with one after the other, from some on."""
    for number, run in enumerate(runs, first):
        for timing in TIMINGS if LONG else (TIMINGS[number % len(TIMINGS)],):
            yield run, timing


def test_the_simulator_does_what_the_reference_says() -> None:
    for _, tree, runs in lively_trees(0):
        for run in runs:
            assert expected_run(tree.task, tree.root, script_of(run)) == run_of(run)
