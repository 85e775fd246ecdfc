"""Facts that exclude each other, and what changes of themselves: compared with all states that can be
reached."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

import bbtc
from bbtc.belief.draws import Values
from bbtc.ground.condition import TRUE, Condition, Is, conjunction
from bbtc.ground.task import Effect, Factor, GroundAction, InitialState, Outcome, Task, Variable
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.changing_facts import ChangingFacts
from bbtc.planner.mutexes import exclusive_groups
from bbtc.source import SourceFile
from tests.disturbance.reference import reachable
from tests.long_form import amount
from tests.replay.random_trees import random_task

DOMAIN = """
(define (domain courier)
  (:requirements :strips :typing :conditional-effects)
  (:types place door parcel)
  (:predicates (at ?p - place) (lies ?x - parcel ?p - place) (held ?x - parcel) (hand_free)
               (external (shut ?d - door)) (seen ?x - parcel))
  (:action move :parameters (?p - place)
    :precondition (forall (?d - door) (not (shut ?d)))
    :effect (and (forall (?q - place) (not (at ?q))) (at ?p)))
  (:action take :parameters (?x - parcel ?p - place)
    :precondition (and (at ?p) (lies ?x ?p) (hand_free))
    :effect (and (held ?x) (not (lies ?x ?p)) (not (hand_free)) (seen ?x)))
  (:action put :parameters (?x - parcel ?p - place)
    :precondition (and (at ?p) (held ?x))
    :effect (and (lies ?x ?p) (not (held ?x)) (hand_free))))
"""
PROBLEM = """
(define (problem two) (:domain courier)
  (:objects hall yard - place gate - door cup pen - parcel)
  (:init (at hall) (lies cup hall) (lies pen yard) (hand_free))
  (:goal (and (lies cup yard) (seen cup) (lies pen hall) (not (shut gate)))))
"""


DOMAINS = Path(__file__).parents[2] / "domains"
PROBLEMS = ["charging/one-room", "delivery/letter-for-anna", "doors/to-the-lab", "inspection/shut-down",
            "kitting/gift-set", "trolley/with-spares", "warehouse/one-order"]  # fmt: skip


def courier() -> Task:
    return bbtc.compile(SourceFile("domain.pddl", DOMAIN), SourceFile("problem.pddl", PROBLEM))


def true_in(task: Task, values: Values) -> set[str]:
    return {variable.name for variable, value in zip(task.variables, values, strict=True) if value == 2}


def state(task: Task, *true: str) -> Values:
    assert set(true) <= {variable.name for variable in task.variables}
    return bytes(2 if variable.name in true else 0 for variable in task.variables)


def test_the_places_of_a_robot_and_of_what_it_carries_are_groups() -> None:
    task = courier()
    named = {
        frozenset(task.variables[member].name for member in group.members): group.always
        for group in exclusive_groups(task, Limits())
    }
    assert named == {
        frozenset({"at(hall)", "at(yard)"}): True,
        frozenset({"lies(cup,hall)", "lies(cup,yard)", "held(cup)"}): True,
        frozenset({"lies(pen,hall)", "lies(pen,yard)", "held(pen)"}): True,
        frozenset({"held(cup)", "held(pen)", "hand_free()"}): True,
    }


def test_a_robot_moves_a_door_shuts_and_what_falls_leaves_the_hand_free() -> None:
    task = courier()
    facts = ChangingFacts.of(task, Limits())
    start = state(task, "at(yard)", "held(cup)", "lies(pen,yard)", "seen(cup)")
    chances = {frozenset(true_in(task, after)): chance for chance, after in facts.changes(start)}
    # The robot, the hand, the cup, the pen, the gate, and seen(cup): each is as likely to change. Nobody asks
    # whether the pen was seen.
    sixth = Fraction(1, 6)
    now = true_in(task, start)
    cup_at_hall = frozenset(now - {"held(cup)"} | {"lies(cup,hall)", "hand_free()"})
    cup_at_yard = frozenset(now - {"held(cup)"} | {"lies(cup,yard)", "hand_free()"})
    # What comes into the hand makes the cup fall out of it, to one place or the other.
    pen_and_hall = frozenset(now - {"lies(pen,yard)", "held(cup)"} | {"held(pen)", "lies(cup,hall)"})
    pen_and_yard = frozenset(now - {"lies(pen,yard)", "held(cup)"} | {"held(pen)", "lies(cup,yard)"})
    assert chances == {
        frozenset(now - {"at(yard)"} | {"at(hall)"}): sixth,
        cup_at_hall: sixth / 4 + sixth / 2,  # the hand opens, or the cup is moved
        cup_at_yard: sixth / 4 + sixth / 2,
        pen_and_hall: sixth / 4 + sixth / 4,  # the hand is given the pen, or the pen is put into it
        pen_and_yard: sixth / 4 + sixth / 4,
        frozenset(now - {"lies(pen,yard)"} | {"lies(pen,hall)"}): sixth / 2,
        frozenset(now | {"shut(gate)"}): sixth,
        frozenset(now - {"seen(cup)"}): sixth,
    }


def test_no_state_that_can_be_reached_has_two_of_a_group() -> None:
    found = 0
    for seed in range(amount(200, 5000)):
        task = random_task(Random(seed))
        states = reachable(task)
        assert states is not None
        found += check(task, states)
    assert found > 2, "there are groups to look at"


def moving_task(rng: Random) -> Task:
    """Facts of a few places that actions move about, mostly from one to another, and often only where a fact
    holds; many of them keep to a group, and many nearly do."""
    names = [("at", "a"), ("at", "b"), ("at", "c"), ("on", "a"), ("on", "b"), ("off", "a")]
    variables = tuple(Variable(name, (arg,), False) for name, arg in sorted(names))
    count = len(variables)

    def literals(most: int) -> Condition:
        picked = rng.sample(range(count), rng.randint(0, most))
        return conjunction(Is(v, rng.choice([Truth.TRUE, Truth.TRUE, Truth.FALSE])) for v in picked)

    def effect() -> Effect:
        one, two, three = rng.sample(range(count), 3)
        when = rng.choice([None, Is(one, Truth.TRUE), Is(three, Truth.FALSE), literals(2)])
        sets = {one: Truth.FALSE, two: Truth.TRUE}
        if rng.random() < 0.3:
            del sets[rng.choice([one, two])]
        if rng.random() < 0.4:
            sets[three] = Truth.FALSE
        return Effect(when, tuple(sorted(sets.items())))

    def action(number: int) -> GroundAction:
        precondition = literals(2)
        effects = [effect() for _ in range(rng.randint(1, 3))]
        if rng.random() < 0.4:  # to go to a place leaves all of them
            place = rng.randrange(3)
            effects = [Effect(None, tuple((v, Truth(2 * (v == place))) for v in range(3)))]
        return GroundAction(
            f"act{number}", (), precondition, (Factor((Outcome(Fraction(1), tuple(effects)),)),)
        )

    start = [Truth.FALSE] * count
    for number in rng.sample(range(count), 2):
        start[number] = Truth.TRUE
    actions = tuple(action(number) for number in range(rng.randint(1, 3)))
    return Task("moving", "one", variables, (InitialState(Fraction(1), tuple(start)),), TRUE, actions)


def test_no_state_of_facts_that_move_about_has_two_of_a_group() -> None:
    found = sum(
        check(task, states)
        for task in map(moving_task, map(Random, range(amount(1500, 30_000))))
        if (states := reachable(task)) is not None
    )
    assert found > 100, "there are groups to look at"


@pytest.mark.parametrize("problem", PROBLEMS)
def test_no_state_of_a_domain_has_two_of_a_group(problem: str) -> None:
    folder = problem.partition("/")[0]
    task = bbtc.compile(DOMAINS / folder / "domain.pddl", DOMAINS / f"{problem}.pddl")
    states = reachable(task)
    assert states is None or check(task, states) > 0


def check(task: Task, states: set[tuple[int, ...]]) -> int:
    """Groups, of which the number is returned, hold in all states that can be reached, and changes keep to
    them."""
    groups = exclusive_groups(task, Limits())
    facts = ChangingFacts.of(task, Limits())

    def kept(values: Values) -> bool:
        counts = [(sum(values[member] == 2 for member in group.members), group.always) for group in groups]
        return all(count == 1 or (count == 0 and not always) for count, always in counts)

    for values in sorted(states)[:50]:
        assert kept(bytes(values))
        found = facts.changes(bytes(values))
        assert not found or sum(chance for chance, _ in found) == 1
        for _, after in found:
            assert kept(after)
            assert after != bytes(values)
            assert all(
                value in variable.values for value, variable in zip(after, task.variables, strict=True)
            )
    return len(groups)
