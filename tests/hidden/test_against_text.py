"""What a problem with hidden state is worth, and what a tree for it does, as its text alone says it, on
random texts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from fractions import Fraction

import pytest
from hypothesis import Phase, given, seed, settings
from hypothesis import strategies as st

from bbtc.artefacts import dumps, tree_to_json
from bbtc.diagnostics import BbtcError, LimitReached, Report, Severity
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, verify_tree
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from tests.domains.lifted import TooLarge
from tests.ground.examples import task_of
from tests.hidden.exact_mdp import Mdp
from tests.hidden.reference import HiddenText
from tests.hidden.texts import texts
from tests.hidden.tree_on_beliefs import TreeOnBeliefs, formulas_of
from tests.long_form import amount
from tests.profiles import examples

LIMITS = Limits()
_GROUP = amount(130, 1_000)
_NOISY = amount(45, 500)
"""So many that the shares of each kind are never far from the mean."""
_PLANNED = amount(22, 1_000)
_MOST_BELIEFS = 60
_MOST_LOOKED_AT = 400
_STRATEGIES = ("policy", "search", "auto")


def _kind(value: Fraction) -> str:
    return "between" if 0 < value < 1 else f"{value}"


def _task(text: str, limits: Limits = LIMITS) -> Task | None:
    """The task, without components that can do without worlds; None where the goal is out of reach."""
    try:
        return compile_sources([SourceFile("random.pddl", text)], Report(), limits)
    except BbtcError as error:
        errors = {each.code for each in error.diagnostics if each.severity is Severity.ERROR}
        if errors <= {"BBT0412", "BBT0414"}:
            return None
        raise


def _space(reference: HiddenText) -> Mdp | None:
    try:
        return reference.mdp(_MOST_BELIEFS)
    except TooLarge:
        return None


def compare(text: str, limits: Limits = LIMITS) -> str:
    """Compare what a text is worth; tells what P* is like, or why it was not compared."""
    reference = HiddenText.of(text)
    task = _task(text, limits)
    if not reference.prior:
        assert task is None, text
        return "no world"
    space = _space(reference)
    if space is None:
        return "endless" if task is None else _compare_within(text, reference, task, 3)
    if task is None:
        assert space.best[0] == 0, text
        return "0"
    for made in (task, task_of(text, limits)):
        found = task_value(made, Limits(), costs=True)
        assert (found.lower, found.upper) == (space.best[0], space.best[0]), text
        assert found.cost_exact, text
        assert found.cost == space.least_cost(), text
    return _kind(space.best[0])


def _compare_within(text: str, reference: HiddenText, task: Task, steps: int) -> str:
    try:
        best = reference.within(steps, _MOST_LOOKED_AT)
    except TooLarge:
        return "too large"
    found = task_value(task, Limits(), Options(max_actions=steps))
    assert (found.lower, found.upper) == (best, best), text
    return f"within: {_kind(best)}"


def counted(
    number: int, strategy: st.SearchStrategy[str], look: Callable[[str], str], many: int
) -> Counter[str]:
    """How often random texts of a group were what."""
    done: Counter[str] = Counter()

    @seed(number)
    @settings(examples(many), phases=[Phase.generate])
    @given(strategy)
    def each(text: str) -> None:
        done[look(text)] += 1

    each()
    return done


@pytest.mark.parametrize("group", range(amount(1, 8)))
def test_random_texts_are_worth_what_their_words_say(group: int) -> None:
    """P* and the least expected number of actions; where beliefs have no end, within three actions."""
    done = counted(group, texts(), compare, _GROUP)
    compared = done["0"] + done["between"] + done["1"]
    assert compared > _GROUP / 2
    assert done["between"] >= compared / 3
    assert done["within: between"] > 0


def noisy(text: str, limits: Limits = LIMITS) -> str:
    """The same with noise, within four actions."""
    reference = HiddenText.of(text)
    task = _task(text, limits)
    if task is None or not reference.prior:
        return "hopeless"
    return _compare_within(text, reference, task, 4)


@pytest.mark.parametrize("group", range(amount(1, 4)))
def test_random_texts_with_noise_are_worth_what_their_words_say(group: int) -> None:
    """Within four actions, backwards from the last."""
    done = counted(group, texts(noise=True), noisy, _NOISY)
    assert done["within: between"] > _NOISY / 8


# --- trees -----------------------------------------------------------------------------------------


def planned(text: str, strategy: str, limits: Limits = LIMITS) -> str:
    """Plan a tree for a text and compare what it does."""
    reference = HiddenText.of(text)
    if not reference.prior or _space(reference) is None:
        return "endless"
    try:
        task = task_of(text, limits)
        tree = plan_task(task, None, strategy, Limits(states=500, nodes=40), lambda _: None).tree
        runs = TreeOnBeliefs(reference, dumps(tree_to_json(tree)), formulas_of(tree.task)).ends()
    except (BbtcError, LimitReached, TooLarge):
        return "none"
    assert runs.faults == [], text
    assert runs.success_without_goal == 0, text
    assert runs.success == tree.success_probability, text
    verdict = verify_tree(tree, Limits(), "own")
    assert verdict.problems == (), text
    assert verdict.own is not None
    assert (verdict.own.success, verdict.own.failure, verdict.own.blocked) == (
        runs.success,
        runs.failure,
        runs.blocked,
    ), text
    return _kind(runs.success)


@pytest.mark.parametrize("strategy", _STRATEGIES)
def test_trees_do_on_the_worlds_of_the_text_what_they_claim(strategy: str) -> None:
    number = _STRATEGIES.index(strategy)
    done = counted(number, texts(), lambda text: planned(text, strategy), _PLANNED)
    assert done["between"] + done["1"] > _PLANNED / 4
    assert done["between"] > 0
