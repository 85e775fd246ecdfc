"""Input made to exhaust a parser gets a diagnostic, in time and memory linear in its size."""

from __future__ import annotations

import time

import pytest

from bbtc.diagnostics import Report
from bbtc.source import SourceFile
from bbtc.syntax import ast
from bbtc.syntax.parser import MAX_DEPTH, parse
from bbtc.syntax.recover import MAX_ERRORS
from tests.long_form import amount

HEAD = "(define (domain d) (:action a :effect "


def _parse(text: str, max_depth: int = MAX_DEPTH) -> tuple[ast.Document, Report]:
    report = Report()
    return parse(SourceFile("test.pddl", text), report, max_depth), report


def _codes(text: str) -> list[str]:
    return [diagnostic.code for diagnostic in _parse(text)[1]]


def _nested(depth: int) -> str:
    return f"{HEAD}{'(and ' * depth}(p){')' * depth}))"


def test_depth_is_bounded() -> None:
    # Definition and action are two levels, the atom is one.
    assert _codes(_nested(MAX_DEPTH - 3)) == []
    assert _codes(_nested(MAX_DEPTH - 2)) == ["BBT0005"]
    assert _parse(_nested(500), max_depth=600)[1].errors == []


def test_the_place_that_is_too_deep() -> None:
    [diagnostic] = _parse(_nested(100_000))[1]
    assert diagnostic.span is not None
    assert diagnostic.span.start == len(HEAD) + 5 * (MAX_DEPTH - 2)


@pytest.mark.parametrize("word", ["probabilistic 0.5", "oneof", "not", "when (p)", "increase (c)", "(", "x"])
def test_deep_nesting_of_any_form(word: str) -> None:
    assert _codes(f"{HEAD}{f'({word} ' * 100_000}") == ["BBT0005"]


def _many(number: int) -> int:
    """In the short form half as many, within a quarter of the time, which tells of quadratic time as well."""
    return number // amount(2, 1)


MOST_SECONDS = 30 / amount(2**2, 1)

HOSTILE = {
    "closing": ")" * _many(1_000_000),
    "pairs": "()" * _many(500_000),
    "pairs in an effect": f"{HEAD}(and {'() ' * _many(300_000)})))",
    "long name": f"{HEAD}({'a' * _many(1_000_000)})))",
    "long atom": f"{HEAD}(p{' a' * _many(300_000)})))",
    "long atom with a foreign end": f'{HEAD}(p{" a" * _many(300_000)} ")))',
    "long list": f"(define (problem p) (:objects{' a' * _many(300_000)}))",
    "long typed list": f"(define (problem p) (:objects{' a - t' * _many(100_000)}))",
    "long list with a bad end": f"(define (problem p) (:objects{' a' * _many(300_000)} ?x))",
    "hyphens": f"(define (problem p) (:objects a{'-' * _many(1_000_000)}))",
    "hyphens apart": f"(define (problem p) (:objects {'a- ' * _many(300_000)}))",
    "variables": f"(define (domain p) (:predicates (p{' ?x' * _many(300_000)})))",
    "digits": f"{HEAD}(probabilistic {'1' * _many(1_000_000)} (p))))",
    "bad facts": f"(define (problem p) (:init {'(p :a) ' * _many(100_000)}))",
    "stray words": f"(define (problem p) {'x ' * _many(500_000)})",
    "stray sections": f"(define (problem p) {'(:what) ' * _many(100_000)})",
    "quotation marks": "(define (problem p) " + '" ' * _many(500_000) + ")",
    "comment": ";" * _many(1_000_000),
    "comments": ";\n" * _many(500_000),
    "spaces": " " * _many(1_000_000),
    "fields": f"(define (domain d) (:action a {':effect ' * _many(100_000)}))",
    "facts": f"(define (problem p) (:init {'(p a) ' * _many(100_000)}))",
    "unsupported": f"(define (problem p) (:constraints {'(p a) ' * _many(100_000)}))",
    "unclosed actions": "(define (domain d)\n" + "(:action a :effect (p)\n" * _many(30_000),
}


@pytest.mark.parametrize("title", HOSTILE)
def test_hostile_text_ends(title: str) -> None:
    start = time.process_time()
    _, report = _parse(HOSTILE[title])
    assert time.process_time() - start < MOST_SECONDS
    # One diagnostic more says that there are others.
    assert len(list(report)) <= MAX_ERRORS + 1
