"""Components that can do without worlds: the task without them is worth as much."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import assume, given

import bbtc
from bbtc.belief.lowering import lowered
from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import Is
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from tests.domains.lifted import TooLarge
from tests.ground.examples import task_of
from tests.hidden.reference import HiddenText
from tests.hidden.texts import texts
from tests.long_form import amount
from tests.profiles import examples

CORRIDOR = """(define (domain d) (:types road) (:predicates (clear ?r - road) (home))
  (:action look :parameters (?r - road) :observe (clear ?r))
  (:action drive :parameters (?r - road) :precondition (clear ?r) :effect (home)))
(define (problem x) (:domain d) (:objects left right - road)
  (:init (oneof (clear left) (clear right))) (:goal (home)))"""


def test_a_pair_of_which_one_holds_becomes_an_observation_of_both() -> None:
    """A look is what a domain without hidden facts would say: under `(unknown (clear left))`, a coin."""
    task = lowered(task_of(CORRIDOR), Limits())
    assert task.components == ()
    names = [variable.name for variable in task.variables]
    assert names == ["clear(left)", "clear(right)", "home()"]
    look = task.action_by_name["look(left)"]
    assert look.changes == ()
    (factor,) = look.factors
    seen = {outcome.effects[0].sets: outcome.probability for outcome in factor.outcomes}
    yes, no = ((0, Truth.TRUE), (1, Truth.FALSE)), ((0, Truth.FALSE), (1, Truth.TRUE))
    assert seen == {yes: Fraction(1, 2), no: Fraction(1, 2)}
    assert {outcome.effects[0].when for outcome in factor.outcomes} == {Is(0, Truth.UNKNOWN)}


def test_noise_is_not_lowered() -> None:
    text = CORRIDOR.replace(":observe (clear ?r)", ":observe (probabilistic 0.9 (clear ?r))")
    assert len(lowered(task_of(text), Limits()).components) == 1


def _figures(task: Task) -> tuple[Fraction, Fraction, Fraction | None]:
    value = bbtc.bounds(task, costs=True)
    return value.lower, value.upper, value.cost


@given(texts())
@examples(amount(21, 600))
def test_the_task_without_components_is_worth_as_much(text: str) -> None:
    try:
        HiddenText.of(text).mdp(150)
        task = task_of(text)
    except (BbtcError, TooLarge):  # no goal to reach, or no world; or beliefs without end
        assume(False)
    other = lowered(task, Limits())
    assume(len(other.components) < len(task.components))
    assert _figures(other) == _figures(task)
