"""Both profiles of BehaviorTree.CPP files in the engine itself, compiled: same actions, same end, same
final state as in the reference. Skipped where CMake finds no BehaviorTree.CPP."""

from __future__ import annotations

import itertools
import random

import pytest
from hypothesis import given

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.limits import Limits
from bbtc.replay.script import TIMINGS, run_of, script_of
from bbtc.tree.nodes import Tree
from tests.domains.problems import PROBLEMS, Problem, seen_tree
from tests.long_form import amount
from tests.profiles import examples
from tests.replay.compiled import CompiledReplay, CompiledStockReplay, require_library
from tests.replay.random_trees import random_tree
from tests.replay.reference import random_run, varied_runs
from tests.replay.test_ticks import scripted_trees
from tests.replay.ticks import trace
from tests.strategies import HOSTILE_NAMES, trees

TREES = amount(60, 1000)
MOST = amount(60, 500)

PROFILES = pytest.mark.parametrize(
    "engine", [CompiledReplay, CompiledStockReplay], ids=lambda engine: engine.profile
)


@pytest.fixture(autouse=True)
def library() -> None:
    """Skips where nothing can be compiled."""
    require_library()


@PROFILES
@pytest.mark.parametrize("latched", [1.0, 0.6], ids=["latched", "mixed"])
def test_random_trees_run_as_in_the_reference(engine: type[CompiledReplay], latched: float) -> None:
    compared = found = seed = 0
    while found < TREES:
        seed += 1
        tree = random_tree(seed, latched)
        runs = varied_runs(tree.task, tree.root, seed)
        if not runs:
            continue
        found += 1
        with engine(tree) as replay:
            for script, expected in runs:
                for timing in TIMINGS:
                    assert replay.run(script, timing) == expected, (timing, script, replay.source)
                    compared += 1
    print(f"{engine.profile}: {compared} runs of {found} random trees compared")


@PROFILES
@pytest.mark.parametrize("endless", [False, True], ids=["ending", "endless"])
def test_every_tick_is_as_in_the_reference(engine: type[CompiledReplay], endless: bool) -> None:
    ticks = 0
    for seed, (tree, scripts) in enumerate(scripted_trees(endless=endless)[:TREES]):
        with engine(tree) as replay:
            for script, expected in scripts:
                assert trace(replay, script) == expected, (seed, script, replay.source)
                ticks += len(expected)
    print(f"{engine.profile}: {ticks} ticks of {TREES} random trees compared")


@PROFILES
@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_scenarios_run_as_simulated(problem: Problem, engine: type[CompiledReplay]) -> None:
    tree = seen_tree(problem)
    runs = list(itertools.islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), MOST))
    with engine(tree) as replay:
        for scenario, timing in itertools.product(runs, TIMINGS):
            assert replay.run(script_of(scenario), timing) == run_of(scenario), (timing, scenario)
    print(f"{problem}, {engine.profile}: {len(runs)} scenarios compared in three timings")


@examples(40)
@given(trees(HOSTILE_NAMES))
def test_hostile_names_do_not_change_what_a_tree_does(tree: Tree) -> None:
    rng = random.Random(1)
    with CompiledReplay(tree) as replay:
        for _ in range(3):
            script, expected = random_run(tree.task, tree.root, rng, most=4)
            assert replay.run(script) == expected
