"""The generator of service-robot problems: what it writes, and that size does not show in the trees."""

from __future__ import annotations

import pytest

from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.rewrite.simplify import size
from bbtc.source import SourceFile
from tests.benchmarks.service_robot import FOLDER, generator
from tests.domains.problems import Problem, task_of


def generated(items: int, places: int, **more: object) -> Task:
    domain = read_source(str(FOLDER / "domain.pddl"))
    text = generator().problem(items, places, **more)
    return compile_sources([domain, SourceFile("problem.pddl", text)], Report(), Limits())


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("three-goals", lambda: generated(8, 4, pieces=10)),
        ("two-goals", lambda: generated(3, 4, goals=2, pieces=6, target="0.95")),
    ],
)
def test_the_problems_are_those_of_the_generator(name: str, made) -> None:  # type: ignore[no-untyped-def]
    kept, now = task_of(Problem("service-robot", name)), made()
    assert (kept.variables, kept.initial, kept.goal, kept.actions, kept.goal_probability) == (
        now.variables,
        now.initial,
        now.goal,
        now.actions,
        now.goal_probability,
    )


@pytest.mark.parametrize(("items", "places", "least"), [(120, 4, 990), (345, 10, 6900)])
def test_a_task_of_thousands_of_actions_gives_a_tree_of_tens_of_nodes(
    items: int, places: int, least: int
) -> None:
    task = generated(items, places)
    assert len(task.actions) >= least
    plan = plan_task(task, None, "auto", Limits(), lambda _: None)
    assert plan.tree.status == "target-reached"
    assert size(plan.tree.root) < 100
