"""Events and interrupted actions on random texts: values, trees and chains, as the text alone says them."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import pytest

from bbtc.artefacts import dumps, load_task, task_to_json, tree_to_json
from bbtc.backends.models.prism import task_text
from bbtc.diagnostics import BbtcError, LimitReached, Report, Severity
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, format_source, plan_task, simulate_tree, verify_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from bbtc.verifier.explore import explore
from bbtc.verifier.process import process_of
from tests.domains.lifted import Lifted, TooLarge
from tests.domains.lifted_tree import Endless, TreeOnText
from tests.domains.random_texts import random_text
from tests.long_form import amount
from tests.verifier.optimum import best_probability

_GROUP = 50
_IN_REACH = 1e-8
_STRATEGIES = ("policy", "auto", "search", "refine")
_LIMITS = Limits(states=3_000, nodes=60)
_STORM_EVERY = 5
_BY_TIME = Fraction(1, 10**7)


def _compiled(text: str) -> tuple[Task | None, set[str]]:
    """The task of a text, or the codes of its errors."""
    try:
        return compile_sources([SourceFile("random.pddl", text)], Report(), Limits()), set()
    except BbtcError as error:
        return None, {each.code for each in error.diagnostics if each.severity is Severity.ERROR}


def compare(seed: int) -> str:
    """How far a text was compared: its events ``contradict`` each other, it is ``too large``, ``hopeless``,
    has a ``value``, or also a ``tree``."""
    text = random_text(seed, events=True)
    task, codes = _compiled(text)
    if task is None and codes != {"BBT0412"}:
        assert codes == {"BBT0451"}, text
        return "contradict"
    lifted = Lifted.of(text)
    if task is not None:  # what matters to nothing, events may set as they like
        lifted.watched = {(each.predicate, *each.args) for each in task.variables}
    try:
        space = lifted.space
    except TooLarge:
        return "too large"
    expected = space.mean(space.best)
    if task is None:
        assert expected == 0, text
        return "hopeless"
    found = task_value(task, Limits(), costs=True)
    assert found.lower == found.upper, text
    assert float(found.lower) == pytest.approx(expected, abs=_near(text)), text
    for steps, best in zip((1, 3), space.within(1, 3), strict=True):
        within = task_value(task, Limits(), Options(max_actions=steps))
        assert within.lower == within.upper, text
        assert _same(text, within.lower, best), text
    cost = space.least_cost()
    if cost is not None:
        assert found.cost is not None
        assert float(found.cost) == pytest.approx(cost, rel=1e-6), text
    assert load_task(SourceFile("task.json", dumps(task_to_json(task)))) == task, text
    printed = format_source(SourceFile("random.pddl", text))
    assert _compiled(printed) == (task, set()), text
    if seed % _STORM_EVERY == 0:
        _ask_others(task, found.lower)
    return _compare_tree(text, lifted, task, _STRATEGIES[seed % len(_STRATEGIES)], expected)


def _near(text: str) -> float:
    return float(_BY_TIME) if ":per second" in text else _IN_REACH


def _same(text: str, one: Fraction | None, other: Fraction | None) -> bool:
    """Exactly; but of what happens by time, the reference knows eight digits."""
    if ":per second" not in text or one is None or other is None:
        return one == other
    return abs(one - other) < _BY_TIME * (1 + abs(other))


def _ask_others(task: Task, best: object) -> None:
    """The verifier's own solver, and Storm where it is installed, on the decision process of the task."""
    assert best_probability(explore(process_of(task), Limits()), Limits()) == best
    assert best_probability(explore(process_of(task, 0), Limits()), Limits()) == best
    try:
        from tests.verifier.test_storm import TASK, ask
    except pytest.skip.Exception:
        return
    assert ask(task_text(task), TASK) == [best]


def _compare_tree(text: str, lifted: Lifted, task: Task, strategy: str, best: float) -> str:
    """A tree does what it claims, starts actions only where the text allows it, and reaches its goal."""
    try:
        tree = plan_task(task, None, strategy, _LIMITS, lambda _: None).tree
    except LimitReached:
        return "value"
    try:
        runs = TreeOnText(lifted, dumps(tree_to_json(tree))).runs()
    except (Endless, TooLarge):
        assert verify_tree(tree, Limits(), "own").problems == (), text
        return "value"
    assert runs.faults == [], text
    figures = simulate_tree(tree, Limits())[0]
    claimed = (tree.success_probability, figures.failure, figures.blocked, figures.cost)
    found = (runs.success, runs.failure, runs.blocked, runs.cost)
    assert all(_same(text, *both) for both in zip(claimed, found, strict=True)), text
    assert runs.success <= best + _near(text), text
    assert verify_tree(tree, Limits(), "own").problems == (), text
    return "tree"


@pytest.mark.parametrize("group", range(amount(1, 60)))
def test_random_texts_with_events_have_the_values_that_their_words_give_them(group: int) -> None:
    """Best probability, within budgets too, least cost, and the runs of a tree; JSON and layout keep them."""
    done = Counter(compare(seed) for seed in range(group * _GROUP, (group + 1) * _GROUP))
    assert done["value"] + done["tree"] > _GROUP / 5
    assert done["tree"] > _GROUP / 20
