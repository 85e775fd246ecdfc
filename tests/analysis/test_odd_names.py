"""Names that begin or end with a hyphen, or with any other character that names may hold: read everywhere."""

from __future__ import annotations

from fractions import Fraction

import pytest

import bbtc
from bbtc.limits import Limits
from bbtc.pipeline import format_source
from bbtc.source import SourceFile
from bbtc.verifier.verdict import verify
from tests.ground.examples import model_of

ODD_NAMES = ["-z", "--z", "z-", "-1", "+1", ".5", "-.5e3", "1e3", "*z", "@z", "#z", "$", "%!~", "--"]

# In the place of each `…`, a name of its own kind.
GARDEN = """(define (domain …d)
  (:types …t …o - object)
  (:constants …c - …t)
  (:predicates (…p ?…x - …t) (unknown (…k)) (…q))
  (:functions (total-cost) (…f ?…x - …t))
  (:derived (…r ?…x - …t) (and (…p ?…x) (not (= ?…x …c))))
  (:action …a
    :parameters (?…x ?…y - …t)
    :precondition (and (…p ?…x) (not (…p ?…y)) (not (= ?…x ?…y)))
    :effect (and (…p ?…y) (not (…p ?…x)) (increase (total-cost) (…f ?…y))))
  (:action …s
    :precondition (and (exists (?…x - …t) (…r ?…x)) (unknown (…k)))
    :effect (probabilistic 1/2 (and (…q) (…k)) 1/2 (not (…k)))))
(define (problem …i) (:domain …d)
  (:objects …b - …t)
  (:init (…p …c) (unknown (…k)) (= (…f …c) -1) (= (…f …b) 3))
  (:goal (and (…q) (…k) (…p …b)))
  (:goal-probability 1/2))"""


def garden(odd: str) -> str:
    """The garden with odd names: such a name before or after a letter that tells the kinds apart."""
    text = GARDEN
    for kind in "dtocpkqfrasibxy":
        text = text.replace(f"…{kind}", f"{kind}{odd}" if odd == "z-" else f"{odd}{kind}")
    return text


@pytest.mark.parametrize("odd", ODD_NAMES)
def test_every_thing_can_have_an_odd_name(odd: str) -> None:
    text = garden(odd)
    source = SourceFile("garden.pddl", text)
    plain = bbtc.plan(SourceFile("garden.pddl", GARDEN.replace("…", "n")))
    plan = bbtc.plan(source)
    assert plan.tree.success_probability == plain.tree.success_probability == Fraction(1, 2)
    assert plan.figures.cost == plain.figures.cost
    assert verify(plan.tree, Limits(), "all").problems == ()
    laid_out = format_source(source)
    assert bbtc.dumps(bbtc.compile(SourceFile("garden.pddl", laid_out))) == bbtc.dumps(plan.tree.task)
    assert format_source(SourceFile("garden.pddl", laid_out)) == laid_out


@pytest.mark.parametrize("odd", ODD_NAMES)
def test_a_tree_of_odd_names_goes_into_an_engine_and_back(odd: str) -> None:
    tree = bbtc.plan(SourceFile("garden.pddl", garden(odd))).tree
    xml = bbtc.export(tree, "btcpp")
    back = bbtc.import_tree(SourceFile("tree.xml", xml), SourceFile("garden.pddl", garden(odd)))
    assert back.success_probability == tree.success_probability
    compile(str(bbtc.export(tree, "py_trees")), "tree.py", "exec")


@pytest.mark.parametrize("name", ["-1", "+1", ".5", "1e3", "-1.5", "7"])
def test_what_looks_like_a_number_is_a_name_where_names_stand(name: str) -> None:
    text = f"""(define (domain d) (:predicates (p ?x) (q)) (:functions (total-cost) (f ?x))
      (:action a :parameters (?x) :precondition (and (p ?x) (= ?x {name}))
        :effect (and (q) (increase (total-cost) (+ (f ?x) 1)))))
      (define (problem e) (:domain d) (:objects {name} b) (:init (p {name}) (= (f {name}) -1) (= (f b) 2))
        (:goal (q)))"""
    (action,) = bbtc.compile(SourceFile("numbers.pddl", text)).actions
    assert (action.args, action.cost) == ((name,), 0)


def test_a_hyphen_without_space_stands_before_a_type_that_there_is() -> None:
    text = """(define (domain d) (:types room box -object) (:predicates (p ?x)))
      (define (problem e) (:domain d)
        (:objects hall -room kitchen attic- room red- -blue - box cellar -den) (:init) (:goal (p hall)))"""
    objects = {name: thing.types for name, thing in model_of(text).objects.items()}
    assert objects == {
        "hall": ("room",),
        "kitchen": ("room",),
        "attic": ("room",),
        "red-": ("box",),
        "-blue": ("box",),
        "cellar": ("object",),
        "-den": ("object",),
    }


def test_names_of_a_competition_end_with_a_hyphen_before_a_comment_and_a_type() -> None:
    text = """(define (domain d) (:types fork) (:predicates (p ?x)))
      (define (problem e) (:domain d) (:objects
          fork-0- fork-1- ;; and so on
          - fork
          table- - object) (:init (p fork-0-)) (:goal (p table-)))"""
    objects = {name: thing.types for name, thing in model_of(text).objects.items()}
    assert objects == {"fork-0-": ("fork",), "fork-1-": ("fork",), "table-": ("object",)}
