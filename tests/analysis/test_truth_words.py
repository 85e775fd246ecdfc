"""``(known a)`` is the fact of a declared predicate with one argument, else short for ``(known (a))``."""

from __future__ import annotations

from fractions import Fraction

import pytest

from bbtc.analysis.check import check
from bbtc.diagnostics import BbtcError, Report, Severity
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, format_source
from bbtc.planner.bounds import task_value
from bbtc.source import SourceFile
from tests.ground.examples import model_of


def _value(text: str) -> tuple[Fraction, Fraction | None]:
    """The best probability, and the least cost of it; the same for the canonical layout."""
    found = []
    for each in (text, format_source(SourceFile("words.pddl", text))):
        task = compile_sources([SourceFile("words.pddl", each)], Report(), Limits())
        value = task_value(task, Limits(), costs=True)
        assert value.lower == value.upper
        found.append((value.lower, value.cost))
    assert found[0] == found[1]
    return found[0]


def _watch(predicates: str, goal: str, init: str = "(lamp)") -> str:
    """Looking at a thing makes it known one time in four, at a cost of 1; the fact (lamp) is true."""
    return (
        f"(define (domain watch) (:types thing) (:predicates {predicates} (lamp) (seen ?t - thing))"
        " (:action look :parameters (?t - thing) :precondition (not (seen ?t))"
        "  :effect (and (seen ?t) (when (lamp) (probabilistic 1/4 (known ?t)))))"
        " (:action wait :parameters (?t - thing) :precondition (seen ?t) :effect (not (seen ?t))))"
        "(define (problem one) (:domain watch) (:objects lamp desk - thing)"
        f" (:init {init}) (:goal {goal}))"
    )


_KNOWN = "(known ?t - thing)"


@pytest.mark.parametrize(
    ("init", "goal", "best", "cost"),
    [
        # Looking and waiting in turns: an expected 4 looks with 3 waits between them.
        ("(lamp)", "(known lamp)", 1, 7),
        ("(lamp)", "(and (known lamp))", 1, 7),
        ("(lamp)", "(not (known lamp))", 1, 0),
        ("(lamp) (known lamp)", "(and (known lamp) (not (known desk)))", 1, 0),
        # Two looks without a wait; in 9 of 16 runs more follow, each after a wait, an expected 4 of them.
        (
            "(lamp) (not (known lamp))",
            "(exists (?t - thing) (known ?t))",
            1,
            1 + Fraction(3, 4) + Fraction(9, 2),
        ),
        ("(lamp)", "(known (lamp))", 1, 0),
        ("(lamp)", "(and (known (lamp)) (known (known lamp)))", 1, 0),
        ("(lamp) (unknown (known lamp))", "(unknown (known lamp))", 1, 0),
        ("(lamp) (unknown (known lamp))", "(known (known lamp))", 1, 7),
        ("(lamp) (probabilistic 1/4 (known lamp))", "(known lamp)", 1, Fraction(21, 4)),
    ],
)
def test_a_declared_predicate_has_the_word_for_its_objects(
    init: str, goal: str, best: int, cost: Fraction
) -> None:
    assert _value(_watch(_KNOWN, goal, init)) == (best, cost)


def _short(predicates: str, lamp: str) -> str:
    return (
        f"(define (domain watch) (:types thing) (:predicates (lamp) (on) {predicates})"
        f" (:action cover :precondition (and (lamp) (known {lamp}) (not (unknown {lamp})))"
        f"  :effect (and (unknown {lamp})))"
        f" (:action look :precondition (unknown {lamp})"
        "  :effect (probabilistic 1/2 (and (lamp) (on)) 1/2 (not (lamp)))))"
        "(define (problem one) (:domain watch) (:objects bulb - thing)"
        f" (:init (unknown {lamp})) (:goal (and (known {lamp}) (on))))"
    )


@pytest.mark.parametrize("predicates", ["", "(unknown ?a ?b - thing) (known)", "(known ?a ?b - thing)"])
def test_the_short_form_says_what_the_long_one_says(predicates: str) -> None:
    """Also where predicates have the words with other numbers of arguments."""
    assert _value(_short(predicates, "lamp")) == _value(_short(predicates, "(lamp)")) == (Fraction(1, 2), 1)


def test_where_either_reading_may_be_meant_the_one_taken_is_told() -> None:
    text, report = _watch(_KNOWN, "(known lamp)"), Report()
    model = model_of(text, report)
    told = [(each.code, each.severity, each.span and each.span.text) for each in report]
    assert told == [("BBT0227", Severity.NOTE, "(known lamp)")]
    assert [each.span and each.span.text for each in check(model) if each.code == "BBT0227"] == ["known"]
    plain = Report()
    model_of(_watch(_KNOWN, "(known desk)"), plain)
    assert not list(plain)


@pytest.mark.parametrize("place", [":effect", ":init"])
@pytest.mark.parametrize("said", ["(known lamp)", "(not (known lamp))"])
def test_a_test_sets_no_fact(place: str, said: str) -> None:
    text = (
        "(define (domain watch) (:predicates (lamp) (on))"
        f" (:action look :effect (and (on) {said if place == ':effect' else ''})))"
        "(define (problem one) (:domain watch)"
        f" (:init {said if place == ':init' else ''}) (:goal (on)))"
    )
    with pytest.raises(BbtcError) as raised:
        compile_sources([SourceFile("words.pddl", text)], Report(), Limits())
    assert all(each.severity is Severity.ERROR for each in raised.value.diagnostics)


def _missing(text: str) -> list[str]:
    return [each.message for each in check(model_of(text)) if each.code == "BBT0311"]


def test_only_a_test_needs_the_requirement() -> None:
    wanted = "(:requirements :typing :negative-preconditions :conditional-effects :probabilistic-effects)"
    text = _watch(_KNOWN, "(known lamp)").replace("(:types", f"{wanted} (:types")
    assert _missing(text) == []
    tested = text.replace(":precondition (not", ":precondition (and (known (lamp)) (not", 1)
    tested = tested.replace("(seen ?t))  :effect", "(seen ?t)))  :effect", 1)
    assert any("`:unknown`" in message for message in _missing(tested))
