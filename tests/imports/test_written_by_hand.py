"""A tree written by hand with the engine's own retries and time-outs: imported, simulated, verified, run."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest

import bbtc
from bbtc.limits import Limits
from bbtc.pipeline import verify_tree
from bbtc.replay.engines import BtcppReplay, PyTreesReplay
from bbtc.source import SourceFile
from bbtc.tree.nodes import ControlNode, Tree, walk
from tests.replay.reference import expected_ticks
from tests.replay.ticks import random_script, trace

TASK, FILE = (Path(__file__).with_name(f"grasp_and_put.{ending}") for ending in ("pddl", "xml"))


@cache
def imported() -> Tree:
    return bbtc.import_tree(FILE, TASK)


def test_it_is_read_with_its_attempts() -> None:
    nodes = [node for node in walk(imported().root) if isinstance(node, ControlNode)]
    assert [node.attempts for node in nodes if node.kind == "retry-until-success"] == [3]
    assert imported().task.action_by_name["grasp()"].timeout == 4


def test_of_another_mistake_only_that_is_told() -> None:
    wrong = FILE.read_text(encoding="utf-8").replace("<Approach/>", "<Approach/><Approach/>")
    with pytest.raises(bbtc.BbtcError) as told:
        bbtc.import_tree(SourceFile("wrong.xml", wrong), TASK)
    assert told.value.diagnostics
    assert not any("Timeout" in each.message for each in told.value.diagnostics)


def test_it_succeeds_as_often_as_three_attempts_do() -> None:
    """A grasp takes too long one time in four; of the others, four in five hold, one pushes the part away.
    Who begins an attempt near it drives up to it again in that attempt, who has come to it in it does not."""
    far = near = Fraction(0)
    driven = Fraction(9, 10)
    for _ in range(3):
        held = Fraction(3, 4) * Fraction(4, 5) + near / 4
        away = Fraction(3, 4) * Fraction(1, 5)
        again = driven * near + (1 - driven) * far
        far, near = driven * (held + away * far) + (1 - driven) * far, held + away * again
    assert bbtc.simulate(imported()).success == far == imported().success_probability


def test_it_is_verified() -> None:
    assert verify_tree(imported(), Limits(), "own").problems == ()


@pytest.mark.parametrize("kind", [PyTreesReplay, BtcppReplay])
def test_the_engines_do_the_same(kind: type[PyTreesReplay] | type[BtcppReplay]) -> None:
    if kind is BtcppReplay:
        pytest.importorskip("behaviortreepy", reason="no wheel of behaviortreepy for this platform")
    tree, rng = imported(), random.Random(1)
    replay = kind(tree)
    for _ in range(30):
        script = random_script(tree.task, rng, 15)
        assert trace(replay, script) == expected_ticks(tree.task, tree.root, script)
