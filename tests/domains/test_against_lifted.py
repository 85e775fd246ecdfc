"""What is possible at all, as the text of a problem alone says it, on random texts."""

from __future__ import annotations

import pytest

from bbtc.diagnostics import BbtcError, Report, Severity
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.plan.bounds import task_value
from bbtc.plan.options import Options
from bbtc.source import SourceFile
from tests.domains.lifted import Lifted, TooLarge, mean
from tests.domains.random_texts import random_text
from tests.long_form import amount

_GROUP = 50
_IN_REACH = 1e-8


def _compiled(text: str) -> tuple[Task | None, set[str]]:
    """The task of a text, or the codes of its errors."""
    try:
        return compile_sources([SourceFile("random.pddl", text)], Report(), Limits()), set()
    except BbtcError as error:
        return None, {each.code for each in error.diagnostics if each.severity is Severity.ERROR}


@pytest.mark.parametrize("group", range(amount(8, 200)))
def test_random_texts_have_the_values_that_their_words_give_them(group: int) -> None:
    """Best probability, within budgets too, and least cost; the goal is refused only where it is hopeless."""
    compared = 0
    for seed in range(group * _GROUP, (group + 1) * _GROUP):
        text = random_text(seed)
        lifted = Lifted.of(text)
        try:
            best = lifted.best()
        except TooLarge:
            continue
        expected = mean(lifted.start(), best)
        task, codes = _compiled(text)
        if task is None:
            assert (codes, expected) == ({"BBT0412"}, 0), text
            continue
        found = task_value(task, Limits(), costs=True)
        assert found.lower == found.upper, text
        assert float(found.lower) == pytest.approx(expected, abs=_IN_REACH), text
        for steps in (1, 3):
            within = task_value(task, Limits(), Options(max_actions=steps))
            assert within.lower == within.upper == lifted.within(steps), text
        cost = lifted.least_cost(best)
        if cost is not None:
            assert found.cost is not None
            assert float(found.cost) == pytest.approx(cost, rel=1e-6), text
        compared += 1
    assert compared > _GROUP / 5
