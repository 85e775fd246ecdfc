"""What is possible at all, as the text of a problem alone says it, on random texts; and plans for them."""

from __future__ import annotations

from collections import Counter

import pytest

from bbtc.artefacts import dumps, tree_to_json
from bbtc.diagnostics import BbtcError, LimitReached, Report, Severity
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, simulate_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from tests.domains.lifted import Lifted, TooLarge
from tests.domains.lifted_tree import Endless, TreeOnText
from tests.domains.random_texts import random_text
from tests.long_form import amount

_GROUP = 50
_IN_REACH = 1e-8
_STRATEGIES = ("search", "policy", "auto")
_LIMITS = Limits(states=3_000, nodes=60)


def _compiled(text: str) -> tuple[Task | None, set[str]]:
    """The task of a text, or the codes of its errors."""
    try:
        return compile_sources([SourceFile("random.pddl", text)], Report(), Limits()), set()
    except BbtcError as error:
        return None, {each.code for each in error.diagnostics if each.severity is Severity.ERROR}


def compare(seed: int) -> str:
    """How far a text was compared: it is ``too large``, ``hopeless``, has a ``value``, or also a ``tree``."""
    text = random_text(seed)
    lifted = Lifted.of(text)
    try:
        space = lifted.space
    except TooLarge:
        return "too large"
    expected = space.mean(space.best)
    task, codes = _compiled(text)
    if task is None:
        assert (codes, expected) == ({"BBT0412"}, 0), text
        return "hopeless"
    found = task_value(task, Limits(), costs=True)
    assert found.lower == found.upper, text
    assert float(found.lower) == pytest.approx(expected, abs=_IN_REACH), text
    for steps, best in zip((1, 3), space.within(1, 3), strict=True):
        within = task_value(task, Limits(), Options(max_actions=steps))
        assert within.lower == within.upper == best, text
    cost = space.least_cost()
    if cost is not None:
        assert found.cost is not None
        assert float(found.cost) == pytest.approx(cost, rel=1e-6), text
    return _compare_tree(text, lifted, task, _STRATEGIES[seed % len(_STRATEGIES)], expected)


def _compare_tree(text: str, lifted: Lifted, task: Task, strategy: str, best: float) -> str:
    """A tree does what it claims, starts actions only where the text allows it, and reaches its goal."""
    try:
        # Templates are what one strategy alone inserts.
        chosen = "refine" if task.templates else strategy
        tree = plan_task(task, None, chosen, _LIMITS, lambda _: None).tree
        runs = TreeOnText(lifted, dumps(tree_to_json(tree))).runs()
    except (LimitReached, Endless, TooLarge):
        return "value"
    assert runs.faults == [], text
    figures = simulate_tree(tree, Limits())[0]
    claimed = (tree.success_probability, figures.failure, figures.blocked, figures.cost)
    assert claimed == (runs.success, runs.failure, runs.blocked, runs.cost), text
    assert runs.success <= best + _IN_REACH, text
    return "tree"


@pytest.mark.parametrize("group", range(amount(7, 400)))
def test_random_texts_have_the_values_that_their_words_give_them(group: int) -> None:
    """Best probability, within budgets too, least cost, and the runs of a tree; the goal is refused only
    where it is hopeless."""
    done = Counter(compare(seed) for seed in range(group * _GROUP, (group + 1) * _GROUP))
    assert done["value"] + done["tree"] > _GROUP / 5
    assert done["tree"] > _GROUP / 10
