"""Recovery: what trees attain from any state, beside value iteration and the chain of a plain interpreter."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import pytest

import bbtc
from bbtc.disturbance.recovery import Recovery
from bbtc.ground.describe import describe
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree
from tests.cli.program import bbtc as program
from tests.disturbance.reference import Exact, best_chances, reachable
from tests.long_form import amount
from tests.replay.random_trees import random_tree

DOMAINS = Path(__file__).parents[2] / "domains"
NEAR = 1e-6
PROBLEMS = ["doors/to-the-lab", "trolley/with-spares", "charging/one-room", "delivery/letter-for-anna",
            "kitting/one-bottle", "warehouse/one-order", "household/look-for-soda"]  # fmt: skip


def files(problem: str) -> tuple[Path, Path]:
    return DOMAINS / problem.partition("/")[0] / "domain.pddl", DOMAINS / f"{problem}.pddl"


def compare(task: Task, root: Node, found: Recovery, ticks: int) -> None:
    states = reachable(task)
    assert states is not None
    assert found.states == found.taken == len(states)
    best = best_chances(task, states)
    exact = Exact(task, root, 0.0, lambda state: [])
    ratios, totals = [], dict.fromkeys(("missed", "endless", "lost", "given up"), 0.0)
    for state in states:
        if not best[state]:
            continue
        chances = exact.chances(ticks, state)
        ratios.append(chances["success"] / best[state])
        totals["missed"] += chances["missed"]
        totals["endless"] += chances["cut"]
        for stop, chance in exact.stops.items():
            totals["given up" if best[stop] else "lost"] += chance
    hopeful = len(ratios)
    assert found.hopeful == hopeful
    assert found.attained == sum(ratio > 1 - 1e-10 for ratio in ratios)
    assert abs(float(found.mean) - (sum(ratios) / hopeful if hopeful else 1)) < NEAR
    worst = 1 if found.worst is None else float(found.worst.success / found.worst.best)
    assert abs(worst - min(ratios, default=1)) < NEAR
    given_up = sum((each.share for each in found.given_up), Fraction(0))
    shares = {"missed": found.missed, "endless": found.endless, "lost": found.lost, "given up": given_up}
    for kind, share in shares.items():
        assert abs(float(share) - totals[kind] / max(1, hopeful)) < NEAR, kind
    order = [each.share for each in found.given_up]
    assert order == sorted(order, reverse=True)


@pytest.mark.parametrize("guarded", [False, True])
@pytest.mark.parametrize("problem", PROBLEMS)
def test_figures_are_those_of_value_iteration_and_of_a_plain_interpreter(problem: str, guarded: bool) -> None:
    tree = bbtc.plan(*files(problem), guarded=guarded).tree
    found = bbtc.recovery(tree)
    compare(tree.task, tree.root, found, 300)
    assert bool(found.lost) == problem.startswith(("kitting", "warehouse")), "there things break for good"


def test_figures_of_random_trees_are_those_of_value_iteration_and_of_a_plain_interpreter() -> None:
    kinds = dict.fromkeys(("hopeless", "missed", "endless", "given_up", "attained"), 0)
    for seed in range(amount(80, 2000)):
        tree = random_tree(seed, guarded=0.5)
        found = bbtc.recovery(tree)
        compare(tree.task, tree.root, found, 500)
        for kind in kinds:
            kinds[kind] += bool(getattr(found, kind))
    assert all(kinds.values()), kinds


def test_where_it_gives_up_is_told_by_the_fact_that_is_missing() -> None:
    # From the desk, a fresh tree asks at the reception for nobody: the robot has to be there.
    tree = bbtc.plan(*files("delivery/letter-for-anna")).tree
    found = bbtc.recovery(tree)
    told = [describe(tree.task, each.condition) for each in found.given_up if each.condition is not None]
    assert told == ["at(desk12)", "at(reception)"]
    assert found.attained < found.hopeful
    for each in found.given_up:
        assert each.condition is not None
        values = dict(zip((v.name for v in tree.task.variables), each.example, strict=True))
        assert values[describe(tree.task, each.condition)] != 2


def test_a_sample_is_near_to_the_whole_and_says_how_near() -> None:
    tree = bbtc.plan(*files("warehouse/one-order")).tree
    whole = bbtc.recovery(tree)
    assert whole.attained_interval is None is whole.mean_interval
    held = 0
    for seed in range(20):
        found = bbtc.recovery(tree, samples=40, seed=seed)
        assert (found.states, found.taken, found.seed) == (whole.states, 40, seed)
        assert found.attained_interval is not None
        assert found.mean_interval is not None
        share = Fraction(whole.attained, whole.hopeful)
        held += found.attained_interval.lower <= share <= found.attained_interval.upper
        assert found.mean_interval.lower <= whole.mean <= found.mean_interval.upper
        assert found == bbtc.recovery(tree, samples=40, seed=seed)
    assert held >= 18
    assert bbtc.recovery(tree, samples=10_000) == whole


def test_a_task_out_of_reach_has_no_state_to_recover_from() -> None:
    text = """
    (define (domain none) (:predicates (p) (q)) (:action a :effect (p)) (:action b :effect (not (p))))
    (define (problem none) (:domain none) (:init) (:goal (and (p) (not (p)))))
    """
    task = bbtc.compile(bbtc.SourceFile("none.pddl", text))
    root = ControlNode("n1", "fallback", (ConditionNode("n2", task.goal), ActionNode("n3", "a()", True)))
    found = bbtc.recovery(Tree(task, root, Fraction(0), Fraction(1), "stuck"))
    assert (found.hopeless, found.attained, found.mean, found.worst) == (found.states, 0, 1, None)


def test_the_command_writes_the_same(tmp_path: Path) -> None:
    domain, problem = files("household/grasp-soda")
    tree = bbtc.plan(domain, problem).tree
    (tmp_path / "tree.json").write_text(bbtc.dumps(tree), "utf-8")
    own = program("simulate", tmp_path / "tree.json", "--recovery", "--json")
    all_actions = program("simulate", tmp_path / "tree.json", domain, problem, "--recovery", "--json")
    found, few = bbtc.recovery(tree), bbtc.recovery(bbtc.load_tree(tmp_path / "tree.json"))
    assert found.states > few.states
    for run, expected in ((own, few), (all_actions, found)):
        data = json.loads(run.stdout)["recovery"]
        assert (data["states"], data["attained"]) == (expected.states, expected.attained)
        assert Fraction(data["mean"]) == expected.mean
        shares = [Fraction(each["p"]) for each in data["gives_up"]]
        assert shares == [each.share for each in expected.given_up]
    text = program("simulate", tmp_path / "tree.json", "--recovery").stdout
    assert f"recovery from all {few.states} states that its actions lead to" in text


def test_more_states_than_allowed_are_a_limit(tmp_path: Path) -> None:
    tree = bbtc.plan(*files("warehouse/one-order")).tree
    (tmp_path / "tree.json").write_text(bbtc.dumps(tree), "utf-8")
    with pytest.raises(bbtc.LimitReached):
        bbtc.recovery(tree, limits=Limits(states=20))
    with pytest.raises(ValueError):
        bbtc.recovery(tree, samples=0)
