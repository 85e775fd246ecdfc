"""What hidden facts do to a task: figures worked out by hand."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

import bbtc
from bbtc.belief.lowering import lowered
from bbtc.ground.task import Task
from bbtc.limits import Limits
from tests.ground.examples import task_of
from tests.long_form import amount


def best(task: Task) -> tuple[Fraction, Fraction]:
    """P* and the least expected cost of attaining it."""
    value = bbtc.bounds(task, costs=True)
    assert value.lower == value.upper
    assert value.cost is not None
    return value.lower, value.cost


SEARCH = """(define (domain search) (:types place)
  (:predicates (at ?p - place) (held))
  (:action look :parameters (?p - place) :observe {})
  (:action take :parameters (?p - place) :precondition (at ?p) :effect (held)))
(define (problem x) (:domain search) (:objects a b c - place)
  (:init {}) (:goal (held)))"""


@pytest.mark.parametrize(
    ("init", "told", "expected"),
    [
        # Two looks settle three places: 1/3 (1 + 1), 1/3 (2 + 1), and after two misses the last is known.
        ("(oneof (at a) (at b) (at c))", "(at ?p)", (1, Fraction(8, 3))),
        # Nothing may be there: 1/8 of the worlds have no goal; places are independent.
        ("(unknown (at a)) (unknown (at b)) (unknown (at c))", "(at ?p)", (Fraction(7, 8), None)),
        # One of them holds something: 4/7 · 2, 2/7 · 3, and the last is known after two looks.
        ("(or (at a) (at b) (at c))", "(at ?p)", (1, Fraction(4, 7) * 2 + Fraction(3, 7) * 3)),
        ("(at b)", "(at ?p)", (1, 1)),
        # What is told of two facts as a whole joins them; of two told one by one, it does not.
        ("(oneof (at a) (at b))", "(or (at ?p) (at b))", (1, 2)),
    ],
)
def test_a_search_costs_what_it_does_by_hand(
    init: str, told: str, expected: tuple[Fraction, Fraction | None]
) -> None:
    probability, cost = best(task_of(SEARCH.format(told, init)))
    assert probability == expected[0]
    assert expected[1] is None or cost == expected[1]


def test_a_formula_is_known_where_its_parts_are_not() -> None:
    """Exactly one of two is true, so `or` is known at once, and a plan need not look."""
    text = """(define (domain d) (:predicates (a) (b) (done)) (:action look :observe (a))
      (:action go :precondition (or (a) (b)) :effect (done)))
      (define (problem x) (:domain d) (:init {}) (:goal (done)))"""
    assert best(task_of(text.format("(oneof (a) (b))"))) == (1, 1)
    assert best(task_of(text.format("(unknown (a)) (unknown (b))")))[0] == Fraction(1, 2)


def test_visible_facts_in_a_formula_are_settled_by_cases() -> None:
    """The lamp shines by the switch that the hidden fact names: whatever it is, with both on."""
    text = """(define (domain d) (:types s) (:predicates (wired ?s - s) (on ?s - s) (done))
      (:action flip :parameters (?s - s) :effect (on ?s))
      (:action trace :parameters (?s - s) :observe (wired ?s))
      (:action read :precondition (exists (?s - s) (and (wired ?s) (on ?s))) :effect (done)))
      (define (problem x) (:domain d) (:objects l r - s)
        (:init (oneof (wired l) (wired r))) (:goal (done)))"""
    # Both switches, then read; a look at the wires costs as much as a second switch.
    assert best(task_of(text)) == (1, 3)


def test_effects_under_hidden_conditions_are_hidden_until_told() -> None:
    text = """(define (domain d) (:predicates (ill) (red) (cured))
      (:action test :effect (when (ill) (red)))
      (:action read :observe (red))
      (:action treat :precondition (ill) :effect (cured))
      (:action discharge :precondition (not (ill)) :effect (cured)))
      (define (problem x) (:domain d) (:init (unknown (ill))) (:goal (cured)))"""
    assert best(task_of(text)) == (1, 3)


def test_what_is_observed_and_left_to_chance_is_not_seen() -> None:
    """An egg that may be bad is smelled; without that, nobody knows."""
    text = """(define (domain d) (:predicates (bad) (have) (eaten))
      (:action get :precondition (not (have)) :effect (and (have) (oneof (bad) (not (bad)))))
      (:action smell :precondition (have) :observe (bad))
      (:action throw :precondition (have) :effect (not (have)))
      (:action eat :precondition (and (have) (not (bad))) :effect (eaten)))
      (define (problem x) (:domain d) (:init) (:goal (eaten)))"""
    task = task_of(text)
    assert [component.facts for component in task.components] == [("bad()",)]
    # get, smell, and with 1/2 throw and again: x = 2 + 1/2 (1 + x) + 1/2.
    assert best(task) == (1, 6)


def test_noise_tells_nothing_for_sure() -> None:
    text = """(define (domain tiger) (:predicates (left) (out))
      (:action listen :observe (probabilistic 0.85 (left)))
      (:action open :precondition (left) :effect (out)))
      (define (problem x) (:domain tiger) (:init (unknown (left))) (:goal (out)))"""
    task = task_of(text)
    (component,) = task.components
    assert component.prior == ((0, Fraction(1, 2)), (1, Fraction(1, 2)))
    (observation,) = task.action_by_name["listen()"].changes[0].observations
    assert observation.accuracy == Fraction(17, 20)


CAVE = """(define (domain cave) (:types cell)
  (:predicates (at ?c - cell) (joined ?a ?b - cell) (pit ?c - cell) (breeze ?c - cell))
  (:action walk :parameters (?a ?b - cell)
    :precondition (and (at ?a) (joined ?a ?b) (not (pit ?b))) :effect (and (not (at ?a)) (at ?b)))
  (:sensor skin :parameters (?c - cell) :condition (at ?c) :sense (breeze ?c)))
(define (problem x) (:domain cave) (:objects m l r e - cell)
  (:init (at m) (joined m l) (joined m r) (joined l e) (joined r e) {}) (:goal (at e)))"""


@pytest.mark.parametrize(
    ("init", "expected"),
    [
        # The breeze at the mouth tells at the start which way is safe.
        ("(oneof (and (pit l) (breeze m)) (pit r))", (1, 2)),
        # Nothing tells: no way is known to be safe, and no walk may start.
        ("(oneof (and (pit l) (breeze l)) (pit r))", (0, 0)),
        # The breeze is felt at the right, which is safe, and tells nothing of use there.
        ("(unknown (breeze r)) (pit l)", (1, 2)),
        # With 1/2 the breeze at the mouth tells that the left is safe.
        ("(oneof (breeze m) (and (pit l) (pit r)))", (Fraction(1, 2), None)),
    ],
)
def test_sensors_tell_at_the_start_and_where_the_robot_comes(
    init: str, expected: tuple[Fraction, Fraction | None]
) -> None:
    for task in (task_of(CAVE.format(init)), lowered(task_of(CAVE.format(init)), Limits())):
        probability, cost = best(task)
        assert probability == expected[0]
        assert expected[1] is None or cost == expected[1]


def test_a_sensor_is_read_after_each_action_that_may_change_what_it_reads() -> None:
    """A scale tells of the bag whenever something was put in; one of the two stones is heavy."""
    text = """(define (domain d) (:types stone) (:predicates (heavy ?s - stone) (in ?s - stone) (down) (done))
      (:action put :parameters (?s - stone) :precondition (not (in ?s))
        :effect (and (in ?s) (when (heavy ?s) (down))))
      (:sensor scale :sensed (down))
      (:action keep :parameters (?s - stone) :precondition (and (heavy ?s) (in ?s)) :effect (done)))
      (define (problem x) (:domain d) (:objects a b - stone)
        (:init (oneof (heavy a) (heavy b))) (:goal (done)))"""
    # put a; keep a, or put b and keep b.
    assert best(task_of(text)) == (1, Fraction(5, 2))


PUSH = """(define (domain d) (:predicates (jammed) {} (in))
  (:action push :effect (when (not (jammed)) (open)))
  (:action oil :effect (not (jammed)))
  (:action enter :precondition (open) :effect (in)))
(define (problem x) (:domain d) (:init (unknown (jammed))) (:goal (in)))"""


def test_a_fact_that_is_always_seen_tells_what_changed_it() -> None:
    """A door that did not open is jammed; where nobody sees it, one cannot know."""
    seen = task_of(PUSH.format("(observed (open))"))
    # push; enter, or oil, push and enter.
    assert best(seen) == (1, 3)
    without_oil = PUSH.replace("(:action oil :effect (not (jammed)))", "")
    assert best(task_of(without_oil.format("(observed (open))")))[0] == Fraction(1, 2)
    unseen = without_oil.format("(open)").replace(
        "(:action push", "(:action look :observe (in)) (:action push"
    )
    assert best(task_of(unseen))[0] == 0


def test_what_may_have_two_reasons_tells_of_none_for_sure() -> None:
    """The lamp is on where the bulb was changed with success, or by chance: it tells nothing for sure."""
    text = """(define (domain d) (:predicates (good) (lit) (w) (done))
      (:action look :observe (w))
      (:action spoil :effect (not (good)))
      (:action change :precondition (not (good))
        :effect (and (probabilistic 1/2 (and (good) (lit))) (probabilistic {} (lit))))
      (:action claim :precondition (good) :effect (done)))
      (define (problem x) (:domain d) (:init (unknown (good)) (unknown (w))) (:goal (done)))"""
    for other, expected in (("0", 1), ("1/3", 0), ("1", 0)):
        task = task_of(text.format(other))
        assert bbtc.bounds(task).upper == expected
        assert bbtc.bounds(lowered(task, Limits())).upper == expected


def test_a_fact_made_unknown_is_drawn_anew() -> None:
    text = """(define (domain d) (:predicates (heads) (won))
      (:action toss :effect (unknown (heads)))
      (:action look :observe (heads))
      (:action claim :precondition (heads) :effect (won)))
      (define (problem x) (:domain d) (:init (unknown (heads))) (:goal (won)))"""
    # look, and with 1/2 toss and look again: x = 1 + 1/2 · 1 + 1/2 (1 + x).
    assert best(task_of(text)) == (1, 4)
    # With a draw of its own of 1/3: x = 1 + 1/3 + 2/3 (1 + x).
    biased = text.replace("(unknown (heads))) (:goal", "(probabilistic 1/3 (heads))) (:goal")
    assert best(task_of(biased)) == (1, 6)
    # A coin that shows tails at first has to be tossed: 1 + x.
    assert best(task_of(text.replace("(unknown (heads))) (:goal", ") (:goal"))) == (1, 5)


def test_what_is_set_to_what_it_was_shows_nothing() -> None:
    """The lamp is lit already, so nobody sees which of two things happened."""
    text = """(define (domain d) (:predicates (lit) (won) (dark) (done))
      (:action spin :effect (oneof (lit) (won)))
      (:action darken :effect (and (dark) (not (lit))))
      (:action look :observe (won))
      (:action claim :precondition (and (lit) (won) (not (dark))) :effect (done)))
      (define (problem x) (:domain d) (:init (lit)) (:goal (done)))"""
    # Nobody knows after a spin; a look tells.
    task = task_of(text)
    found = [bbtc.bounds(task, max_actions=steps).upper for steps in (2, 3)]
    assert found == [0, Fraction(1, 2)]


def test_what_is_drawn_anew_may_become_what_it_never_was() -> None:
    """A coin that lies heads up at the start may fall on tails."""
    text = """(define (domain d) (:predicates (heads) (won))
      (:action toss :effect (unknown (heads)))
      (:action look :observe (heads))
      (:action claim :precondition (not (heads)) :effect (won)))
      (define (problem x) (:domain d) (:init (heads)) (:goal (won)))"""
    # toss and look, and with 1/2 again: x = 2 + 1/2 · 1 + 1/2 x.
    assert best(task_of(text)) == (1, 5)


def test_a_fact_that_chance_hides_is_unknown() -> None:
    """It is known at the start; to look is only allowed where it is not."""
    text = """(define (domain d) (:predicates (heads) (won))
      (:action toss :effect (oneof (heads) (not (heads))))
      (:action look :precondition (unknown (heads)) :observe (heads))
      (:action claim :precondition (heads) :effect (won)))
      (define (problem x) (:domain d) (:init) (:goal (won)))"""
    assert best(task_of(text)) == (1, 5)


def test_a_denied_disjunction_is_told_as_a_whole() -> None:
    """Its denial is a conjunction in disguise, of which the parts are not told: no more than the same with
    `or` alone."""
    text = """(define (domain d) (:predicates (a) (b) (done))
      (:action look :observe {})
      (:action go :precondition (and (a) (not (b))) :effect (done)))
      (define (problem x) (:domain d) (:init (oneof (a) (b) (c))) (:goal (done)))""".replace(
        "(b) (done)", "(b) (c) (done)"
    )
    figures = [best(task_of(text.format(told)))[0] for told in ("(or (a) (b))", "(not (or (a) (b)))")]
    assert figures == [0, 0]
    assert best(task_of(text.format("(and (a) (b))")))[0] == Fraction(1, 3)


def test_domains_without_hidden_state_keep_their_meaning() -> None:
    """Facts of the start are seen draws there, and what is unknown has nothing behind it."""
    text = """(define (domain d) (:predicates (p) (done))
      (:action look :precondition (unknown (p)) :effect (probabilistic 0.5 (p) 0.5 (not (p))))
      (:action go :precondition (p) :effect (done)))
      (define (problem x) (:domain d) (:init (unknown (p))) (:goal (done)))"""
    task = task_of(text)
    assert task.components == ()
    assert best(task) == (Fraction(1, 2), Fraction(3, 2))


# --- public problems -----------------------------------------------------------------------------


def _published() -> list[tuple[str, str, int, Fraction, Fraction]]:
    table = Path(__file__).parents[3] / "shared" / "hidden" / "optima.tsv"
    if not table.is_file():
        return []
    rows = [line.split("\t") for line in table.read_text("utf-8").splitlines() if line[:1] != "#"]
    rows = [row for row in rows if row[0] != "domain"]
    return [(row[0], row[1], int(row[3]), Fraction(row[4]), Fraction(row[5])) for row in rows]


@pytest.mark.parametrize(
    ("domain", "problem", "beliefs", "probability", "cost"),
    [row for row in _published() if row[2] <= amount(2_000, 10**9)],
    ids=lambda value: str(value).rpartition("/")[2],
)
def test_public_problems_have_the_published_figures(
    domain: str, problem: str, beliefs: int, probability: Fraction, cost: Fraction, corpus: Path
) -> None:
    """P* and the least expected number of actions; tables have four decimals."""
    found, least = best(bbtc.compile(corpus / domain, corpus / problem, lenient=True))
    assert abs(found - probability) < Fraction(1, 10**6)
    assert abs(least - cost) < Fraction(1, 10_000)
