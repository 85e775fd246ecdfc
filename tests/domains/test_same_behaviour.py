"""Every scenario of the exact simulation, replayed in what the exporters write: the same actions in
the same order, the same end, the same final state.

Usually those in which all happens that happens in any of them, and as many others as there is time for;
``BBTC_LONG=1`` takes all.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.limits import Limits
from bbtc.replay.script import TIMINGS, Run, Script, run_of, script_of
from bbtc.tree.nodes import Tree
from tests.domains.problems import SHORTER, Problem, seen_tree
from tests.long_form import amount
from tests.replay.all_engines import ENGINES, Compared, EngineName, engine, part_for
from tests.replay.covering import within_budget
from tests.sharing import shared

MOST = 500
"""Scenarios of a problem, the most probable first."""

BUDGET = amount(100, 1_000_000)
"""Steps of the scenarios of a problem that are replayed, with each timing, in each engine."""


@functools.cache
def runs_of(problem: Problem) -> list[tuple[Script, Run]]:
    """What is replayed, worked out in one worker of a test run."""
    return shared(f"scenarios-{problem.domain}-{problem.name}", lambda: _runs_of(seen_tree(problem)))


def _runs_of(tree: Tree) -> list[tuple[Script, Run]]:
    found = list(itertools.islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), MOST))
    assert found
    assert len(found) == MOST or sum(run.probability for run in found) == 1
    return [(script_of(run), run_of(run)) for run in within_budget(found, BUDGET)]


@pytest.mark.parametrize(
    ("problem", "name"),
    [(problem, name) for name in ENGINES for problem in part_for(name, SHORTER)],
    ids=str,
)
def test_every_scenario_runs_as_simulated(
    problem: Problem, name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    tree = seen_tree(problem)
    runs = runs_of(problem)
    with engine(name) as (version, make):
        replay = make(tree, "embedded")
        for timing in TIMINGS:
            done = replay.runs((script, timing) for script, _ in runs)
            different = [row for row in zip(runs, done, strict=True) if row[0][1] != row[1]]
            assert different == [], timing
        compared = Compared(record_property, f"problems of our domains: simulator and {version}")
        compared.add(problems=1, scenarios=len(runs), runs=len(runs) * len(TIMINGS))
