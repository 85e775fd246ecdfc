"""The rewrite rules of the normal form, each with what it makes of a text, and that it means the same."""

from __future__ import annotations

import re
from itertools import product

import pytest
from typing_extensions import assert_never

from bbtc.ground import effects as ground_effects
from bbtc.ground import normal
from bbtc.ground.normal import Block, Chance, Item, normal_form, normalise
from bbtc.kleene import Truth
from bbtc.model import effect as me
from bbtc.model import formula as mf
from bbtc.model.domain import Model
from bbtc.model.types import Parameter
from tests.ground.examples import model_of
from tests.ground.reference import outcomes, value
from tests.ground.test_effects import RULES as EFFECT_RULES

_TEXT = """(define (domain d) (:constants a b) (:predicates (p) (q) (r ?x) (s ?x))
  (:action act :parameters () :precondition {condition} :effect {effect}))
(define (problem x) (:domain d) (:init) (:goal (p)))"""

CONDITIONS = {
    7: [("(not (not (p)))", "(p)"), ("(not (not (not (p))))", "(not (p))")],
    8: [
        ("(not (and (p) (not (q)) (= a b)))", "(or (not (p)) (q) (not (= a b)))"),
        ("(not (or (p) (q)))", "(and (not (p)) (not (q)))"),
        ("(not (imply (p) (q)))", "(and (p) (not (q)))"),
    ],
    9: [
        ("(not (forall (?x) (r ?x)))", "(exists (?x) (not (r ?x)))"),
        ("(not (exists (?x) (r ?x)))", "(forall (?x) (not (r ?x)))"),
    ],
    10: [("(not (unknown (p)))", "(known (p))"), ("(not (known (p)))", "(unknown (p))")],
    11: [
        (
            "(forall (?x ?y) (or (r ?x) (s ?y) (= ?x ?y)))",
            "(forall (?x) (or (r ?x) (forall (?y) (or (s ?y) (= ?x ?y)))))",
        ),
        ("(exists (?x ?y) (not (= ?x ?y)))", "(exists (?x) (exists (?y) (not (= ?x ?y))))"),
    ],
    12: [
        (
            "(exists (?x) (and (p) (and (r ?x) (q)) (s ?x)))",
            "(and (p) (q) (exists (?x) (and (r ?x) (s ?x))))",
        ),
        ("(forall (?x) (or (p) (r ?x)))", "(or (p) (forall (?x) (r ?x)))"),
        ("(exists (?x) (or (p) (r ?x)))", "(exists (?x) (or (p) (r ?x)))"),
        ("(exists (?x) (p))", "(and (p) (exists (?x) (and)))"),
    ],
    13: [("(not (< 1 2))", "(>= 1 2)"), ("(not (and (p) (>= 2 1)))", "(or (not (p)) (< 2 1))")],
}
"""For each rule conditions, and what becomes of them."""

EFFECTS = {
    1: [
        ("(and (p) (and (not (q)) (unknown (r a))))", ["(p)", "(not (q))", "(unknown (r a))"]),
        ("(forall (?x) (and (r ?x) (s ?x)))", ["(forall (?x) (r ?x))", "(forall (?x) (s ?x))"]),
        ("(when (p) (and (q) (r a)))", ["(when (p) (q))", "(when (p) (r a))"]),
    ],
    2: [
        ("(when (p) (when (q) (r a)))", ["(when (and (p) (q)) (r a))"]),
        ("(when (not (or (p) (q))) (r a))", ["(when (and (not (p)) (not (q))) (r a))"]),
    ],
    3: [("(when (p) (forall (?x) (when (r ?x) (s ?x))))", ["(forall (?x) (when (and (p) (r ?x)) (s ?x)))"])],
    4: [
        ("(forall (?x) (forall (?y) (when (s ?y) (r ?x))))", ["(forall (?x ?y) (when (s ?y) (r ?x)))"]),
        (
            "(forall (?x) (when (r ?x) (probabilistic 0.5 (s ?x) 0.5 (when (p) (q)))))",
            ["(forall (?x) (when (r ?x) (probabilistic 1/2 (s ?x) 1/2 (when (p) (q)))))"],
        ),
    ],
    5: [
        ("(probabilistic 0.5 (p) 0 (q) 0.5 (r a))", ["(probabilistic 1/2 (p) 1/2 (r a))"]),
        ("(probabilistic 0 (p))", ["(and)"]),
    ],
    6: [
        ("(when (p) (probabilistic 1 (and (q) (r a))))", ["(when (p) (q))", "(when (p) (r a))"]),
        ("(oneof (p))", ["(p)"]),
        ("(probabilistic 1 (oneof (p) (q)) 0 (r a))", ["(oneof 1/2 (p) 1/2 (q))"]),
    ],
}
"""For each rule effects, and what stands side by side then."""


# --- text ------------------------------------------------------------------------------------


def _form(*words: str) -> str:
    return f"({' '.join(words)})"


def _condition(formula: mf.Formula) -> str:
    match formula:
        case mf.Atom(predicate, args):
            return _form(predicate, *args)
        case mf.Test(kind, atom):
            return _form(kind, _condition(atom))
        case mf.Equal(left, right):
            return _form("=", left, right)
        case mf.Compare(operator, me.Constant(one), me.Constant(other)):
            return _form(operator, str(one), str(other))
        case mf.Compare():
            raise AssertionError("numbers have tests of their own")
        case mf.Not(part):
            return _form("not", _condition(part))
        case mf.And(parts):
            return _form("and", *map(_condition, parts))
        case mf.Or(parts):
            return _form("or", *map(_condition, parts))
        case mf.Quantified(kind, parameters, part):
            return _form(kind, _names(parameters), _condition(part))
        case _:
            assert_never(formula)


def _names(parameters: tuple[Parameter, ...]) -> str:
    return _form(*(parameter.name for parameter in parameters))


def _block(block: Block) -> list[str]:
    """What stands side by side in a block."""
    return [_under(item, _leaf(item.leaf)) for item in block.items] + [
        _under(chance, _form("oneof" if chance.oneof else "probabilistic", *_branches(chance)))
        for chance in block.chances
    ]


def _under(part: Item | Chance, inner: str) -> str:
    """A text under the guard and the quantifiers of a part."""
    guard = [_condition(each) for each in part.guard]
    if guard:
        inner = _form("when", guard[0] if len(guard) == 1 else _form("and", *guard), inner)
    return _form("forall", _names(part.parameters), inner) if part.parameters else inner


def _branches(chance: Chance) -> list[str]:
    words = []
    for probability, branch in chance.branches:
        parts = _block(branch)
        words += [str(probability), parts[0] if len(parts) == 1 else _form("and", *parts)]
    return words


def _leaf(leaf: me.Leaf) -> str:
    assert isinstance(leaf, me.Set)
    atom = _form(leaf.predicate, *leaf.args)
    return (
        atom if leaf.value is Truth.TRUE else _form("not" if leaf.value is Truth.FALSE else "unknown", atom)
    )


# --- rules -----------------------------------------------------------------------------------


def _model(condition: str = "(and)", effect: str = "(p)") -> Model:
    return model_of(_TEXT.format(condition=condition, effect=effect))


def _worlds() -> list[dict[tuple[str, tuple[str, ...]], Truth]]:
    """Every way to give the facts of the model a value."""
    facts = [("p", ()), ("q", ()), ("r", ("a",)), ("r", ("b",)), ("s", ("a",)), ("s", ("b",))]
    return [dict(zip(facts, values, strict=True)) for values in product(Truth, repeat=len(facts))]


@pytest.mark.parametrize(("before", "after"), [pair for pairs in CONDITIONS.values() for pair in pairs])
def test_a_condition_is_rewritten(before: str, after: str) -> None:
    model = _model(condition=before)
    written = model.schemas["act"].precondition
    assert _condition(normal_form(written)) == after
    # The rewritten text is final, and means what the first one does.
    assert _condition(normal_form(_model(condition=after).schemas["act"].precondition)) == after
    for world in _worlds():
        assert value(model, normal_form(written), {}, world) == value(model, written, {}, world)
        assert value(model, normal_form(written, negative=True), {}, world) == value(
            model, mf.Not(written), {}, world
        )


@pytest.mark.parametrize(("before", "after"), [pair for pairs in EFFECTS.values() for pair in pairs])
def test_an_effect_is_rewritten(before: str, after: list[str]) -> None:
    model = _model(effect=before)
    written = model.schemas["act"].effect
    block = normalise(written)
    assert (_block(block) or ["(and)"]) == after
    again = _model(effect=_form("and", *(_parsed(text) for text in after)))
    for world in _worlds():
        assert outcomes(model, written, {}, world) == outcomes(again, again.schemas["act"].effect, {}, world)


def _parsed(text: str) -> str:
    """The text of an effect as files have it: `oneof` without its probabilities."""
    return re.sub(r"1/2 ", "", text) if "oneof" in text else text


@pytest.mark.parametrize(
    ("text", "rules"),
    [(normal.__doc__, [*EFFECTS, *CONDITIONS]), (ground_effects.__doc__, [*EFFECT_RULES])],
    ids=["normal", "effects"],
)
def test_every_rule_has_its_pairs(text: str | None, rules: list[int]) -> None:
    assert text is not None
    assert [int(number) for number in re.findall(r"^(\d+)\. ", text, re.MULTILINE)] == rules
