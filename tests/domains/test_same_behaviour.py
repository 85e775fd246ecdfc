"""Every scenario of the exact simulation, replayed in what the exporters write: the same actions in
the same order, the same end, the same final state.

Usually those in which all happens that happens in any of them, and as many others as there is time for;
``BBTC_LONG=1`` takes all.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.limits import Limits
from bbtc.replay.script import TIMINGS, run_of, script_of
from tests.domains.problems import PROBLEMS, Problem, seen_tree
from tests.long_form import amount
from tests.replay.all_engines import ENGINES, Compared, EngineName, engine
from tests.replay.covering import within_budget

MOST = 500
"""Scenarios of a problem, the most probable first."""

BUDGET = amount(500, 1_000_000)
"""Steps of the scenarios of a problem that are replayed, with each timing, in each engine."""


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_every_scenario_runs_as_simulated(
    problem: Problem, name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    tree = seen_tree(problem)
    found = list(itertools.islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), MOST))
    assert found
    assert len(found) == MOST or sum(run.probability for run in found) == 1
    runs = within_budget(found, BUDGET)
    scripts, expected = [script_of(run) for run in runs], [run_of(run) for run in runs]
    with engine(name) as (version, make):
        replay = make(tree, "embedded")
        for timing in TIMINGS:
            done = replay.runs((script, timing) for script in scripts)
            different = [row for row in zip(scripts, expected, done, strict=True) if row[1] != row[2]]
            assert different == [], timing
        compared = Compared(record_property, f"problems of our domains: simulator and {version}")
        compared.add(problems=1, scenarios=len(runs), runs=len(runs) * len(TIMINGS))
