"""The text of a task as a POMDP is worth what the task is, by the words of the domain and by Storm."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings

from bbtc.artefacts import dumps, load_task, task_to_json
from bbtc.diagnostics import BbtcError
from bbtc.limits import Limits
from bbtc.pipeline import process_text
from bbtc.planner.bounds import task_value
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from tests.cli.program import bbtc as program
from tests.domains.lifted import TooLarge
from tests.domains.problems import PROBLEMS, Problem
from tests.domains.problems import task_of as task_of_problem
from tests.ground.examples import task_of
from tests.hidden import storm_beliefs
from tests.hidden.pomdp_text import PomdpText
from tests.hidden.reference import HiddenText
from tests.hidden.texts import texts
from tests.long_form import amount
from tests.profiles import examples

HIDING = [each for each in PROBLEMS if each.domain in {"corridors", "diagnosis", "press", "shelves"}]


def written(text: str) -> str:
    """The task of a text as a POMDP."""
    return process_text(task_of(text), "prism-pomdp", Limits())


def _hopeless(text: str) -> bool:
    """Is the goal out of reach, or no world left?"""
    try:
        task_of(text)
    except BbtcError as error:
        if {each.code for each in error.diagnostics} <= {"BBT0412", "BBT0414"}:
            return True
        raise
    return False


def value(text: str) -> Fraction:
    """P* of a text."""
    found = task_value(task_of(text), Limits())
    assert found.lower == found.upper
    return found.lower


def test_random_tasks_are_worth_what_their_words_say() -> None:
    """P* and the least number of actions, over all beliefs of the text and all of the domain's words. In
    states that look alike the same may be done, or reading the text would fail."""
    many = amount(30, 4_000)
    done: Counter[str] = Counter()

    @settings(examples(many), phases=[Phase.generate])
    @given(texts())
    def look(text: str) -> None:
        reference = HiddenText.of(text)
        if not reference.prior:
            return
        try:
            space = reference.mdp(60)
            if _hopeless(text):
                return
            found = PomdpText(written(text)).mdp(400)
        except TooLarge:
            return
        assert found.best[0] == space.best[0], text
        if space.best[0]:
            assert found.least_cost() - 1 == space.least_cost(), text  # the draw of the start is no action
        done["between" if 0 < space.best[0] < 1 else "sure"] += 1

    look()
    assert done["between"] > many / 8
    assert sum(done.values()) > many / 3


def test_random_tasks_with_noise_are_worth_what_their_words_say() -> None:
    """Within three actions."""
    many = amount(30, 1_500)
    done: Counter[bool] = Counter()

    @settings(examples(many), phases=[Phase.generate])
    @given(texts(noise=True))
    def look(text: str) -> None:
        reference = HiddenText.of(text)
        try:
            if not reference.prior:
                return
            best = reference.within(3, 400)
            if _hopeless(text):
                return
            assert PomdpText(written(text)).within(3) == best, text
        except TooLarge:
            return
        done[0 < best < 1] += 1

    look()
    assert done[True] > many / 30


def test_storm_finds_the_same_in_the_text(tmp_path: Path) -> None:
    """Exactly, where it looks at every belief."""
    pytest.importorskip("stormpy", reason="Storm is not installed: pip install 'bbtc[storm]'")
    many = amount(14, 1_000)
    done: Counter[str] = Counter()

    @settings(examples(many), phases=[Phase.generate])
    @given(texts())
    def look(text: str) -> None:
        if _hopeless(text):
            return
        task = task_of(text)
        found = task_value(task, Limits(states=500))
        lower, upper, exact = storm_beliefs.bounds(written(text), tmp_path)
        assert lower <= found.upper, text
        assert found.lower <= upper, text
        if exact and found.lower == found.upper:
            assert lower == found.lower, text
            done["between" if 0 < lower < 1 else "sure"] += 1

    look()
    assert done["between"] > many / 10
    assert sum(done.values()) > many / 3


CAVE = """
(define (domain cave)
  (:predicates (at ?c) (joined ?a ?b) (pit ?c) (breeze ?c))
  (:action walk
    :parameters (?a ?b)
    :precondition (and (at ?a) (joined ?a ?b) (not (pit ?b)))
    :effect (and (not (at ?a)) (at ?b)))
  (:sensor skin :parameters (?c) :condition (at ?c) :sensed (breeze ?c)))
(define (problem short)
  (:domain cave)
  (:objects mouth left right end)
  (:init (at mouth) (joined mouth left) (joined mouth right) (joined left end) (joined right end)
    (oneof (and (pit left) (breeze mouth)) (pit right)))
  (:goal (at end)))
"""
BUMPER = """
(define (domain doors)
  (:predicates (jammed ?d) (observed (through ?d)) (warm) (done))
  (:action push :parameters (?d) :effect (when (not (jammed ?d)) (through ?d)))
  (:action oil :parameters (?d) :effect (probabilistic 1/3 (not (jammed ?d))))
  (:action rest :effect (probabilistic 1/2 (warm)))
  (:action finish :parameters (?d) :precondition (and (through ?d) (warm)) :effect (done)))
(define (problem two)
  (:domain doors)
  (:objects a b)
  (:init (unknown (jammed a)) (unknown (jammed b)))
  (:goal (done)))
"""
BELIEVED = """
(define (domain believed)
  (:predicates (ill) (red) (well) (tired))
  (:action look :observe (red))
  (:action treat :precondition (and (not (tired)) (believed (ill) 0.75))
    :effect (and (when (ill) (well)) (tired)))
  (:action leave :precondition (and (not (tired)) (believed (not (ill)) 0.95))
    :effect (and (when (not (ill)) (well)) (tired))))
(define (problem patient)
  (:domain believed)
  (:init (probabilistic 0.4 (and (ill) (red)) 0.1 (ill) 0.1 (red)))
  (:goal (believed (well) 0.75)))
"""
NESTED = """
(define (domain nested)
  (:predicates (h) (i) (s) (t) (u))
  (:action toss :precondition (not (s))
    :effect (and (s) (probabilistic 1/2 (and (h) (probabilistic 1/3 (and (i) (t)))) 1/4 (t))))
  (:action look :precondition (and (s) (not (u))) :effect (u) :observe (h))
  (:action win :precondition (and (h) (not (t))) :effect (and (i))))
(define (problem one) (:domain nested) (:init (unknown (h)) (unknown (i))) (:goal (and (h) (i))))
"""


ONE_WAY = """
(define (domain one-way)
  (:predicates (ill) (well))
  (:action look :observe (probabilistic 0.5 (ill) 1 (not (ill))))
  (:action treat :precondition (ill) :effect (probabilistic 0.9 (well))))
(define (problem patient) (:domain one-way) (:init (probabilistic 0.3 (ill))) (:goal (well)))
"""


@pytest.mark.parametrize(
    "text", [CAVE, BUMPER, NESTED, ONE_WAY], ids=["sensor", "observed", "nested draw", "errs one way"]
)
def test_tasks_by_hand_are_worth_as_much(text: str) -> None:
    """A sensor that tells at the start, facts that are always seen in two components beside a draw, and a
    draw within another that the robot sees a part of, and a reading that is sometimes wrong one way, and
    never the other. Within five actions."""
    best = task_value(task_of(text), Limits(), Options(max_actions=5))
    assert best.lower == best.upper > 0
    assert PomdpText(written(text)).within(5) == best.lower


def test_what_is_believed_counts_where_beliefs_are_few() -> None:
    """Who sees red (1/2) believes with 0.8 that it is an illness, which is enough; else with 0.2 that it is
    one, and 0.8 that it is none is not. The text asks how probable it is that the robot stops."""
    assert PomdpText(written(BELIEVED)).within(3) == Fraction(1, 2)


def test_a_saved_task_is_written_too() -> None:
    """What an artefact does not hold of the worlds, its task needs no more: it is worth as much."""
    task = load_task(SourceFile("task.json", dumps(task_to_json(task_of(CAVE)))))
    assert PomdpText(process_text(task, "prism-pomdp", Limits())).mdp(200).best[0] == value(CAVE)


def test_the_robot_sees_nothing_that_is_hidden() -> None:
    """Neither facts, nor what is noted of them while an action is drawn."""
    found = PomdpText(written(NESTED))
    hidden = {name for at, name in enumerate(found.names) if at not in found.seen}
    assert {name for name in found.names if name.startswith(("really_", "next_"))} == hidden
    assert {"really_h", "really_i"} <= hidden


@pytest.mark.parametrize("problem", HIDING, ids=str)
def test_problems_of_the_domains_are_worth_as_much(problem: Problem) -> None:
    """Within four actions."""
    task = task_of_problem(problem)
    best = task_value(task, Limits(), Options(max_actions=4))
    assert best.lower == best.upper
    assert PomdpText(process_text(task, "prism-pomdp", Limits())).within(4) == best.lower


def test_what_may_be_known_without_end_is_refused() -> None:
    """What is asked of beliefs, whose noise has no end."""
    tiger = BELIEVED.replace(":observe (red)", ":observe (probabilistic 0.8 (red))")
    with pytest.raises(BbtcError) as refused:
        written(tiger)
    assert [each.code for each in refused.value.diagnostics] == ["BBT0430"]


def test_the_program_writes_it(tmp_path: Path) -> None:
    """And says so where the plain process cannot hold what is hidden."""
    (tmp_path / "p.pddl").write_text(BUMPER, "utf-8")
    done = program("compile", "p.pddl", "--emit", "prism-pomdp", folder=tmp_path)
    assert done.stdout.splitlines()[2] == "pomdp"
    plain = program("compile", "p.pddl", "--emit", "prism", folder=tmp_path)
    assert plain.returncode == 1
    assert "--emit prism-pomdp" in plain.stderr
