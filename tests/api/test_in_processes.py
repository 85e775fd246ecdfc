"""Functions, results and errors go from process to process: pools, joblib, dask, pickle."""

from __future__ import annotations

import concurrent.futures
import copy
import multiprocessing
import pickle
from dataclasses import replace
from pathlib import Path

import pytest

import bbtc
from bbtc.ground.condition import TRUE, And, Condition, Not, Or
from bbtc.planner.result import Plan
from bbtc.tree.deep import stack_room
from bbtc.tree.nodes import ConditionNode, ControlNode, Node

HOUSEHOLD = Path(__file__).parents[2] / "domains" / "household"
DOMAIN, PROBLEM = HOUSEHOLD / "domain.pddl", HOUSEHOLD / "look-for-soda.pddl"


def bell(number: int) -> bbtc.SourceFile:
    """A bell that rings with a chance of its own each time it is tried: no two plans are alike."""
    text = (
        "(define (domain bell) (:predicates (rung) (open)) (:action unlock :effect (open))"
        f" (:action ring :precondition (open) :effect (probabilistic {number}/{number + 1} (rung))))"
        f"(define (problem p{number}) (:domain bell) (:goal (rung)) (:goal-probability 0.99))"
    )
    return bbtc.SourceFile(f"bell-{number}", text)


BELLS = [bell(number) for number in range(1, 11)]
BROKEN = bbtc.SourceFile(
    "broken", "(define (domain d) (:predicates (a)) (:action go :precondition (b) :effect (c)))"
)


@pytest.fixture(scope="module")
def one_by_one() -> list[Plan]:
    plans = [bbtc.plan(source) for source in BELLS]
    assert len({plan.figures.cost for plan in plans}) == len(plans) == 10
    return plans


# --- pools -----------------------------------------------------------------------------------


def test_a_pool_of_processes_plans(one_by_one: list[Plan]) -> None:
    fresh = multiprocessing.get_context("spawn")  # these inherit nothing: all goes through pickle
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=fresh) as pool:
        assert list(pool.map(bbtc.plan, BELLS)) == one_by_one
        with pytest.raises(bbtc.BbtcError) as error:
            pool.submit(bbtc.plan, BROKEN).result()
    with pytest.raises(bbtc.BbtcError) as here:
        bbtc.plan(BROKEN)
    assert [d.render() for d in error.value.diagnostics] == [d.render() for d in here.value.diagnostics]


def test_joblib_plans(one_by_one: list[Plan]) -> None:
    joblib = pytest.importorskip("joblib", reason="joblib is not installed")
    assert joblib.Parallel(n_jobs=2)(joblib.delayed(bbtc.plan)(source) for source in BELLS) == one_by_one


def test_dask_plans(one_by_one: list[Plan], tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="dask's scheduler is not installed")
    with (
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            local_directory=tmp_path,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert client.gather(client.map(bbtc.plan, BELLS)) == one_by_one


# --- pickles ---------------------------------------------------------------------------------


def carried(value: object) -> object:
    """The value after a journey, by the protocols that pools use."""
    first, last = (pickle.loads(pickle.dumps(value, protocol)) for protocol in (2, pickle.HIGHEST_PROTOCOL))
    assert type(first) is type(last) is type(value)
    assert first == last
    return last


@pytest.mark.parametrize("name", sorted(set(bbtc.__all__) - {"__version__"}))
def test_what_the_package_names_is_pickled_by_its_name(name: str) -> None:
    value = getattr(bbtc, name)
    assert pickle.loads(pickle.dumps(value)) is value


def test_results_come_back_as_they_went() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM)
    other = bbtc.plan(DOMAIN, PROBLEM, target=0.5)
    results: list[object] = [
        plan,
        plan.tree,
        plan.tree.task,
        plan.figures,
        bbtc.verify(plan),
        bbtc.verify(replace(plan.tree, success_probability=other.tree.success_probability)),  # a problem
        bbtc.bounds(DOMAIN, PROBLEM, costs=True),
        bbtc.scenarios(plan, 3),
        bbtc.diff(other, plan),
        bbtc.export(plan, "btcpp_project"),
        bbtc.Limits(seconds=3, nodes=5),
    ]
    for result in results:
        assert carried(result) == result
        assert copy.deepcopy(result) == result
    model = pickle.loads(
        pickle.dumps(bbtc.load(DOMAIN, PROBLEM))
    )  # its places are equal only in the same text
    assert isinstance(model, bbtc.Model)
    assert bbtc.compile(model) == plan.tree.task


@pytest.mark.parametrize("kind", [bbtc.BbtcError, bbtc.LimitReached])
def test_an_error_keeps_its_diagnostics(kind: type[bbtc.BbtcError]) -> None:
    diagnostics = bbtc.check(BROKEN)
    assert len(diagnostics) > 1
    error = pickle.loads(pickle.dumps(kind(diagnostics)))
    assert type(error) is kind
    assert [d.render() for d in error.diagnostics] == [d.render() for d in diagnostics]
    assert str(error) == str(kind(diagnostics))


def test_a_tree_of_every_depth_is_pickled() -> None:
    plan = bbtc.plan(DOMAIN, PROBLEM)
    condition: Condition = plan.tree.task.goal
    for level in range(80):
        condition = Not(condition) if level % 3 else (And, Or)[level % 2]((condition, TRUE))
    node: Node = ConditionNode("deep", condition)
    for level in range(255):
        beside = (ConditionNode(f"c{level}", plan.tree.task.goal),) * (level % 3)
        attempts = 7 if level == 9 else None
        node = ControlNode(f"n{level}", "retry", (node,), attempts=attempts) if attempts else ControlNode(
            f"n{level}", "fallback", (*beside, node, *beside), f"name {level}", "template", "reason"
        )  # fmt: skip
    tree = replace(plan.tree, root=node)
    there = pickle.loads(pickle.dumps(tree))
    with stack_room():  # for the comparison, which does recurse
        assert there == tree
    assert carried(ControlNode("empty", "sequence", ())) == ControlNode("empty", "sequence", ())
