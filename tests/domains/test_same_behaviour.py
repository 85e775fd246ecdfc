"""Every scenario of the exact simulation, replayed in what the exporters write: the same actions in
the same order, the same end, the same final state."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.limits import Limits
from bbtc.replay.script import TIMINGS, run_of, script_of
from tests.domains.problems import PROBLEMS, Problem, plan_of
from tests.replay.all_engines import ENGINES, Compared, EngineName, engine

MOST = 500
"""Scenarios of a problem, the most probable first; most problems have fewer."""


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_every_scenario_runs_as_simulated(
    problem: Problem, name: EngineName, record_property: Callable[[str, object], None]
) -> None:
    tree = plan_of(problem).tree
    runs = list(itertools.islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), MOST))
    assert runs
    assert len(runs) == MOST or sum(run.probability for run in runs) == 1
    scripts, expected = [script_of(run) for run in runs], [run_of(run) for run in runs]
    with engine(name) as (version, make):
        replay = make(tree, "embedded")
        for timing in TIMINGS:
            done = replay.runs((script, timing) for script in scripts)
            different = [row for row in zip(scripts, expected, done, strict=True) if row[1] != row[2]]
            assert different == [], timing
        compared = Compared(record_property, f"problems of our domains: simulator and {version}")
        compared.add(problems=1, scenarios=len(runs), runs=len(runs) * len(TIMINGS))
