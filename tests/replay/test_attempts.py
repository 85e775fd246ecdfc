"""Retry-until-success: random trees with it do in every engine, tick by tick, what the semantics page says,
and the simulator does, too."""

from __future__ import annotations

import functools
import itertools
import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.limits import Limits
from bbtc.replay.script import Run, Script, run_of, script_of
from bbtc.tree.nodes import Tree
from tests.long_form import amount
from tests.replay.all_engines import ENGINES, Compared, EngineName, Runtime, engine
from tests.replay.random_trees import busy_tree, with_attempts
from tests.replay.reference import expected_run, expected_ticks, varied_runs
from tests.replay.ticks import random_script, trace
from tests.sharing import shared

TREES = amount(45, 1000)
SIMULATED = amount(140, 2000)
SCENARIOS = 20


class Tried(NamedTuple):
    """A tree, the number that it was drawn by, and some of its runs."""

    seed: int
    tree: Tree
    runs: list[tuple[Script, Run]]


@functools.cache
def trying_trees() -> list[Tried]:
    """Random trees with retry-until-success nodes, below which attempts fail and are made again, found in one
    worker of a test run."""
    return shared("trying-trees", lambda: list(itertools.islice(_trying_trees(), SIMULATED)))


def _trying_trees() -> Iterator[Tried]:
    for seed in itertools.count():
        tree = with_attempts(busy_tree(seed, starts=3, endless=seed % 2 == 1), seed)
        runs = varied_runs(tree.task, tree.root, seed)
        if len(runs) > 2:
            yield Tried(seed, tree, runs)


@pytest.mark.parametrize("name", ENGINES)
def test_random_trees_with_attempts_run_as_the_page_says(
    name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    with engine(name) as (version, make):
        compared = Compared(record_property, f"trees with attempts: reference and {version}")
        for seed, tree, runs in trying_trees()[:TREES]:
            runtime: Runtime = "imported" if seed % 3 else "embedded"
            replay = make(tree, runtime)
            # Other timings: a node that begins anew may give up what runs, whose outcome lands all the same.
            done = replay.runs((script, "within") for script, _ in runs)
            assert done == [expected for _, expected in runs], seed
            rng = random.Random(seed)
            for _ in range(6):
                script = random_script(tree.task, rng, 12)
                assert trace(replay, script) == expected_ticks(tree.task, tree.root, script), seed
            compared.add(trees=1, runs=len(runs), ticks=72)


def test_the_simulator_runs_them_as_the_page_says() -> None:
    for seed, tree, _ in trying_trees():
        chain = explore(tree.task, tree.root, Limits())
        for run in itertools.islice(scenarios(chain, Limits()), SCENARIOS):
            assert expected_run(tree.task, tree.root, script_of(run)) == run_of(run), seed
