"""Which worlds the start allows, and how likely each is."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from tests.ground.examples import task_of
from tests.profiles import examples

DOMAIN = """(define (domain d) (:types t)
  (:predicates (p ?x - t) (q) (done))
  (:action look :parameters (?x - t) :observe (p ?x))
  (:action peek :observe (q))
  (:action claim :parameters (?x - t) :precondition (p ?x) :effect (done))
  (:action end :precondition (q) :effect (done)))
(define (problem x) (:domain d) (:objects a b c - t) (:init {}) (:goal (done)))"""


def worlds(task: Task) -> dict[frozenset[str], Fraction]:
    """The true facts of every world, those of all components together."""
    found: dict[frozenset[str], Fraction] = {}
    for combined in product(*(component.prior for component in task.components)):
        true: set[str] = set()
        weight = Fraction(1)
        for component, (world, probability) in zip(task.components, combined, strict=True):
            true |= {fact for place, fact in enumerate(component.facts) if world >> place & 1}
            weight *= probability
        found[frozenset(true)] = weight
    return found


def _sets(*worlds: tuple[str, str]) -> dict[frozenset[str], Fraction]:
    names = {"a": "p(a)", "b": "p(b)", "c": "p(c)", "q": "q()"}
    return {frozenset(names[letter] for letter in true): Fraction(weight) for true, weight in worlds}


@pytest.mark.parametrize(
    ("init", "expected"),
    [
        ("(oneof (p a) (p b) (p c)) (q)", [("a", "1/3"), ("b", "1/3"), ("c", "1/3")]),
        ("(oneof (p a) (not (p a))) (p b) (p c) (q)", [("", "1/2"), ("a", "1/2")]),
        # What shares a fact is conditioned together.
        ("(oneof (p a) (p b)) (oneof (p b) (p c)) (q)", [("b", "1/2"), ("ac", "1/2")]),
        ("(oneof (p a) (p b)) (oneof (p c) (q))", [(each, "1/4") for each in ("ac", "aq", "bc", "bq")]),
        ("(or (p a) (p b)) (p c) (q)", [("a", "1/3"), ("b", "1/3"), ("ab", "1/3")]),
        ("(or (not (p a)) (p b)) (p c) (q)", [("", "1/3"), ("b", "1/3"), ("ab", "1/3")]),
        ("(unknown (p a)) (unknown (p b)) (p c) (q)", [(each, "1/4") for each in ("", "a", "b", "ab")]),
        # A fact of a oneof that is called unknown, too, is drawn once.
        ("(oneof (p a) (p b)) (unknown (p a)) (unknown (p b)) (p c) (q)", [("a", "1/2"), ("b", "1/2")]),
        # Of branches that are compound the branch is drawn.
        ("(oneof (and (p a) (p b)) (p c)) (q)", [("ab", "1/2"), ("c", "1/2")]),
        ("(oneof (and (p a) (p b)) (and (p a) (p c)) (and)) (q)",
         [("ab", "1/3"), ("ac", "1/3"), ("", "1/3")]),
        # What is given is given.
        ("(oneof (p a) (p b) (p c)) (not (p a)) (q)", [("b", "1/2"), ("c", "1/2")]),
        ("(or (p a) (p b)) (p a) (unknown (p b)) (p c) (q)", [("", "1/2"), ("b", "1/2")]),
        # Weights.
        ("(probabilistic 0.3 (p a)) (oneof (q) (not (q))) (p b) (p c)",
         [("", "0.35"), ("a", "0.15"), ("q", "0.35"), ("aq", "0.15")]),
        ("(probabilistic 0.2 (p a) 0.3 (p b)) (or (p a) (p b)) (p c) (q)", [("a", "2/5"), ("b", "3/5")]),
        ("(probabilistic 1/2 (p a)) (probabilistic 1/2 (p a)) (unknown (q)) (p b) (p c)",
         [("", "1/8"), ("a", "3/8"), ("q", "1/8"), ("aq", "3/8")]),
        ("(forall (?x - t) (probabilistic 1/2 (p ?x))) (oneof (q) (not (q)))",
         [("".join(each), "1/16") for each in product(*(("", letter) for letter in "abcq"))]),
        ("(or (p a) (q)) (or (p b) (q)) (or (p c) (q)) (unknown (q))",
         [("".join(each) + "q", "1/9") for each in product(*(("", letter) for letter in "abc"))]
         + [("abc", "1/9")]),
    ],
)  # fmt: skip
def test_a_prior_is_uniform_over_facts_given_all_that_the_start_says(
    init: str, expected: list[tuple[str, str]]
) -> None:
    # p and q that are given stay seen, and are in no world.
    assert worlds(task_of(DOMAIN.format(init))) == _sets(*expected)


LITERALS = ["(p a)", "(p b)", "(p c)", "(q)"]


@st.composite
def starts(draw: st.DrawFn) -> list[tuple[str, list[tuple[str, bool]]]]:
    """Some constraints, each over literals."""
    literal = st.tuples(st.sampled_from(LITERALS), st.booleans())
    clause = st.tuples(
        st.sampled_from(["or", "oneof"]),
        st.lists(literal, min_size=2, max_size=4, unique_by=lambda each: each[0]),
    )
    return draw(st.lists(clause, min_size=1, max_size=4))


@given(starts())
@examples(60)
def test_worlds_are_the_models_of_the_start(start: list[tuple[str, list[tuple[str, bool]]]]) -> None:
    """Compared with a truth table of all four facts."""
    text = " ".join(
        f"({word} {' '.join(atom if true else f'(not {atom})' for atom, true in literals)})"
        for word, literals in start
    )
    text += " ".join(f"(unknown {atom})" for atom in LITERALS)
    models = []
    for values in product([False, True], repeat=4):
        world = dict(zip(LITERALS, values, strict=True))
        counts = [(word, [world[atom] is true for atom, true in literals]) for word, literals in start]
        if all(any(held) if word == "or" else sum(held) == 1 for word, held in counts):
            models.append(frozenset(f"p({a[3]})" if a[1] == "p" else "q()" for a in LITERALS if world[a]))
    if not models:
        with pytest.raises(BbtcError) as caught:
            task_of(DOMAIN.format(text))
        assert {each.code for each in caught.value.diagnostics} == {"BBT0414"}
        return
    found = worlds(task_of(DOMAIN.format(text)))
    assert found == dict.fromkeys(models, Fraction(1, len(models)))


def test_facts_that_nothing_joins_are_components_of_their_own() -> None:
    count = 40
    names = " ".join(f"d{number}" for number in range(count))
    text = f"""(define (domain doors) (:types door) (:predicates (open ?d - door) (done))
      (:action look :parameters (?d - door) :observe (open ?d))
      (:action unlock :parameters (?d - door) :precondition (not (open ?d)) :effect (open ?d))
      (:action end :precondition (forall (?d - door) (open ?d)) :effect (done)))
    (define (problem x) (:domain doors) (:objects {names} - door)
      (:init {" ".join(f"(unknown (open {name}))" for name in names.split())}) (:goal (done)))"""
    task = task_of(text)
    assert [component.facts for component in task.components] == sorted(
        (f"open({name})",) for name in names.split()
    )
