"""Components whose worlds are not listed: beliefs as decision diagrams."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from typing import Any

import pytest

from bbtc.artefacts import dumps, load_task, load_tree, task_to_json, tree_to_json
from bbtc.belief.monitored import monitored
from bbtc.diagnostics import BbtcError
from bbtc.ground.hidden.summary import hidden_summary
from bbtc.limits import Limits
from bbtc.pipeline import plan_task, verify_tree
from bbtc.planner.bounds import task_value
from bbtc.runtime.monitor import Walk
from bbtc.source import SourceFile
from tests.ground.examples import task_of
from tests.hidden.test_against_text import compare, counted, noisy, planned
from tests.hidden.texts import texts
from tests.long_form import amount

_UNLISTED = Limits(worlds=0)
_GROUP = amount(40, 2_000)


def test_random_texts_are_worth_what_their_words_say() -> None:
    done = counted(7, texts(), lambda text: compare(text, _UNLISTED), _GROUP)
    assert done["between"] >= (done["0"] + done["between"] + done["1"]) / 4


def test_random_texts_with_noise_are_worth_what_their_words_say() -> None:
    done = counted(7, texts(noise=True), lambda text: noisy(text, _UNLISTED), amount(30, 1_000))
    assert done["within: between"] > 2


def test_trees_do_on_the_worlds_of_the_text_what_they_claim() -> None:
    done = counted(7, texts(), lambda text: planned(text, "auto", _UNLISTED), amount(15, 500))
    assert done["between"] > 0


SEATS = """(define (domain party) (:types guest seat)
  (:predicates (sits ?g - guest ?s - seat) (toasted))
  (:action ask :parameters (?s - seat) :observe (sits g0 ?s))
  (:action toast :parameters (?s - seat) :precondition (sits g0 ?s) :effect (toasted)))
(define (problem evening) (:domain party) (:objects {guests} - guest {seats} - seat)
  (:init (forall (?g - guest) (oneof {of_guest})) (forall (?s - seat) (oneof {of_seat})))
  (:goal (toasted)))"""


def seats(count: int) -> str:
    """So many guests on as many seats."""
    every = range(count)
    return SEATS.format(
        guests=" ".join(f"g{at}" for at in every),
        seats=" ".join(f"s{at}" for at in every),
        of_guest=" ".join(f"(sits ?g s{at})" for at in every),
        of_seat=" ".join(f"(sits g{at} ?s)" for at in every),
    )


def test_worlds_that_are_not_listed_are_counted() -> None:
    """Eight guests sit on eight seats in 8! ways; on which one of them sits takes up to seven questions, and
    if all are denied it is the last."""
    task = task_of(seats(8))
    assert any(f"{math.factorial(8):,} worlds" in line for line in hidden_summary(task))
    found = task_value(task, Limits(), costs=True)
    assert (found.lower, found.upper) == (1, 1)
    asked = Fraction(sum(range(1, 8)) + 7, 8)
    assert found.cost == asked + 1


ALARM = """(define (domain alarm) (:types room)
  (:predicates (smoke ?r - room) (rings) (safe))
  (:action listen :observe (rings))
  (:action enter :precondition (not (smoke r0)) :effect (safe)))
(define (problem night) (:domain alarm) (:objects {rooms} - room)
  (:init (unknown (rings)) (forall (?r - room) (unknown (smoke ?r)))
    {quiet} (or (not (rings)) {smoke}))
  (:goal (safe)))"""


def test_what_is_told_divides_a_diagram() -> None:
    """An alarm rings where there is smoke in any of 40 rooms: 2^40 worlds, as likely each. The robot enters
    one if it does not ring at all."""
    rooms = [f"r{at}" for at in range(40)]
    smoke = " ".join(f"(smoke {room})" for room in rooms)
    quiet = " ".join(f"(or (rings) (not (smoke {room})))" for room in rooms)
    task = task_of(ALARM.format(rooms=" ".join(rooms), smoke=smoke, quiet=quiet))
    found = task_value(task, Limits())
    assert found.lower == found.upper == Fraction(1, 2**40)


GATES = """(define (domain gates) (:types gate)
  (:predicates (at ?g - gate) (next ?g ?h - gate) (left ?g - gate) (out))
  (:action look :observe (left g0))
  (:action compare :parameters (?g ?h - gate) :precondition (and (at ?g) (next ?g ?h))
    :observe (or (and (left ?g) (left ?h)) (and (not (left ?g)) (not (left ?h)))))
  (:action turn-left :parameters (?g ?h - gate) :precondition (and (at ?g) (next ?g ?h) (left ?g))
    :effect (and (not (at ?g)) (at ?h)))
  (:action turn-right :parameters (?g ?h - gate) :precondition (and (at ?g) (next ?g ?h) (not (left ?g)))
    :effect (and (not (at ?g)) (at ?h)))
  (:action leave :precondition (at {last}) :effect (out)))
(define (problem way) (:domain gates) (:objects {gates} - gate)
  (:init (at g0) {next} (forall (?g - gate) (unknown (left ?g))))
  (:goal (out)))"""


def gates(count: int) -> str:
    """So many gates, each open on one side; a lamp tells whether that of the next is the same."""
    names = [f"g{at}" for at in range(count)]
    return GATES.format(
        gates=" ".join(names),
        next=" ".join(f"(next {one} {other})" for one, other in pairwise(names)),
        last=names[-1],
    )


def test_a_tree_is_planned_verified_and_read_again() -> None:
    """The robot looks once, goes through four gates, and compares each that comes next but the last."""
    tree = plan_task(task_of(gates(5), _UNLISTED), None, "auto", Limits(), lambda _: None).tree
    assert tree.task.components
    assert tree.task.components[0].diagram is not None
    text = dumps(tree_to_json(tree))
    again = load_tree(SourceFile("tree.json", text))
    assert dumps(tree_to_json(again)) == text
    assert tree.success_probability == 1
    verdict = verify_tree(again, Limits(), "own")
    assert verdict.problems == ()
    assert verdict.own is not None
    assert verdict.worlds is not None
    assert verdict.own.success == verdict.worlds.success == 1
    assert verdict.own.cost == 1 + 3 + 4 + 1


class Tape(random.Random):
    """Draws what is written down, and then the first of all."""

    def __init__(self, written: list[int]) -> None:
        super().__init__()
        self.written = written
        self.sizes: list[int] = []

    def randrange(self, start: int, stop: int | None = None, step: int = 1) -> int:
        """The next of what is written down."""
        assert stop is None
        assert step == 1
        self.sizes.append(start)
        return self.written[len(self.sizes) - 1] if len(self.sizes) <= len(self.written) else 0


def drawn(walk: Walk) -> dict[frozenset[str], Fraction]:
    """How likely each set of true facts is: every way in which the walk may go."""
    found: dict[frozenset[str], Fraction] = {}
    tapes: list[list[int]] = [[]]
    while tapes:
        written = tapes.pop()
        tape = Tape(written)
        state = walk(tape)
        if len(tape.sizes) > len(written):
            tapes += [[*written, value] for value in range(tape.sizes[len(written)])]
            continue
        true = frozenset("".join(fact) for fact, value in state.items() if value)
        found[true] = found.get(true, Fraction(0)) + Fraction(1, math.prod(tape.sizes))
    return found


WEIGHED = """(define (domain d) (:predicates (a) (b) (c) (e))
  (:action look :observe (a)) (:action both :observe (and (b) (c) (e))))
(define (problem p) (:domain d)
  (:init (probabilistic 1/3 (a) 1/3 (b)) (probabilistic 1/4 (c)) (unknown (e)) (or (a) (b) (c)))
  (:goal (and (known (a)) (known (b)))))"""


def test_a_simulated_world_draws_worlds_as_likely_as_they_are() -> None:
    plan = plan_task(task_of(WEIGHED, _UNLISTED), None, "auto", Limits(), lambda _: None)
    watched = monitored(plan.tree, Limits())
    assert watched is not None
    assert watched.monitor is not None
    (walk,) = watched.monitor.walks
    names: list[tuple[str, ...]] = [
        (watched.task.variables[at].predicate.removeprefix("really "),) for at in walk.variables
    ]
    turns = [(turn.level, str(turn.true), turn.if_false, turn.if_true) for turn in walk.turns]
    (component,) = task_of(WEIGHED).components
    assert drawn(Walk(names, turns)) == {
        frozenset(fact[0] for bit, fact in enumerate(component.facts) if world >> bit & 1): p
        for world, p in component.prior
    }


def test_what_takes_too_many_nodes_is_refused_with_its_facts() -> None:
    with pytest.raises(BbtcError) as caught:
        task_of(seats(8), Limits(diagram_nodes=1_000))
    (error,) = caught.value.diagnostics
    assert error.code == "BBT0415"
    assert "`sits(g0,s0)`" in error.message
    assert "1,000 nodes" in error.message


def test_a_contradiction_between_many_facts_is_found() -> None:
    """Seven guests on six seats."""
    text = seats(7).replace(" s6 - seat", " - seat").replace("(sits ?g s6)", "")
    with pytest.raises(BbtcError) as caught:
        task_of(text, _UNLISTED)
    assert {error.code for error in caught.value.diagnostics} == {"BBT0414"}


_WRONG = [
    ("order", lambda prior: prior["order"].pop()),
    ("earlier", lambda prior: prior["nodes"][0].update(to=[7, 1])),
    ("later", lambda prior: prior["nodes"][-1].update(fact=prior["order"][-1])),
    ("weight", lambda prior: prior["nodes"][0].update(weights=["1/2", "1"])),
    ("negative", lambda prior: prior["nodes"][0].update(weights=["-1", "1"])),
    ("third", lambda prior: prior["nodes"][0].update(weights=["1", "1", "1"])),
    ("number", lambda prior: prior["nodes"][0].update(to=["1", 1])),
    ("nothing", lambda prior: [node.update(weights=["0", "0"]) for node in prior["nodes"]]),
]


@pytest.mark.parametrize("spoil", [each for _, each in _WRONG], ids=[name for name, _ in _WRONG])
def test_a_diagram_that_is_none_is_refused(spoil: Callable[[Any], object]) -> None:
    value = json.loads(dumps(task_to_json(task_of(WEIGHED, _UNLISTED))))
    assert load_task(SourceFile("task.json", json.dumps(value))).components
    spoil(value["components"][0]["prior"])
    with pytest.raises(BbtcError) as caught:
        load_task(SourceFile("task.json", json.dumps(value)))
    assert {error.code for error in caught.value.diagnostics} <= {"BBT0604", "BBT0607"}
