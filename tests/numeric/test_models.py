"""Models for checkers keep a number as one variable, and have the figures that the simulation has."""

from __future__ import annotations

import json

import pytest

import bbtc
from bbtc.source import SourceFile
from bbtc.verifier.storm import is_installed
from tests.long_form import amount
from tests.numeric.random_texts import Writer
from tests.numeric.test_exports import COURIER


def test_a_number_is_one_variable_of_the_models() -> None:
    tree = bbtc.plan(SourceFile("courier.pddl", COURIER)).tree
    prism, jani = bbtc.export(tree, "prism"), bbtc.export(tree, "jani")
    assert isinstance(prism, str)
    assert isinstance(jani, str)
    assert "  battery : [0..20] init 9; // battery()\n" in prism
    assert "(battery'=(max(battery-2, 0)))" in prism
    assert "digit" not in prism + jani
    (battery,) = [each for each in json.loads(jani)["variables"] if each["name"] == "battery"]
    assert battery["type"] == {"kind": "bounded", "base": "int", "lower-bound": 0, "upper-bound": 20}


@pytest.mark.skipif(not is_installed(), reason="Storm is not installed")
@pytest.mark.parametrize("beside", ["", "events", "events-and-time"], ids=lambda beside: beside or "alone")
def test_storm_finds_the_same_figures(beside: str) -> None:
    events, time = "events" in beside, "time" in beside
    asked = 0
    for seed in range(amount(15, 600)):
        try:
            plan = bbtc.plan(SourceFile("random.pddl", Writer(seed).domain(events=events, time=time)))
        except bbtc.BbtcError:
            continue
        if not 0 < plan.figures.success < 1 and seed % 5:
            continue
        asked += 1
        assert not bbtc.verify(plan, engine="all").problems, seed
    assert asked > 2
