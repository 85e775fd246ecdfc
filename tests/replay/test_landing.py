"""In a robot whose effects land one by one, in any order and at any moment of an action's run, a tree does
what it does where they land at once: the same actions, the same end, the same final state. So it succeeds as
often.

Usually those runs of the project's problems in which all happens that happens in any, each with some ways to
land; ``BBTC_LONG=1`` takes all runs (the 500 most probable), each with all ways, or 10,000 of more.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from fractions import Fraction
from itertools import islice

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import Scenario, scenarios
from bbtc.ground.condition import TRUE, Is
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.replay.engines import Replay
from bbtc.replay.script import Run, Script, run_of, script_of
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Tree, actions_of
from tests.domains.problems import PROBLEMS, Problem, seen_tree
from tests.long_form import LONG, amount
from tests.replay.all_engines import Compared, EngineName, engine
from tests.replay.compiled import CompiledReplay, CompiledStockReplay, require_library
from tests.replay.covering import covering
from tests.replay.landing import LAST, LandingWorld, every_landing
from tests.replay.test_actions import shown
from tests.replay.test_equivalence import lively_trees
from tests.replay.ticks import TickScript, trace

MOST = amount(6, 500)
"""Runs of a problem, the most probable first."""

WAYS = amount(3, 10_000)
"""Ways to land of a run."""

NEWEST: tuple[EngineName, ...] = ("py_trees", "BehaviorTree.CPP")
"""The oldest py_trees has the same modules; ``test_ticks.py`` compares it with the rules."""


def chosen(tree: Tree) -> list[Scenario]:
    runs = list(islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), MOST))
    return runs if LONG else covering(runs)


def check(tree: Tree, replay: Replay | CompiledReplay) -> tuple[int, int]:
    """Fail unless all runs are as simulated. How many there are, and how many were compared."""
    rng, compared = random.Random(1), 0
    runs = chosen(tree)
    for scenario in runs:
        script, expected = script_of(scenario), run_of(scenario)
        for landings in every_landing(tree.task, script, WAYS, rng):
            world = LandingWorld(tree.task, script, landings)
            assert replay.run_in(world) == expected, (landings, script)
            assert world.cancelled == []
            compared += 1
    return len(runs), compared


@pytest.mark.parametrize("name", NEWEST)
@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_trees_of_the_domains_do_what_they_do_where_effects_land_at_once(
    problem: Problem, name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    tree = seen_tree(problem)
    with engine(name) as (version, make):
        runs, compared = check(tree, make(tree, "imported"))  # type: ignore[arg-type]
        Compared(record_property, f"effects one by one: simulator and {version}").add(
            problems=1, scenarios=runs, runs=compared
        )


@pytest.mark.parametrize("kind", [CompiledReplay, CompiledStockReplay], ids=lambda kind: kind.profile)
@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_compiled_trees_do_so_in_both_profiles(problem: Problem, kind: type[CompiledReplay]) -> None:
    require_library()
    tree = seen_tree(problem)
    if any(tree.task.action_by_name[node.action].timeout is not None for node in actions_of(tree.root)):
        pytest.skip("a Timeout of BehaviorTree.CPP may assert when a tree is destroyed before it passes")
    with kind(tree) as replay:
        check(tree, replay)


@pytest.mark.parametrize("name", NEWEST)
def test_random_trees_do_so(name: EngineName) -> None:
    with engine(name) as (_, make):
        for _, tree, _ in lively_trees(0)[: amount(8, 125)]:
            check(tree, make(tree, "imported"))  # type: ignore[arg-type]


# --- a robot that is nowhere while it drives -----------------------------------------------------

HALL, LAB, OPEN = range(3)


def drive_tree(uninterruptible: bool = False) -> Tree:
    """Drive from the hall to the lab while the door is open, as a person would write it."""
    arrives = Effect(None, ((HALL, Truth.FALSE), (LAB, Truth.TRUE)))
    factors = (Factor((Outcome(Fraction(1), (arrives,)),)),)
    task = Task(
        "rooms",
        "one",
        (Variable("at", ("hall",), False), Variable("at", ("lab",), False), Variable("open", (), False)),
        (InitialState(Fraction(1), (Truth.TRUE, Truth.FALSE, Truth.TRUE)),),
        Is(LAB, Truth.TRUE),
        (GroundAction("drive", (), TRUE, factors, uninterruptible=uninterruptible),),
    )
    asks = [ConditionNode(f"k{index}", Is(index, Truth.TRUE)) for index in (LAB, HALL, OPEN, LAB)]
    attempt = ControlNode("s", "sequence", (asks[1], asks[2], ActionNode("a", "drive()"), asks[3]))
    root = ControlNode("f", "fallback", (asks[0], attempt))
    return Tree(task, root, Fraction(1), Fraction(1), "target-reached")


def ticks(name: EngineName, tree: Tree, *before: tuple[int, int, int], length: int = 9) -> list[str]:
    """What happens in every tick, with the values before each."""
    script = TickScript(before, (None,) * len(before), ((length, True),) * len(before), frozenset())
    with engine(name) as (_, make):
        return shown(trace(make(tree, "imported"), script))


START, NOWHERE, CLOSED, THERE = (2, 0, 2), (0, 0, 2), (0, 0, 0), (0, 2, 2)


@pytest.mark.parametrize("name", NEWEST)
def test_a_robot_that_is_nowhere_while_it_drives_arrives(name: EngineName) -> None:
    drive = drive_tree()
    script = Script(START, (("drive()", THERE),))
    with engine(name) as (_, make):
        world = LandingWorld(drive.task, script, [{HALL: 0, LAB: LAST}])
        assert make(drive, "imported").run_in(world) == Run(("drive()",), "success", THERE)  # type: ignore[union-attr]
    found = ticks(name, drive, START, NOWHERE, NOWHERE, THERE, length=3)
    assert found == ["+drive() running", ".drive() running", ".drive() running", " success"]


@pytest.mark.parametrize("name", NEWEST)
def test_a_door_that_closes_cancels_the_drive_in_that_tick(name: EngineName) -> None:
    found = ticks(name, drive_tree(), START, NOWHERE, CLOSED, CLOSED)
    assert found == ["+drive() running", ".drive() running", "-drive() running", " failure"]


@pytest.mark.parametrize("name", NEWEST)
def test_nothing_cancels_what_is_uninterruptible(name: EngineName) -> None:
    drive = drive_tree(uninterruptible=True)
    found = ticks(name, drive, START, NOWHERE, CLOSED, THERE, THERE, length=4)
    assert found == ["+drive() running", *[".drive() running"] * 3, " success"]


@pytest.mark.parametrize("name", NEWEST)
def test_the_goal_is_not_read_before_the_drive_has_reported_its_end(name: EngineName) -> None:
    found = ticks(name, drive_tree(), START, THERE, THERE, THERE, length=3)
    assert found == ["+drive() running", ".drive() running", ".drive() running", " success"]
