"""Ground conditions have the values of the text, unknown included, also where others change the world."""

from __future__ import annotations

from random import Random

import pytest

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.condition import evaluate
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.source import SourceFile
from tests.domains.open_worlds import OpenWorlds
from tests.domains.random_texts import random_text
from tests.long_form import amount

_GROUP = 100
_STATES = 12


@pytest.mark.parametrize("group", range(amount(3, 200)))
def test_preconditions_and_goals_are_worth_what_the_text_says_in_every_state(group: int) -> None:
    """True, false or unknown, whatever value others give to what effects mention or is declared external."""
    compared = 0
    for seed in range(group * _GROUP, (group + 1) * _GROUP):
        text, rng = random_text(seed), Random(seed)
        try:
            task = compile_sources([SourceFile("random.pddl", text)], Report(), Limits())
        except BbtcError:
            continue
        worlds = OpenWorlds(text)
        for share in [0.0, 0.2, 1.0] * (_STATES // 3):
            world = worlds.changed(dict(rng.choice(worlds.starts)), rng, share)
            values = worlds.values(task, world)
            assert evaluate(task.goal, values) == worlds.goal(world), (text, world)
            for action in task.actions:
                expected = worlds.precondition(action.schema, action.args, world)
                assert evaluate(action.precondition, values) == expected, (text, action.name, world)
                compared += 1
    assert compared > _GROUP * _STATES / 2
