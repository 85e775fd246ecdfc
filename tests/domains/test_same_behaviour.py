"""Every scenario of the exact simulation, replayed in what the exporters write: the same actions in
the same order, the same end, the same final state."""

from __future__ import annotations

import itertools

import pytest

from bbtc.belief.chain import explore
from bbtc.belief.scenarios import scenarios
from bbtc.limits import Limits
from tests.domains.problems import PROBLEMS, Problem, plan_of
from tests.replay.engines import BtcppReplay, PyTreesReplay
from tests.replay.script import TIMINGS, run_of, script_of

MOST = 500
"""Scenarios of a problem, the most probable first; most problems have fewer."""

MOST_TIMED = 100
"""Scenarios replayed three times, with outcomes that land earlier and later in a tick, too."""


@pytest.mark.parametrize("engine", [PyTreesReplay, BtcppReplay])
@pytest.mark.parametrize("problem", PROBLEMS, ids=str)
def test_every_scenario_runs_as_simulated(
    problem: Problem, engine: type[PyTreesReplay] | type[BtcppReplay]
) -> None:
    if engine is BtcppReplay:
        pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    tree = plan_of(problem).tree
    replay = engine(tree)
    runs = list(itertools.islice(scenarios(explore(tree.task, tree.root, Limits())), MOST))
    assert runs
    assert len(runs) == MOST or sum(run.probability for run in runs) == 1
    for number, scenario in enumerate(runs):
        for timing in TIMINGS if number < MOST_TIMED else TIMINGS[:1]:
            assert replay.run(script_of(scenario), timing) == run_of(scenario), (timing, scenario)
    print(f"{problem}: {len(runs)} scenarios replayed")
