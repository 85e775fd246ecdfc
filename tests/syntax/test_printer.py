"""The canonical layout, as pairs of texts."""

from __future__ import annotations

import pytest

from bbtc.diagnostics import Report
from bbtc.source import SourceFile
from bbtc.syntax import ast
from bbtc.syntax.parser import parse
from bbtc.syntax.printer import print_document

PAIRS = {
    "short forms stand on one line": (
        "(define (domain d)(:requirements\n:typing)(:types a b - c)(:predicates(p ?x - a))\n)",
        """\
(define (domain d)
  (:requirements :typing)
  (:types a b - c)
  (:predicates (p ?x - a)))
""",
    ),
    "keywords are lower case, names stay": (
        "(DEFINE (Domain D) (:ACTION Go :EFFECT (AND (P A) (NOT (Q)))))",
        """\
(define (domain D)

  (:action Go
    :parameters ()
    :effect (and (P A) (not (Q)))))
""",
    ),
    "bare symbols get parentheses": (
        "(define (domain d) (:action a :precondition p :effect (probabilistic .5 q .5 (increase reward 1))))",
        """\
(define (domain d)

  (:action a
    :parameters ()
    :precondition (p)
    :effect (probabilistic .5 (q) .5 (increase (reward) 1))))
""",
    ),
    "long forms break by items": (
        """(define (problem p) (:domain d) (:init (p a) (q b)) (:goal (and
        (first-condition of-some-length with-objects)
        (second-condition of-some-length) (third-condition))))""",
        """\
(define (problem p)
  (:domain d)
  (:init
    (p a)
    (q b))
  (:goal (and
      (first-condition of-some-length with-objects)
      (second-condition of-some-length)
      (third-condition))))
""",
    ),
    "comments stay where they are": (
        """\
; about the file

;; about the domain
(define (domain d) ; a domain
  ; of predicates
  (:predicates (p) ; the first
               (q))
  ; about the action
  (:action a ; its name
    :precondition ; before the value
       (and (p) ; one
            ; two
            (q)
            ; at the end
       )
    :effect (p ; within an atom
    a))
  ; last
)
; after it
""",
        """\
; about the file

;; about the domain
(define (domain d) ; a domain
  ; of predicates
  (:predicates
    (p) ; the first
    (q))

  ; about the action
  (:action a ; its name
    :parameters ()
    :precondition ; before the value
    (and
      (p) ; one
      ; two
      (q)
      ; at the end
    )
    :effect (p ; within an atom
      a))
  ; last
)
; after it
""",
    ),
    "fields keep their order": (
        """(define (domain d) (:action a :effect (p) ; done
        :parameters (?x-t) ; of what
        :precondition (q ?x)))""",
        """\
(define (domain d)

  (:action a
    :effect (p) ; done
    :parameters (?x - t) ; of what
    :precondition (q ?x)))
""",
    ),
    "what is refused by name is kept": (
        "(define (domain d) (:durative-action  go\n:duration(= ?duration 5) ; long\n))",
        """\
(define (domain d)
  (:durative-action go :duration (= ?duration 5) ; long
  ))
""",
    ),
    "templates": (
        """(define (domain d) (:template find :parameters (?o - thing) :effect (seen ?o) :body (skipper
        (condition (seen ?o)) (foreach (?p - place)
        (sequence (action goto ?p) (look ?o ?p) (condition (known (seen ?o))))))))""",
        """\
(define (domain d)

  (:template find
    :parameters (?o - thing)
    :effect (seen ?o)
    :body (skipper
      (condition (seen ?o))
      (foreach (?p - place)
        (sequence (action goto ?p) (look ?o ?p) (condition (known (seen ?o))))))))
""",
    ),
}


def _parse(text: str) -> ast.Document:
    report = Report()
    document = parse(SourceFile("test.pddl", text), report)
    assert not report.errors, "\n".join(d.render() for d in report)
    return document


@pytest.mark.parametrize("title", PAIRS)
def test_layout(title: str) -> None:
    given, expected = PAIRS[title]
    assert print_document(_parse(given)) == expected


@pytest.mark.parametrize("title", PAIRS)
def test_layout_is_stable(title: str) -> None:
    _, expected = PAIRS[title]
    assert print_document(_parse(expected)) == expected


def test_no_line_is_longer_than_need_be() -> None:
    names = " ".join(f"object-number-{i}" for i in range(200))
    text = print_document(
        _parse(f"(define (problem p) (:objects {names} - thing) (:goal (and (p {names[:150]}))))")
    )
    assert max(map(len, text.splitlines())) <= 100


def test_a_document_without_definitions_is_its_comments() -> None:
    report = Report()
    document = parse(SourceFile("test.pddl", "; one\n\n; two"), report)
    assert print_document(document) == "; one\n\n; two\n"
