"""The runs of a tree that fail, the most probable first: what each did, and the fact it lacks at its root."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bbtc.belief.chain import Chain
from bbtc.belief.failures import FailureFinder, Stop
from bbtc.belief.scenarios import Scenario, scenarios
from bbtc.ground.condition import Condition
from bbtc.limits import Limits
from bbtc.tree.nodes import Tree

if TYPE_CHECKING:
    from bbtc.planner.why_not import Block


@dataclass(frozen=True, slots=True)
class FailingRun:
    """A run without success. ``blocks`` are the facts that nothing brings back from its end, for want of
    which the goal is lost; without them it may be in reach of some actions, but the tree takes none.
    ``stop`` is where it stopped."""

    run: Scenario
    blocks: tuple[Block, ...]
    lost: tuple[Condition, ...]
    stop: Stop


def failing_runs(tree: Tree, chain: Chain, limits: Limits, most: int) -> Iterator[FailingRun]:
    """The most probable of them; runs that never end are none. Raises
    :class:`bbtc.diagnostics.LimitReached`."""
    if most <= 0:
        return
    runs = itertools.islice(scenarios(chain, limits, failing=True), most)
    first = next(runs, None)
    if first is None:
        return
    from bbtc.planner.why_not import RootFinder

    roots, finder = RootFinder(tree.task, limits), FailureFinder(tree.task, tree.root)
    for run in itertools.chain([first], runs):
        stop = finder.stopped(chain.states[run.end])
        yield FailingRun(run, roots.blocks(run.final), tuple(roots.lost(run.final)), stop)
