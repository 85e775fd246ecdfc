"""What is missing at the root of a goal that nothing can make true: giving it makes the goal possible."""

from __future__ import annotations

import pytest

from bbtc.diagnostics import BbtcError, Diagnostic, Report
from bbtc.ground.goal import goal_doubts
from bbtc.ground.instantiate import ground
from bbtc.ground.lower import Lowering
from bbtc.ground.missing import Missing, NoneTogether, NoObject, Search
from bbtc.ground.normal import conjuncts
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.reachability.reach import reach
from bbtc.ground.start import beginning
from bbtc.limits import Limits
from bbtc.model.domain import InitialFact, Model
from tests.domains.random_texts import random_text
from tests.ground.examples import model_of
from tests.long_form import amount

_HIDDEN_ROOM = """(define (domain d) (:types place item camera)
  (:predicates (at ?p - place) (linked ?a ?b - place) (stands ?i - item ?p - place) (seen ?i - item)
               (held ?i - item) (lit))
  (:action go :parameters (?a ?b - place) :precondition (and (at ?a) (linked ?a ?b))
    :effect (and (at ?b) (not (at ?a))))
  (:action look :parameters (?i - item ?p - place ?c - camera)
    :precondition (and (at ?p) (stands ?i ?p) (lit) (unknown (seen ?i)))
    :effect (probabilistic 1/2 (seen ?i) 1/2 (not (seen ?i))))
  (:action grasp :parameters (?i - item) :precondition (seen ?i) :effect (held ?i)))
(define (problem x) (:domain d) (:objects cup - item hall lab - place {objects})
  (:init {init}) (:goal {goal}))"""
_EVERYTHING = "(at hall) (linked hall lab) (stands cup lab) (lit) (unknown (seen cup))"


def _missing(model: Model) -> list[tuple[Missing, ...]]:
    """For each part of the goal that nothing can make true, what it lacks."""
    assert model.goal is not None
    reached = reach(model, beginning(model, Report(), Limits()), Limits())
    lowering, search = Lowering(Atoms(reached), Limits()), Search(reached, Limits())
    return [search.missing(part) for part in conjuncts(model.goal) if lowering.is_never(part)]


def _doubts(model: Model) -> list[Diagnostic]:
    found = goal_doubts(model, Limits())
    assert found is not None, "it can be grounded"
    return found


def _words(without: str, objects: str = "eye - camera", goal: str = "(held cup)") -> list[str | None]:
    assert not without or without in _EVERYTHING
    init = _EVERYTHING.replace(without, "") if without else _EVERYTHING
    text = _HIDDEN_ROOM.format(objects=objects, init=init, goal=goal)
    return [doubt.hint for doubt in _doubts(model_of(text)) if doubt.code == "BBT0316"]


def test_a_goal_within_reach_lacks_nothing() -> None:
    assert _words("") == []


@pytest.mark.parametrize(
    ("forgotten", "told"),
    [
        ("(at hall)", "only `go` could make `at(hall)` true, and never can: is it missing in `:init`?"),
        (
            "(linked hall lab)",
            "`go` needs `linked(?a,lab)`, and no action makes it so, nor does `:init` give it",
        ),
        (
            "(stands cup lab)",
            "`look` needs `stands(cup,?p)`, and no action makes it so, nor does `:init` give it",
        ),
        ("(lit)", "`look` needs `lit()`, and no action makes it so, nor does `:init` give it"),
        ("(unknown (seen cup))", "`look` needs `seen(cup)` to be unknown, and nothing makes it so"),
    ],
)
def test_each_forgotten_fact_is_named_however_far_from_the_goal(forgotten: str, told: str) -> None:
    assert _words(forgotten) == [told]


def test_a_forgotten_object_is_named_by_its_type() -> None:
    assert _words("", objects="") == ["there is no object of type `camera` for `look`"]


def test_a_fact_that_nobody_sets_is_named_with_the_one_that_may_be_meant() -> None:
    text = "(define (domain d) (:predicates (ready) (done)) (:action pour :effect (done)))"
    problem = "(define (problem x) (:domain d) (:init) (:goal (ready)))"
    (doubt,) = _doubts(model_of(text + problem))
    assert (
        doubt.hint
        == "no action makes `ready()` true, nor does `:init` give it (is `done` meant? nothing reads it)"
    )


def test_of_alternatives_the_nearest_to_hand_is_told() -> None:
    assert _words("(unknown (seen cup))", goal="(or (held cup) (linked lab hall))") == [
        "`look` needs `seen(cup)` to be unknown, and nothing makes it so"
    ], "to say one thing of the start is likelier than a map without a way"


def test_a_long_way_to_the_root_is_followed_to_its_end() -> None:
    rooms = 1500
    steps = "".join(
        f"(:action go{n} :precondition (at{n}) :effect (at{n + 1}))" for n in range(rooms)
    )  # deeper than the stack
    names = " ".join(f"(at{n})" for n in range(rooms + 1))
    domain = f"(define (domain d) (:predicates {names}) {steps})"
    model = model_of(f"{domain} (define (problem x) (:domain d) (:init) (:goal (at{rooms})))")
    (doubt,) = _doubts(model)
    assert doubt.hint == "`go0` needs `at0()`, and no action makes it so, nor does `:init` give it"


def _refused(model: Model) -> bool:
    try:
        ground(model, Report(), Limits())
    except BbtcError as error:
        return any(each.code == "BBT0412" for each in error.diagnostics)
    return False


def test_a_check_warns_about_just_the_goals_that_planning_refuses() -> None:
    warned = 0
    for seed in range(amount(100, 4000)):
        model = model_of(random_text(seed))
        doubts = _doubts(model)
        assert bool(doubts) == _refused(model), seed
        warned += bool(doubts)
    assert warned > amount(100, 4000) / 50, "there are such goals"


def _given(model: Model, missing: tuple[Missing, ...]) -> Model | None:
    """The model with what is missing given at the start; None where that is no fact of certain objects."""
    facts = []
    names = sorted(model.objects)
    for each in missing:
        what = each.what
        if isinstance(what, (NoObject, NoneTogether)) or model.predicates[what.predicate].derived:
            return None
        if None in what.row:
            return None
        args = tuple(names[number] for number in what.row if number is not None)
        facts.append(InitialFact(what.predicate, args, what.value))
    from dataclasses import replace

    given = {(fact.predicate, fact.args) for fact in facts}
    kept = tuple(fact for fact in model.init.facts if (fact.predicate, fact.args) not in given)
    return replace(model, init=replace(model.init, facts=(*kept, *facts)))


def test_to_give_what_is_missing_puts_the_goal_within_reach() -> None:
    """On random texts: whatever is told as the root of a goal out of reach, if it is given, the goal is
    not refused any more, or for want of something else, deeper down."""
    mended = tried = 0
    for seed in range(amount(200, 8000)):
        model = model_of(random_text(seed))
        if not _refused(model):
            continue
        for time in range(6):
            missing = tuple(each for part in _missing(model) for each in part)
            more = _given(model, missing) if missing else None
            if more is None:
                break
            tried += time == 0
            model = more
            if not _refused(model):
                mended += 1
                break
    assert tried
    assert mended >= tried * 0.8, (mended, tried)


def test_a_derived_fact_that_may_be_false_is_not_what_is_missing() -> None:
    """Here it is false; what could make it so at all is not followed."""
    model = model_of("""(define (domain track) (:predicates (jammed) (blocked) (fuelled) (there))
      (:derived (blocked) (jammed))
      (:action jam :effect (jammed))
      (:action drive :precondition (and (not (blocked)) (fuelled)) :effect (there)))
    (define (problem ahead) (:domain track) (:init) (:goal (there)))""")
    hints = [doubt.hint for doubt in _doubts(model)]
    assert hints == ["`drive` needs `fuelled()`, and no action makes it so, nor does `:init` give it"]
