"""Tick by tick: actions that run for many ticks, in worlds that change whenever they like, as
docs/multi-tick-actions.md says."""

from __future__ import annotations

import functools
import random
from collections.abc import Callable, Hashable
from dataclasses import replace
from itertools import repeat

import pytest

from bbtc.ground.task import NO_CHANGE
from bbtc.limits import Limits
from bbtc.pipeline import plan_task
from bbtc.planner.options import Options
from bbtc.replay.script import Values
from bbtc.tree.nodes import Tree
from tests.domains.problems import PROBLEMS, Problem, task_of, tree_of
from tests.long_form import amount
from tests.replay.all_engines import ENGINES, Compared, EngineName, engine, part_for
from tests.replay.random_trees import busy_tree, random_condition
from tests.replay.reference import Running, expected_ticks, value_of
from tests.replay.ticks import Tick, TickScript, TickWorld, random_script, trace
from tests.sharing import shared

TREES = amount(100, 2000)
SCRIPTS = 5
TICKS = 20
"""Ticks of a script; most trees end sooner."""


@functools.cache
def scripted_trees(*, endless: bool) -> list[tuple[Tree, list[tuple[TickScript, list[Tick]]]]]:
    """Random trees, each with scripts and what the reference does with them, worked out in one worker of a
    test run."""
    return shared(f"scripted-trees-{endless}", lambda: list(map(_scripted, range(TREES), repeat(endless))))


def _scripted(seed: int, endless: bool) -> tuple[Tree, list[tuple[TickScript, list[Tick]]]]:
    rng = random.Random(seed)
    tree = with_other_actions(busy_tree(seed, endless=endless), rng)
    scripts = [random_script(tree.task, rng, TICKS) for _ in range(SCRIPTS)]
    return tree, [(script, expected_ticks(tree.task, tree.root, script)) for script in scripts]


def with_other_actions(tree: Tree, rng: random.Random) -> Tree:
    """The tree with half of the actions doing nothing in the model, so that others do what changes while they
    run, some that nothing interrupts, and some that go on while something is true."""
    actions = tuple(
        replace(
            action,
            factors=(NO_CHANGE,) if rng.random() < 0.5 else action.factors,
            uninterruptible=rng.random() < 0.15,
            during=random_condition(rng, tree.task.variables, 1) if rng.random() < 0.25 else None,
        )
        for action in tree.task.actions
    )
    return replace(tree, task=replace(tree.task, actions=actions))


@pytest.mark.parametrize("endless", [False, True], ids=["ending", "endless"])
@pytest.mark.parametrize("name", ENGINES)
def test_every_tick_is_as_in_the_reference(
    name: EngineName, endless: bool, record_property: Callable[[str, object], None]
) -> None:
    count = dict.fromkeys(("started", "went_on", "cancelled"), 0)
    with engine(name) as (version, make):
        compared = Compared(record_property, f"actions of many ticks: reference and {version}")
        trees = part_for(name, list(enumerate(scripted_trees(endless=endless))))
        for seed, (tree, scripts) in trees:
            replay = make(tree, "imported")
            for script, expected in scripts:
                assert trace(replay, script) == expected, (seed, script, replay.source)
                for kind in count:
                    count[kind] += sum(len(getattr(tick, kind)) for tick in expected)
                compared.add(ticks=len(expected))
            compared.add(trees=1)
    compared.add(**{f"actions {kind.replace('_', ' ')}": number for kind, number in count.items()})
    assert min(count.values()) > len(trees) / 2


class WatchedWorld(TickWorld):
    """Remembers the values that actions were started in."""

    def start(self, action: str, runner: Hashable) -> bool:
        self.starts.append((action, self.values))
        return super().start(action, runner)

    starts: list[tuple[str, Values]]


QUICK = [
    problem
    for problem in PROBLEMS
    if problem.domain not in ("service-robot", "hospital")
    and problem.name != "three-trays"
    and not task_of(problem).components
    and not task_of(problem).numbers
]
"""Problems for which the strategy that leaves out no condition needs less than a second, and in which no
facts are hidden: what a robot believes does not change by itself. Nor are there numbers, which that strategy
does not know."""

NUMBERS = [problem for problem in PROBLEMS if task_of(problem).numbers]


@pytest.mark.parametrize("name", ENGINES)
def test_plans_run_as_in_the_reference_whatever_changes(
    name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    with engine(name) as (version, make):
        compared = Compared(record_property, f"plans in restless worlds: reference and {version}")
        plans = [(p, tree) for p in QUICK for tree in (tree_of(p), tree_of(p, "refine"))]
        for problem, tree in [*plans, *((p, tree_of(p)) for p in NUMBERS)]:
            replay, rng = make(tree, "imported"), random.Random(1)
            for _ in range(10):
                script = random_script(tree.task, rng, TICKS)
                expected = expected_ticks(tree.task, tree.root, script)
                assert trace(replay, script) == expected, (problem, script)
                compared.add(ticks=len(expected))
            compared.add(trees=1)


@pytest.mark.parametrize("options", [None, Options()], ids=["refine", "guarded"])
@pytest.mark.parametrize("problem", QUICK, ids=str)
def test_plans_are_sound_whatever_changes(problem: Problem, options: Options | None) -> None:
    tree, rng = tree_of(problem, "refine"), random.Random(1)
    if options is not None:
        tree = plan_task(tree.task, None, "auto", Limits(), lambda _: None, options=options).tree
    for _ in range(amount(100, 200)):
        script = random_script(tree.task, rng, TICKS)
        world = WatchedWorld(tree.task, script)
        world.starts = []
        reference = Running(tree.task, (), world=world)
        ticks = reference.trace(tree.root, script)
        for action, values in world.starts:
            assert value_of(tree.task.action_by_name[action].precondition, values) == "T"
        if ticks[-1].status == "success":
            assert value_of(tree.task.goal, reference.values) == "T"
