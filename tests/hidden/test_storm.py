"""Storm finds in the PRISM text of a tree what the worlds of its text say, where facts are hidden."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import pytest
from hypothesis import Phase, given, settings

from bbtc.artefacts import dumps, tree_to_json
from bbtc.diagnostics import BbtcError, LimitReached
from bbtc.limits import Limits
from bbtc.pipeline import export_tree, plan_task, simulate_tree
from bbtc.verifier import storm_worker
from tests.domains.lifted import TooLarge
from tests.ground.examples import task_of
from tests.hidden.reference import HiddenText
from tests.hidden.texts import texts
from tests.hidden.tree_on_beliefs import TreeOnBeliefs, formulas_of
from tests.long_form import amount
from tests.profiles import examples

pytest.importorskip("stormpy", reason="Storm is not installed: pip install 'bbtc[storm]'")

_ASKED = ['P=? [F "success"]', 'P=? [F "failure"]', 'R{"actions"}=? [F "finished"]']


def test_the_text_of_a_tree_is_worth_what_the_worlds_say() -> None:
    """The text holds tables in place of worlds: Storm knows of neither."""
    many = amount(42, 1_500)
    done: Counter[bool] = Counter()

    @settings(examples(many), phases=[Phase.generate])
    @given(texts())
    def look(text: str) -> None:
        reference = HiddenText.of(text)
        try:
            if not reference.prior:
                return
            reference.mdp(60)
            task = task_of(text)
            tree = plan_task(task, None, "policy", Limits(states=500, nodes=40), lambda _: None).tree
            runs = TreeOnBeliefs(reference, dumps(tree_to_json(tree)), formulas_of(tree.task)).ends()
        except (BbtcError, LimitReached, TooLarge):
            return
        written = export_tree(tree, "prism", {}, Limits())
        found = storm_worker.answer({"program": written, "properties": _ASKED})
        assert found["exact"], text
        success, failure, actions = (None if low is None else Fraction(low) for low, _ in found["values"])
        assert (success, failure) == (runs.success, runs.failure), text
        assert actions == simulate_tree(tree, Limits())[0].actions, text
        done[0 < runs.success < 1] += 1

    look()
    assert done[True] > many / 10
    assert sum(done.values()) > many / 3
