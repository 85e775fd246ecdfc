"""Whether a derived predicate is known: where it is the same in every world still possible."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from bbtc.diagnostics import BbtcError, LimitReached
from bbtc.limits import Limits
from bbtc.planner.bounds import TaskValue, task_value
from bbtc.planner.options import Options
from tests.ground.examples import task_of
from tests.hidden.texts import ATOMS, HIDDEN, conditions, texts
from tests.long_form import amount
from tests.profiles import examples

BOXES = """
(define (domain boxes)
  (:predicates (in ?b) (lamp) (opened) (derived-one) (have) (derived-two) (third ?b))
  (:derived (derived-one) (exists (?b) (in ?b)))
  (:derived (derived-two) (and (in left) (lamp)))
  (:derived (third ?b) (or (in ?b) (and (in left) (in right))))
  (:action switch :effect (lamp))
  (:action unswitch :effect (not (lamp)))
  (:action look :precondition (lamp) :observe (in left))
  (:action open :precondition {asked} :effect (opened)))
(define (problem two) (:domain boxes) (:objects left right)
  (:init {lamp} (oneof (in left) (in right))) (:goal (opened)))
"""


@pytest.mark.parametrize(
    ("asked", "lamp", "cost"),
    [
        ("(known (derived-one))", "", 1),
        ("(unknown (derived-one))", "", None),
        ("(known (derived-two))", "", 1),  # there is no light
        ("(known (derived-two))", "(lamp)", 2),  # by putting it out, or by looking
        ("(unknown (derived-two))", "", 2),
        ("(unknown (derived-two))", "(lamp)", 1),
        ("(and (lamp) (known (derived-two)))", "", 3),
        ("(known (third right))", "(lamp)", 2),
        ("(forall (?b) (unknown (third ?b)))", "", 1),
        ("(not (known (third left)))", "", 1),
        ("(or (known (third left)) (unknown (derived-one)))", "", 3),
    ],
)
def test_what_is_so_in_every_world_is_known(asked: str, lamp: str, cost: int | None) -> None:
    """One of the boxes has it: that is known, though of none of them; and of what needs light it is known to
    be false without."""
    text = BOXES.format(asked=asked, lamp=lamp)
    found = task_value(task_of(text), Limits(), costs=True)
    if cost is None:
        assert found.upper == 0
    else:
        assert (found.lower, found.cost) == (1, cost)


def _value(text: str) -> TaskValue | None:
    """P*, the least cost; None where the goal is out of reach, or there is too much."""
    try:
        found = task_value(task_of(text), Limits(states=300), Options(max_actions=4))
    except (BbtcError, LimitReached):
        return None
    return found if found.lower == found.upper else None


def test_an_action_that_asks_is_two_that_know() -> None:
    """One may be done where the condition behind it is known to be true, one where it is known to be
    false."""
    many = amount(60, 3_000)
    done: Counter[str] = Counter()

    @settings(examples(many), phases=[Phase.generate])
    @given(texts(), conditions(ATOMS), st.sampled_from(HIDDEN))
    def look(text: str, condition: str, fact: str) -> None:
        effect = f":effect (and ({fact}) (s) (not (t)))"
        asking = f"(:derived (d1) {condition}) (:action ask :precondition (known (d1)) {effect})"
        two = "".join(
            f"(:action {name} :precondition {needs} {effect})"
            for name, needs in (("yes", condition), ("no", f"(not {condition})"))
        )
        one, other = (
            _value(text.replace("(:action mark", f"{each} (:action mark")) for each in (asking, two)
        )
        if one is None or other is None:
            return
        assert one.lower == other.lower, (condition, text)
        done["between" if 0 < one.lower < 1 else "sure"] += 1

    look()
    assert done["between"] > many / 20
    assert Fraction(sum(done.values())) > many / 4
