"""Durative actions in their sequential use, beside an interpreter of PDDL 2.1 that knows moments."""

from __future__ import annotations

import itertools
import random
from collections import deque
from collections.abc import Iterator
from fractions import Fraction

import pytest

import bbtc
import bbtc.durations
from bbtc.limits import Limits
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from tests.long_form import amount

State = frozenset[str]
Literal = tuple[bool, str, tuple[str, ...]]
FACTS = {"a": 0, "b": 0, "on": 1, "near": 1, "link": 2}
OBJECTS = ("x", "y")
MOMENTS = ("at start", "over all", "at end")


class Durative:
    """A durative action as data: literals by moment."""

    def __init__(self, name: str, generator: random.Random) -> None:
        self.name = name
        self.parameters = ["?v", "?w"][: generator.randint(0, 2)]
        self.duration = generator.randint(1, 9)
        self.conditions = [
            (generator.choice(MOMENTS), self.literal(generator)) for _ in range(generator.randint(0, 3))
        ]
        self.effects = [
            (generator.choice(("at start", "at end")), self.literal(generator))
            for _ in range(generator.randint(1, 4))
        ]

    def literal(self, generator: random.Random) -> Literal:
        terms = [*OBJECTS, *self.parameters, *self.parameters]
        fact = generator.choice(list(FACTS))
        args = tuple(generator.choice(terms) for _ in range(FACTS[fact]))
        return generator.random() < 0.6, fact, args

    def text(self) -> str:
        def shown(literal: Literal) -> str:
            positive, fact, args = literal
            atom = f"({' '.join((fact, *args))})"
            return atom if positive else f"(not {atom})"

        conditions = " ".join(f"({when} {shown(literal)})" for when, literal in self.conditions)
        effects = " ".join(f"({when} {shown(literal)})" for when, literal in self.effects)
        return (
            f"(:durative-action {self.name} :parameters ({' '.join(self.parameters)}) "
            f":duration (= ?duration {self.duration}) :condition (and {conditions}) :effect (and {effects}))"
        )

    def successors(self, state: State) -> Iterator[State]:
        for values in itertools.product(OBJECTS, repeat=len(self.parameters)):
            after = self.run(state, dict(zip(self.parameters, values, strict=True)))
            if after is not None:
                yield after

    def run(self, state: State, binding: dict[str, str]) -> State | None:
        """The state at the end, if all conditions hold when they have to."""

        def fact(literal: Literal) -> str:
            return " ".join((literal[1], *(binding.get(arg, arg) for arg in literal[2])))

        def holds(when: str, now: State) -> bool:
            return all((fact(each) in now) is each[0] for moment, each in self.conditions if moment == when)

        def changed(when: str, now: State) -> State:
            mine = [each for moment, each in self.effects if moment == when]
            lost = {fact(each) for each in mine if not each[0]}
            return (now - lost) | {fact(each) for each in mine if each[0]}

        if not holds("at start", state):
            return None
        meanwhile = changed("at start", state)
        if not holds("over all", meanwhile) or not holds("at end", meanwhile):
            return None
        return changed("at end", meanwhile)


def distance(actions: list[Durative], start: State, goal: list[Literal]) -> int | None:
    """The fewest actions to the goal, by breadth-first search."""

    def reached(state: State) -> bool:
        return all((" ".join((fact, *args)) in state) is positive for positive, fact, args in goal)

    seen, queue = {start}, deque([(start, 0)])
    while queue:
        state, steps = queue.popleft()
        if reached(state):
            return steps
        for after in itertools.chain.from_iterable(action.successors(state) for action in actions):
            if after not in seen:
                seen.add(after)
                queue.append((after, steps + 1))
    return None


def random_task(generator: random.Random) -> tuple[str, int | None]:
    actions = [Durative(f"act{number}", generator) for number in range(generator.randint(2, 4))]
    ground = [
        " ".join((fact, *args)) for fact, n in FACTS.items() for args in itertools.product(OBJECTS, repeat=n)
    ]
    start = frozenset(fact for fact in ground if generator.random() < 0.4)
    goal = [
        (generator.random() < 0.6, words[0], tuple(words[1:]))
        for words in (fact.split() for fact in generator.sample(ground, 2))
    ]
    shown = " ".join(
        f"({' '.join((f, *args))})" if positive else f"(not ({' '.join((f, *args))}))"
        for positive, f, args in goal
    )
    text = (
        "(define (domain d) (:constants x y) (:predicates (a) (b) (on ?v) (near ?v) (link ?v ?w)) "
        f"{' '.join(action.text() for action in actions)})"
        f"(define (problem p) (:domain d) (:init {' '.join(f'({fact})' for fact in sorted(start))}) "
        f"(:goal (and {shown})))"
    )
    return text, distance(actions, start, goal)


def planned(text: str) -> Plan | str:
    """The plan, or the code of what is wrong."""
    try:
        return bbtc.plan(SourceFile("d.pddl", text), limits=Limits(seconds=30))
    except bbtc.BbtcError as error:
        return next(each.code for each in error.diagnostics if each.severity.value == "error")


@pytest.mark.parametrize("part", range(5))
def test_plans_are_as_long_as_those_of_an_interpreter_that_knows_moments(part: int) -> None:
    generator = random.Random(part)
    compared = found = 0
    for _ in range(amount(70, 1500)):
        text, steps = random_task(generator)
        plan = planned(text)
        if isinstance(plan, str):
            if plan == "BBT0449":
                continue  # a fact that holds while another action runs
            assert (plan, steps) == ("BBT0412", None), text
        elif steps is None:
            assert plan.tree.success_probability == 0, text
        else:
            assert (plan.tree.success_probability, plan.figures.actions) == (1, steps), text
            found += steps > 0
        compared += 1
    assert compared > 15
    assert found > 3


REFUSED = {
    "a duration within bounds": (
        "(:durative-action x :duration (<= ?duration 5) :effect (at end (p)))",
        "chooses",
    ),
    "any duration": ("(:durative-action x :duration () :effect (at end (p)))", "any time"),
    "a number that changes": (
        "(:durative-action x :duration (= ?duration 5) :effect (increase (f) (* #t 2)))",
        "changes while",
    ),
    "an effect under a condition on its own start": (
        (
            "(:durative-action x :duration (= ?duration 5) :effect (and (at start (p)) (when (at end (p)) "
            "(at end (q)))))"
        ),
        "what the action itself sets",
    ),
    "what is set under conditions is asked for": (
        (
            "(:durative-action x :duration (= ?duration 5) :condition (over all (p)) "
            ":effect (and (when (at start (q)) (at start (p))) (at end (q))))"
        ),
        "under conditions",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_takes_more_is_refused_by_name(name: str) -> None:
    action, said = REFUSED[name]
    text = (
        f"(define (domain d) (:predicates (p) (q)) (:functions (f)) {action})"
        "(define (problem p) (:domain d) (:init) (:goal (q)))"
    )
    with pytest.raises(bbtc.BbtcError) as raised:
        bbtc.compile(SourceFile("d.pddl", text))
    (found,) = (each for each in raised.value.diagnostics if each.code == "BBT0449")
    assert said in found.message
    assert found.span is not None


def test_time_is_that_of_the_durations() -> None:
    text = (
        "(define (domain d) (:predicates (p) (q)) "
        "(:durative-action x :duration (= ?duration 5) :effect (at end (p))) "
        "(:durative-action y :duration (= ?duration (* 2 3)) :condition (over all (p)) :effect (at end (q))))"
        "(define (problem p) (:domain d) (:init) (:goal (q)))"
    )
    task = bbtc.compile(SourceFile("d.pddl", text))
    found = [action.duration for action in task.actions]
    assert found == [bbtc.durations.Fixed(Fraction(5)), bbtc.durations.Fixed(Fraction(6))]


@pytest.mark.parametrize(("asked", "reached"), [("(p)", True), ("(not (p))", False)])
def test_what_is_made_true_at_the_start_wins_over_what_is_made_false(asked: str, reached: bool) -> None:
    text = (
        "(define (domain d) (:predicates (p) (q)) (:durative-action x :duration (= ?duration 5) "
        f":condition (over all {asked}) "
        ":effect (and (at start (not (p))) (at start (p)) (at end (q)))))"
        "(define (problem p) (:domain d) (:init) (:goal (q)))"
    )
    found = planned(text)
    assert (not isinstance(found, str) and found.tree.success_probability == 1) is reached
