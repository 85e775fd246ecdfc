"""Domains with numbers against an interpreter of their text: the best there is, what a tree does, and the
verifier's figures."""

from __future__ import annotations

import json
from fractions import Fraction

import pytest

import bbtc
from bbtc.artefacts.tree_json import carried, tree_from_json, tree_to_json
from bbtc.diagnostics import BbtcError
from bbtc.source import SourceFile
from tests.long_form import amount
from tests.numeric.lifted import World, success
from tests.numeric.random_texts import Writer

_MOST_STATES = 3_000
_EXACT = 1e-9


@pytest.mark.parametrize("beside", ["", "events", "events-and-time"], ids=lambda beside: beside or "alone")
@pytest.mark.parametrize("part", range(5))
def test_random_tasks_have_the_figures_of_their_text(part: int, beside: str) -> None:
    """P*, the success of the planned tree, its round trip through JSON, and what verify finds."""
    events, time = "events" in beside, "time" in beside
    each = amount(12, 200)
    told = 0
    for seed in range(part * each, part * each + each):
        text = Writer(seed).domain(events=events, time=time)
        world = World.of(text)
        best = world.best(_MOST_STATES)
        if best is None:
            continue
        if best == 0:
            _is_hopeless(text)
            continue
        plan = bbtc.plan(SourceFile("random.pddl", text))
        bounds = plan.tree.bounds or (0, plan.figures.success)
        assert float(bounds[1]) == pytest.approx(best, abs=1e-6), text
        assert float(plan.figures.success) == pytest.approx(best, abs=1e-6), text
        written = json.loads(json.dumps(tree_to_json(plan.tree)))
        again = tree_from_json(written)
        assert again == carried(plan.tree), text
        assert float(plan.figures.success) == pytest.approx(success(world, written["root"]), abs=_EXACT), text
        verdict = bbtc.verify(again, engine="own")
        assert not verdict.problems, text
        told += 0 < best < 1
    assert told or part or events, "some tasks are neither hopeless nor sure"


def _is_hopeless(text: str) -> None:
    """Either it is found that the goal cannot be reached, or the best tree has success 0."""
    try:
        success = bbtc.plan(SourceFile("random.pddl", text)).figures.success
    except BbtcError as error:
        codes = {each.code for each in error.diagnostics}
        success = Fraction("BBT0412" not in codes)
    assert not success, text
