"""Exported trees in worlds where facts change by chance: both engines count what the sampling counts."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest

import bbtc
from bbtc.disturbance.perturbed import perturbed_runs
from bbtc.limits import Limits
from bbtc.replay.engines import BtcppReplay, PyTreesReplay, Replay
from bbtc.tree.nodes import Tree
from tests.long_form import LONG, amount
from tests.replay.all_engines import Compared
from tests.replay.perturbed import perturbed_counts
from tests.replay.random_trees import random_tree, with_attempts

DOMAINS = Path(__file__).parents[2] / "domains"
ENGINES: list[Callable[[Tree], Replay]] = [lambda tree: PyTreesReplay(tree, "imported")]
if importlib.util.find_spec("behaviortreepy") is not None:  # there is no wheel of it for some platforms
    ENGINES.append(BtcppReplay)
PROBLEMS = ["doors/to-the-archive", "trolley/with-spares", "charging/one-room", "delivery/letter-for-anna",
            "kitting/gift-set", "inspection/shut-down"]  # fmt: skip
MOST_TICKS = 100


def check(tree: Tree, rate: Fraction, runs: int, seed: int, compared: Compared) -> None:
    expected = perturbed_runs(
        tree.task, tree.root, rate, Limits(), runs=runs, seed=seed, most_ticks=MOST_TICKS
    )
    for make in ENGINES:
        found = perturbed_counts(
            make(tree), tree, rate, Limits(), runs=runs, seed=seed, most_ticks=MOST_TICKS
        )
        assert found.successes == expected.successes
        assert found.missed == expected.missed
        assert found.failures == expected.failures + expected.blocked
        assert found.cut == expected.cut
        assert (found.starts, found.unready) == (expected.starts, expected.unready)
        assert found.changes == expected.changes
        assert found.cost == expected.cost * runs
        compared.add(runs=runs)


@pytest.mark.parametrize("guarded", [False, True])
@pytest.mark.parametrize("problem", PROBLEMS)
def test_both_engines_count_what_the_sampling_counts(
    problem: str, guarded: bool, record_property: Callable[[str, object], None]
) -> None:
    domain = DOMAINS / problem.partition("/")[0] / "domain.pddl"
    tree = bbtc.plan(domain, DOMAINS / f"{problem}.pddl", guarded=guarded, retries="least").tree
    compared = Compared(record_property, "perturbed runs of the domains' trees")
    check(tree, Fraction(1, 5), amount(100, 5000), 3, compared)


def test_both_engines_count_what_the_sampling_counts_of_random_trees(
    record_property: Callable[[str, object], None],
) -> None:
    compared = Compared(record_property, "perturbed runs of random trees")
    for seed in range(500 if LONG else 25):
        tree = random_tree(seed)
        tree = tree if seed % 4 else with_attempts(tree, seed)
        check(tree, Fraction(1, 3), 30, seed, compared)
