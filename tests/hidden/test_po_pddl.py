"""The forms of PO-PDDL and of the competition of 2011, beside the same said in our own words."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from bbtc.diagnostics import BbtcError
from bbtc.limits import Limits
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from tests.ground.examples import task_of

SENSOR = """(:observation yes :condition (heads) :distribution (probabilistic {q} (o) {r} (not (o))))
  (:observation no :condition (not (heads)) :distribution (probabilistic {r} (o) {q} (not (o))))"""
COIN = """(define (domain coin) (:predicates (heads) (called) (won))
  (:observables (o))
  (:action look)
  (:action toss :effect (probabilistic 0.3 (heads) 0.7 (not (heads))))
  (:action call :precondition (and (heads) (not (called))) :effect (and (called) (won)))
  {sensor})
(define (problem p) (:domain coin) (:init {true}) (:init-belief {belief}) (:goal (won)))"""
OWN = """(define (domain coin) (:predicates (heads) (called) (won))
  (:action look :observe (probabilistic {q} (heads)))
  (:action toss :effect (probabilistic 0.3 (heads) 0.7 (not (heads))) :observe (probabilistic {q} (heads)))
  (:action call :effect (when (and (heads) (not (called))) (and (called) (won)))
    :observe (probabilistic {q} (heads))))
(define (problem p) (:domain coin) (:init (probabilistic {prior} (heads))) (:goal (won)))"""


def values(text: str) -> list[Fraction]:
    """The best probability within up to four actions, of which the last is to stop."""
    task = task_of(text)
    found = [task_value(task, Limits(), Options(max_actions=k, allow_guess=True)) for k in range(1, 5)]
    assert all(each.lower == each.upper for each in found)
    return [each.lower for each in found]


@pytest.mark.parametrize(
    ("q", "r", "prior"), [("0.8", "0.2", "0.5"), ("0.6", "0.4", "0.2"), ("1", "0", "0.5")]
)
def test_observations_and_failing_actions_are_those_of_our_own_language(q: str, r: str, prior: str) -> None:
    text = COIN.format(sensor=SENSOR.format(q=q, r=r), true="(heads)", belief=f"(prob (heads) {prior})")
    assert values(text) == values(OWN.format(q=q, prior=prior))


@pytest.mark.parametrize(("q", "r"), [("0.9", "0.4"), ("0.6", "0.05"), ("1", "0.3"), ("0.7", "0")])
def test_observations_may_err_more_often_one_way(q: str, r: str) -> None:
    """``o`` is told with q where it is heads, and with r where it is not."""
    sensor = f"""(:observation yes :condition (heads) :distribution (probabilistic {q} (o)))
      (:observation no :condition (not (heads)) :distribution (probabilistic {r} (o)))"""
    own = OWN.replace(
        "(probabilistic {q} (heads))", f"(probabilistic {q} (heads) {1 - Fraction(r)} (not (heads)))"
    )
    found = values(COIN.format(sensor=sensor, true="", belief="(prob (heads) 0.3)"))
    assert found == values(own.format(prior="0.3"))
    assert found[1] > found[0]


@pytest.mark.parametrize("true", ["", "(heads)", "(called)"])
def test_what_is_true_never_touches_the_prior(true: str) -> None:
    text = COIN.format(sensor=SENSOR.format(q="0.8", r="0.2"), true=true, belief="(prob (heads) 0.5)")
    tasks = [
        replace(task_of(each), true_worlds=()) for each in (text, text.replace(f"(:init {true})", "(:init)"))
    ]
    assert tasks[0] == tasks[1]


def test_joint_beliefs_are_drawn_together() -> None:
    domain = OWN.partition("(define (problem")[0].format(q="0.8").replace("(won))", "(won) (flag))", 1)
    text = (
        domain
        + """(define (problem p) (:domain coin) (:init) (:init-belief
      (joint 0.25 (and (heads) (flag))) (joint 3/4 (and (not (heads)) (not (flag)))) (prob (called) 0.0))
      (:goal (and (heads) (flag))))"""
    )
    (component,) = task_of(text).components
    assert sorted(component.facts) == ["flag()", "heads()"]
    assert dict(component.prior) == {0: Fraction(3, 4), 3: Fraction(1, 4)}


def test_an_observation_of_an_action_is_made_after_it_alone() -> None:
    text = """(define (domain d) (:predicates (a) (b) (done)) (:observations (oa) (ob))
      (:action look :observation (and
        (when (and (not (a))) (probabilistic 1.0 (not (oa)))) (when (and (a)) (probabilistic 1.0 (oa)))
        (when (b) (probabilistic 0.9 (ob) 0.1 (not (ob))))
        (when (not (b)) (probabilistic 0.1 (ob) 0.9 (not (ob))))))
      (:action wait :effect (and))
      (:action end :precondition (and (a) (b)) :effect (done)))
    (define (problem p) (:domain d) (:init-belief (prob (a) 0.5) (prob (b) 0.5)) (:goal (done)))"""
    task = task_of(text)
    told = {
        action.name: sum(len(change.observations) for change in action.changes) for action in task.actions
    }
    assert told["look()"] == 2
    assert {name for name, count in told.items() if count} == {"look()"}
    accuracies = [
        each.accuracy for action in task.actions for change in action.changes for each in change.observations
    ]
    assert sorted(accuracies) == [Fraction(9, 10), 1]


def test_who_fails_pays_all_the_same() -> None:
    """A door may be stuck; who pushes it learns nothing, and two pushes cost two."""
    text = """(define (domain d) (:predicates (stuck) (open) (through)) (:observables (clear))
      (:action push :precondition (not (stuck)) :effect (open))
      (:action oil :effect (not (stuck)))
      (:observation see :condition (open) :distribution (clear))
      (:observation not_see :condition (not (open)) :distribution (not (clear))))
    (define (problem p) (:domain d) (:init-belief (prob (stuck) 0.5)) (:goal (open)))"""
    found = task_value(task_of(text), Limits(), costs=True)
    assert (found.lower, found.cost) == (1, 2)


@pytest.mark.parametrize(
    ("sensor", "belief", "code"),
    [
        (SENSOR.format(q="0.8", r="0.3"), "", "BBT0211"),
        ("(:observation yes :condition (heads) :distribution (probabilistic 0.8 (o)))", "", None),
        (SENSOR.format(q="0.8", r="0.2").replace("(probabilistic 0.2", "(probabilistic 0.1"), "", None),
        (SENSOR.format(q="0.8", r="0.2") + """
          (:observation odd :condition (and (heads) (called)) :distribution (probabilistic 0.5 (o)))""",
         "", "BBT0421"),
        ("(:observation y :distribution (probabilistic 0.8 (o) 0.2 (won)))", "", "BBT0421"),
        ("(:observation y :distribution (probabilistic 0.8 (and (o) (won))))", "", "BBT0421"),
        ("(:observation y :condition (known (heads)) :distribution (o))", "", "BBT0406"),
        ("(:observation y :condition (heads))", "", "BBT0111"),
        ("", "(prob (heads) 1.5)", "BBT0210"),
        ("", "(joint 0.5 (heads)) (joint 0.4 (not (heads)))", "BBT0211"),
        ("", "(joint 1 (or (heads) (won)))", "BBT0101"),
        ("", "(prob (tails) 0.5)", "BBT0202"),
        ("", "(heads)", "BBT0101"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told(sensor: str, belief: str, code: str | None) -> None:
    text = COIN.format(sensor=sensor, true="", belief=belief or "(prob (heads) 0.5)")
    if code is None:
        assert task_of(text).actions
        return
    with pytest.raises(BbtcError) as caught:
        task_of(text)
    assert code in {each.code for each in caught.value.diagnostics}
