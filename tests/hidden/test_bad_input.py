"""Files with hidden state that are wrong, or come from strangers: a clear message each, and nothing else."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bbtc.codes import CODES
from bbtc.diagnostics import BbtcError, LimitReached, Report
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse
from tests.hidden.texts import texts
from tests.long_form import amount
from tests.profiles import examples

TEXT = """(define (domain d) (:predicates (h) (i) (j) (done))
  (:action look :observe {told})
  (:action go :precondition (h) :effect (done)))
(define (problem x) (:domain d) (:init {init}) (:goal (done)))"""


def refusals(text: str) -> list[tuple[str, str]]:
    """The code and the place of everything that stops a text; nothing where it compiles."""
    try:
        compile_sources([SourceFile("x.pddl", text)], Report(), Limits())
    except (BbtcError, LimitReached) as error:
        return [(each.code, "" if each.span is None else text[each.span.start : each.span.end])
                for each in error.diagnostics]  # fmt: skip
    return []


@pytest.mark.parametrize(
    ("init", "code", "place"),
    [
        ("(oneof (h) (i)) (h) (i)", "BBT0414", "(oneof (h) (i))"),
        ("(oneof (h) (i)) (not (h)) (not (i))", "BBT0414", "(oneof (h) (i))"),
        ("(or (h) (i)) (not (h)) (not (i))", "BBT0414", "(or (h) (i))"),
        ("(oneof (h) (i)) (oneof (h) (j)) (or (not (h)) (j)) (or (h) (not (j)))", "BBT0414", None),
        ("(or (h) (i)) (or (not (h)) (i)) (or (h) (not (i))) (or (not (h)) (not (i)))", "BBT0414", None),
        # A contradiction among facts that do not matter, too.
        ("(unknown (h)) (or (i) (j)) (or (not (i)) (j)) (or (i) (not (j))) (or (not (i)) (not (j)))",
         "BBT0414", None),
        ("(unknown (h)) (or (i) (j)) (not (i)) (not (j))", "BBT0414", "(or (i) (j))"),
        ("(probabilistic 0.7 (h) 0.7 (i))", "BBT0211", None),
        ("(probabilistic 1.5 (h))", "BBT0210", "1.5"),
        ("(probabilistic -0.5 (h))", "BBT0210", "-0.5"),
        ("(unknown (h)) (h)", "BBT0223", None),
        ("(oneof)", "BBT0418", "(oneof)"),
        ("(unknown (h)) (oneof)", "BBT0418", "(oneof)"),
        ("(oneof (h) (and (i) (oneof)))", "BBT0418", "(oneof)"),
        ("(forall (?x) (oneof))", "BBT0418", "(oneof)"),
        ("(unknown (h)) (or)", "BBT0418", "(or)"),
        ("(and (h) (or))", "BBT0418", "(or)"),
    ],
)  # fmt: skip
def test_a_start_that_cannot_be(init: str, code: str, place: str | None) -> None:
    found = refusals(TEXT.format(told="(h)", init=init))
    assert [each for each, _ in found] == [code]
    assert place is None or found[0][1] == place


def test_an_effect_of_one_of_nothing_is_refused() -> None:
    text = TEXT.format(told="(h)", init="(unknown (h))").replace(":effect (done)", ":effect (oneof)")
    assert refusals(text) == [("BBT0418", "(oneof)")]


@pytest.mark.parametrize("init", ["(oneof (h))", "(unknown (i)) (oneof (h))", "(unknown (i)) (or (h))"])
def test_one_of_one_is_so(init: str) -> None:
    source = SourceFile("x.pddl", TEXT.format(told="(i)", init=init))
    task = compile_sources([source], Report(), Limits())
    (at,) = (number for number, variable in enumerate(task.variables) if variable.name == "h()")
    assert [state.values[at] for state in task.initial] == [Truth.TRUE]


@pytest.mark.parametrize(
    ("told", "code"),
    [
        ("(probabilistic 1.5 (h))", "BBT0210"),
        ("(probabilistic 0.5 (and (h) (i)))", "BBT0406"),
        ("(probabilistic 0.5 (and))", "BBT0406"),
        ("(unknown (h))", "BBT0406"),
        ("", "BBT0101"),
        ("(when (h) (i))", "BBT0101"),
        ("(nowhere)", "BBT0202"),
    ],
)
def test_an_observation_of_nothing_or_of_no_sense(told: str, code: str) -> None:
    found = refusals(TEXT.format(told=told, init="(unknown (h))"))
    assert [each for each, _ in found] == [code]


@pytest.mark.parametrize("told", ["()", "(and)", "(or)", "(done)"])
def test_an_observation_that_tells_nothing_is_warned_of(told: str) -> None:
    report = Report()
    compile_sources([SourceFile("x.pddl", TEXT.format(told=told, init="(unknown (h))"))], report, Limits())
    assert "BBT0417" in {each.code for each in report}


def test_a_draw_of_very_many_branches_is_refused() -> None:
    names = " ".join(f"o{number}" for number in range(amount(20_000, 300_000)))
    text = f"""(define (domain d) (:predicates (p ?x) (done))
      (:action look :parameters (?x) :observe (p ?x))
      (:action go :parameters (?x) :precondition (p ?x) :effect (done)))
    (define (problem x) (:domain d) (:objects {names})
      (:init (oneof {" ".join(f"(p {name})" for name in names.split())})) (:goal (done)))"""
    assert refusals(text) == [("BBT0404", "(oneof")]


@pytest.mark.parametrize(
    ("draw", "code"),
    [
        ("(oneof {} )", "BBT0404"),
        ("(OneOf (and {}) (oneof {}))", "BBT0404"),
        ("(probabilistic {w} )", "BBT0403"),
        ("(and {} (oneof (h) (and (not (i)) {}) (i)))", None),
        ("(oneof (h) (i))) (:goal (or {})", None),
    ],
)
def test_only_branches_of_draws_in_init_are_counted(draw: str, code: str | None) -> None:
    many = 4_100
    facts, weighted = " ".join(["(h)"] * many), " ".join(["1/5000 (h)"] * many)
    text = TEXT.format(told="(h)", init=draw.replace("{w}", weighted).replace("{}", facts))
    codes = {each.code for each in _read(text)}
    assert codes == (set() if code is None else {code})


def _read(text: str) -> Report:
    report = Report()
    parse(SourceFile("x.pddl", text), report)
    return report


WORDS = [
    *("(", ")", "()", "not", "and", "or", "oneof", "probabilistic", "unknown", "known", "when", "forall"),
    *(":observe", ":effect", "1/3", "-1", "0", "1e999", "?x", "imply", "nobody"),
    *("(h)", "(or)", "(unknown(h))", "(oneof(h)(i))"),
]


@st.composite
def _broken(draw: st.DrawFn) -> str:
    """A text in which some words are others, twice there, or gone."""
    parts = re.findall(r"[()]|[^\s()]+", draw(texts(noise=True)))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(parts) - 1))
        kind = draw(st.integers(0, 3))
        if kind == 0:
            parts[at] = draw(st.sampled_from(WORDS))
        elif kind == 1:
            parts.insert(at, draw(st.sampled_from(WORDS)))
        elif kind == 2 and len(parts) > 1:
            del parts[at]
        else:
            parts.insert(at, parts[draw(st.integers(0, len(parts) - 1))])
    return " ".join(parts)


@given(_broken())
@examples(amount(210, 20_000))
def test_broken_texts_are_compiled_or_refused_by_name(text: str) -> None:
    """Anything else that is raised would be a traceback."""
    for code, _ in refusals(text):
        assert code in CODES, text
