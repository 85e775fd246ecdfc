"""Does an exported tree do, run by run, what the exact simulation says?"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from importlib.util import find_spec
from itertools import islice
from types import MappingProxyType

from bbtc.belief.chain import explore
from bbtc.belief.monitored import with_hidden
from bbtc.belief.scenarios import scenarios
from bbtc.ground.task import ONE
from bbtc.limits import Limits
from bbtc.pipeline import with_monitor, without_hidden
from bbtc.replay.script import TIMINGS, run_of, script_of
from bbtc.replay.tellings import Tellings
from bbtc.tree.nodes import Tree

ENGINES = MappingProxyType({"py_trees": "py_trees", "btcpp": "behaviortreepy"})
"""The formats whose engines run here, and the modules that bring these along."""


_RARE = Fraction(1, 10**9)
"""Runs of a tree that tries for ever become longer and longer, and less and less probable."""


def engine_missing(form: str) -> str | None:
    """The module that is missing to run a format; None if it is there."""
    module = ENGINES[form]
    return None if find_spec(module) is not None else module


def difference(tree: Tree, form: str, limits: Limits, most: int = 200) -> str | None:
    """How an export behaves differently from the simulation, in words; None if it does not.

    Replays the ``most`` most probable runs, without those that come less often than :data:`_RARE`, each
    with outcomes that land between ticks, during a tick, within the one that starts the action, and after the
    tick. Raises ``LimitReached``.
    """
    from bbtc.replay.engines import BtcppReplay, PyTreesReplay

    exported = with_monitor(tree, limits)
    told = None if exported is None else Tellings(tree.task, exported)
    if exported is None:
        exported = tree = without_hidden(tree, limits)
    else:
        tree = replace(tree, task=with_hidden(tree.task))
    chain = explore(tree.task, tree.root, limits)
    replay = PyTreesReplay(exported) if form == "py_trees" else BtcppReplay(exported)
    left = ONE
    for number, scenario in enumerate(islice(scenarios(chain, limits), most), 1):
        expected, script = run_of(scenario), script_of(scenario)
        if told is not None:
            expected, script = told.run(expected), told.script(scenario)
        for timing in TIMINGS:
            found = replay.run(script, timing)
            if found != expected:
                return (
                    f"run {number} (outcomes land {timing}): expected {_words(expected.actions)}, "
                    f"{expected.status}; {form} did {_words(found.actions)}, {found.status}"
                )
        left -= scenario.probability
        if left < _RARE:
            break
    return None


def _words(actions: tuple[str, ...]) -> str:
    return ", ".join(actions) or "nothing"
