"""Trees in worlds that others change, from the text on: no action starts
without its precondition, and the root does not succeed without the goal.

The worlds hold every fact of the text, also those that the model never changes or only makes true; what
holds is worked out from the text (``tests/domains/lifted.py``), not from the task.
"""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Callable, Hashable
from random import Random

import pytest

from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.ground.task import Task, split_name
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.options import Options
from bbtc.planner.strategies import STRATEGIES
from bbtc.replay.engines import BtcppReplay, PyTreesReplay, Replay
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree
from tests.domains.open_worlds import OpenWorlds
from tests.domains.random_texts import random_text
from tests.long_form import amount
from tests.replay.all_engines import Compared

ENGINES: list[Callable[[Tree], Replay]] = [lambda tree: PyTreesReplay(tree, "imported")]
if importlib.util.find_spec("behaviortreepy") is not None:  # there is no wheel of it for some platforms
    ENGINES.append(BtcppReplay)
PLANS = [*((name, Options()) for name in STRATEGIES), ("refine", Options(closed_world=True))]
GROUP = amount(28, 40)
RUNS = 6
TICKS = 25


class RestlessWorld:
    """See :class:`bbtc.replay.script.World`. Actions have the outcomes that the text gives them, after one
    tick or three, and between ticks others change things."""

    def __init__(self, worlds: OpenWorlds, rng: Random) -> None:
        self.worlds = worlds
        self.rng = rng
        self.unrest = rng.choice([0.0, 0.05, 0.3])
        self.facts = worlds.changed(dict(rng.choice(worlds.starts)), rng, rng.choice([0.0, 0.0, 0.3]))
        self.succeeds = True
        self.wrong: list[str] = []
        self.starts = 0
        self._left: dict[Hashable, int] = {}
        self._pending: str | None = None

    def read(self, variable: str) -> int:
        """The value of a variable, by name."""
        name, args = split_name(variable)
        return self.facts.get((name, *args), 0)

    def start(self, action: str, runner: Hashable) -> bool:
        """An action starts. Whether it has ended at once."""
        self.starts += 1
        if self.worlds.precondition(*split_name(action), self.facts) != 2:
            self.wrong.append(f"{action} in {self.facts}")
        self._pending = action
        self._left[runner] = self.rng.choice([0, 0, 2])
        return self._ended(runner)

    def running(self, runner: Hashable) -> bool:
        """Whether it has started an action that has neither ended nor been cancelled."""
        return runner in self._left

    def go_on(self, runner: Hashable) -> bool:
        """A running action is called again. Whether it has ended now."""
        self._left[runner] -= 1
        return self._ended(runner)

    def cancel(self, runner: Hashable) -> None:
        """A running action is no longer wanted."""
        del self._left[runner]

    def between_ticks(self) -> None:
        """What was done shows, and others do something."""
        if self._pending is not None and not self._left:
            self.facts = self.worlds.after(*split_name(self._pending), self.facts, self.rng)
            self._pending = None
        self.facts = self.worlds.changed(self.facts, self.rng, self.unrest)

    def _ended(self, runner: Hashable) -> bool:
        if self._left[runner] > 0:
            return False
        del self._left[runner]
        return True


@pytest.mark.parametrize("group", range(amount(1, 60)))
@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: f"{plan[0]}{'-closed' * plan[1].closed_world}")
def test_no_action_starts_and_no_root_succeeds_where_the_text_forbids_it(
    plan: tuple[str, Options], group: int, record_property: Callable[[str, object], None]
) -> None:
    compared = Compared(record_property, "guards in worlds that others change")
    count = dict.fromkeys(("runs", "starts", "successes"), 0)
    for seed in range(group * GROUP, (group + 1) * GROUP):
        text = random_text(seed)
        tree = _planned(text, *plan)
        if tree is None:
            continue
        worlds = OpenWorlds(text)
        for make in ENGINES:
            replay, rng = make(tree), Random(seed)
            for _ in range(RUNS):
                world = RestlessWorld(worlds, rng)
                status = _run(replay, world)
                assert world.wrong == [], (text, replay.source)
                holds = worlds.goal(world.facts) == 2
                assert holds or status != "success", (text, world.facts, replay.source)
                count["runs"] += 1
                count["starts"] += world.starts
                count["successes"] += status == "success"
    compared.add(**count)
    # Some texts further on are too poor for it.
    assert group > 1 or min(count.values()) > GROUP / 2


def _planned(text: str, strategy: str, options: Options) -> Tree | None:
    """The tree of a text; None where the goal is out of reach, or the task too large for a test."""
    limits = Limits(seconds=10, states=3000, nodes=150)
    try:
        task = _compiled(text)
        return plan_task(task, None, strategy, limits, lambda _: None, options=options).tree
    except (BbtcError, LimitReached):
        return None


@functools.cache
def _compiled(text: str) -> Task:
    return compile_sources([SourceFile("random.pddl", text)], Report(), Limits())


def _run(replay: Replay, world: RestlessWorld) -> str:
    replay.begin(world)
    for _ in range(TICKS):
        status = replay.tick()
        if status != "running":
            return status
        world.between_ticks()
    return "running"
