"""Predicates, functions and templates that have the name of a keyword: read rightly, or refused where they
are declared."""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache

import pytest

from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, format_source, plan_task
from bbtc.planner.bounds import task_value
from bbtc.source import SourceFile
from bbtc.syntax.hints import keywords
from bbtc.syntax.tables import tables
from tests.long_form import LONG

_OTHERS = ["external", "observe", "sensed", "head", "domain", "problem", "define", "object", "total-cost"]
_WORDS = sorted(
    {word.lstrip(":") for words in keywords(tables().terminals).values() for word in words} | {*_OTHERS}
)
"""Every keyword of the grammar, and more words that have a meaning somewhere."""
_HEADS = (
    *("and", "or", "not", "imply", "when", "forall", "exists", "oneof", "probabilistic", "either"),
    *("increase", "decrease", "assign", "scale-up", "scale-down", "preference"),
)
_IN_BODIES = ("sequence", "fallback", "skipper", "condition", "foreach", "action")

_UNARY = """
(define (domain d) (:types thing) (:predicates (W ?x - thing) (on) (seen ?x - thing))
  (:constants lamp - thing)
  (:derived (seen ?x - thing) (and (W ?x) (on)))
  (:action press :parameters (?x - thing) :precondition (and (not (W ?x)) (on))
    :effect (and (when (not (W lamp)) (W lamp)) (forall (?y - thing) (W ?y))))
  (:action start :precondition (W lamp) :effect (and (on) (not (W lamp)) (W box))))
(define (problem q) (:domain d) (:objects box crate - thing)
  (:init (W lamp) (not (W crate)))
  (:goal (and (W box) (W lamp) (not (not (W crate))) (exists (?x - thing) (seen ?x)))))
"""
_BARE = """
(define (domain d) (:predicates (W) (on))
  (:action start :precondition (and (W)) :effect (and (on) (not (W))))
  (:action stop :precondition (not (W)) :effect (probabilistic 1/2 (and (W)))))
(define (problem q) (:domain d) (:init (W)) (:goal (and (on) (W))))
"""
_BINARY = """
(define (domain d) (:predicates (W ?x ?y) (on ?x))
  (:action start :parameters (?x ?y) :precondition (W ?x ?y) :effect (and (on ?y) (not (W ?x ?y)) (W ?y ?x))))
(define (problem q) (:domain d) (:objects a b) (:init (W a b)) (:goal (and (on a) (on b) (W a b))))
"""
_TEMPLATE = """
(define (domain d) (:predicates (W ?x) (on ?x))
  (:action start :parameters (?x) :precondition (W ?x) :effect (on ?x))
  (:action warm :parameters (?x) :effect (W ?x))
  (:template do :parameters (?x) :precondition (not (W ?x)) :effect (and (on ?x) (W ?x))
    :body (sequence (warm ?x) (condition (W ?x)) (start ?x))))
(define (problem q) (:domain d) (:objects a) (:goal (and (on a) (W a))))
"""
_FUNCTION = """
(define (domain d) (:predicates (on)) (:functions (total-cost) (W ?x))
  (:action start :parameters (?x) :effect (and (on) (increase (total-cost) (+ (W ?x) 1)))))
(define (problem q) (:domain d) (:objects a b) (:init (= (W a) 3) (= (W b) 2)) (:goal (on)))
"""
_CALLED = """
(define (domain d) (:predicates (on))
  (:action start :effect (on))
  (:template W :body (sequence (start) (condition (on))))
  (:template do :effect (on) :body (fallback (W) (start))))
(define (problem q) (:domain d) (:init (not (on))) (:goal (on)))
"""
_OBJECT = """
(define (domain d) (:predicates (at ?x) (on))
  (:action go :parameters (?x ?y)
    :precondition (and (at ?x) (not (= ?y W))) :effect (and (at ?y) (not (at ?x)))))
(define (problem q) (:domain d) (:objects W b) (:init (at W)) (:goal (and (at b) (not (at W)))))
"""


@cache
def _task(text: str) -> Task:
    return compile_sources([SourceFile("words.pddl", text)], Report(), Limits())


@cache  # the same text with the plain word stands beside each keyword
def _figures(text: str) -> tuple[Fraction, Fraction | None, Fraction]:
    """The best probability, the least cost, and what a tree reaches."""
    task = _task(text)
    value = task_value(task, Limits(), costs=True)
    assert value.lower == value.upper
    strategy = "refine" if task.templates else "auto"
    plan = plan_task(task, None, strategy, Limits(), lambda _: None)
    return value.lower, value.cost, plan.tree.success_probability


def _of(text: str, word: str) -> str:
    return re.sub(r"\bW\b", word, text)


_SPECIAL = {*_HEADS, *_IN_BODIES, *_OTHERS}


def _named(texts: list[str]) -> list[tuple[str, str]]:
    """Each text with each word; in the short form with every other of those that mean nothing at the head of
    a form."""
    return [
        (text, word)
        for row, text in enumerate(texts)
        for column, word in enumerate(_WORDS)
        if LONG or word in _SPECIAL or (row + column) % 2 == 0
    ]


@pytest.mark.parametrize(("text", "word"), _named([_UNARY, _BARE, _BINARY, _TEMPLATE]))
def test_a_predicate_means_the_same_whatever_its_name_or_is_refused(text: str, word: str) -> None:
    own = _of(text, word)
    if word in _HEADS:
        with pytest.raises(BbtcError) as refused:
            _figures(own)
        # Its uses may be errors, too; the first one tells of the declaration.
        assert refused.value.diagnostics[0].code == "BBT0228"
        assert refused.value.diagnostics[0].message == f"a predicate cannot be called `{word}`"
        return
    expected = _figures(_of(text, "w"))
    assert _figures(own) == expected
    assert _task(format_source(SourceFile("words.pddl", own))) == _task(own)


@pytest.mark.parametrize(("text", "word"), _named([_FUNCTION, _CALLED, _OBJECT]))
def test_a_function_a_template_or_an_object_means_the_same_whatever_its_name_or_is_refused(
    text: str, word: str
) -> None:
    kinds = {_FUNCTION: ("function", _HEADS), _CALLED: ("template", _IN_BODIES), _OBJECT: ("object", ())}
    kind, refused = kinds[text]
    if word in refused:
        with pytest.raises(BbtcError) as raised:
            _figures(_of(text, word))
        assert raised.value.diagnostics[0].message == f"a {kind} cannot be called `{word}`"
    elif kind == "template" and word in _HEADS:
        # What no body can call is for the planner to insert.
        assert _figures(_of(text, word).replace(f"({word}) (start)", "(start)")) == _figures(_of(text, "w"))
    elif kind != "function" or word not in {"total-cost", "reward"}:
        assert _figures(_of(text, word)) == _figures(_of(text, "w"))


_EQUAL = """
(define (domain d) (:predicates (= ?x ?y) (at ?x))
  (:action go :parameters (?x ?y) :precondition (and (at ?x) (not (= ?x ?y))) :effect (at ?y)))
(define (problem q) (:domain d) (:objects a b) (:init (at a)) (:goal (at b)))
"""


def test_equality_may_be_declared_as_what_it_is() -> None:
    assert _figures(_EQUAL) == _figures(_EQUAL.replace("(= ?x ?y) (at ?x)", "(at ?x)"))
    assert _figures(format_source(SourceFile("equal.pddl", _EQUAL))) == _figures(_EQUAL)
    with pytest.raises(BbtcError) as raised:
        _figures(_EQUAL.replace("(= ?x ?y) (at ?x)", "(= ?x) (at ?x)"))
    assert [each.code for each in raised.value.diagnostics] == ["BBT0228"]
