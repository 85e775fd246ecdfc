"""The canonical layout, as pairs of texts."""

from __future__ import annotations

from pathlib import Path

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
    :effect (and (P A) (not (Q)))))
""",
    ),
    "bare symbols get parentheses": (
        "(define (domain d) (:action a :precondition p :effect (probabilistic .5 q .5 (increase reward 1))))",
        """\
(define (domain d)

  (:action a
    :precondition (p)
    :effect (probabilistic
      .5 (q)
      .5 (increase (reward) 1))))
""",
    ),
    "long forms break by items": (
        """(define (problem p) (:domain d) (:init (p a) (q b)) (:goal (and
        (first-condition of-some-length with-objects)
        (second-condition of-some-length) (third-condition))))""",
        """\
(define (problem p)
  (:domain d)
  (:init (p a) (q b))
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
    "comments in what a variable takes stay there": (
        """(define (domain d) (:variable (at ?r - robot) (in ?r ; the robot
 ) ; or
 (out)) (:variable (lit ; all of it
 ) (a)))""",
        """\
(define (domain d)
  (:variable (at ?r - robot)
    (in ?r ; the robot
    ) ; or
    (out))
  (:variable (lit ; all of it
    )
    (a)))
""",
    ),
    "comments in a column keep it, and move right together where code is longer": (
        """\
(define (domain d) (:predicates (p)      ; one
  (quite-long ?x)   ; two
                        (q))    ; three
  (:constants a b - t   ; a table
              c - u)) ; not in a column
""",
        """\
(define (domain d)
  (:predicates
    (p)                                  ; one
    (quite-long ?x) ; two
    (q))                        ; three
  (:constants
    a b - t             ; a table
    c - u)) ; not in a column
""",
    ),
    "a column is shared": (
        """\
(define (domain d) (:predicates
 (p)        ; one
 (qqqqqqqq) ; two
 (r)        ; three
))
""",
        """\
(define (domain d)
  (:predicates
    (p)        ; one
    (qqqqqqqq) ; two
    (r)        ; three
  ))
""",
    ),
    "declarations stand on lines of their own, with the empty lines between them": (
        """(define (domain d) (:types a b - c c e - object) (:predicates

        (p) (q)


        (r)))""",
        """\
(define (domain d)
  (:types
    a b - c
    c e - object)
  (:predicates
    (p)
    (q)

    (r)))
""",
    ),
    "what is declared as external keeps its comments": (
        """(define (domain d) (:predicates ; all
        (EXTERNAL (p ?x - t)) ; one
        (external   (Unknown
        (q ?x ; two
        )))))""",
        """\
(define (domain d)
  (:predicates ; all
    (external (p ?x - t)) ; one
    (external (unknown (q ?x ; two
    )))))
""",
    ),
    "facts keep their rows where they do not fit on a line": (
        """(define (problem p) (:domain d) (:init (at a) (next a b)
        (next b c) (next c d)
        (wet a) (wet b) (wet c) (wet d) (unknown (dry a)) (unknown (dry b))

        (oneof (gold a) (gold b))) (:goal
        (and (wet a)
        (wet b))))""",
        """\
(define (problem p)
  (:domain d)
  (:init
    (at a) (next a b)
    (next b c) (next c d)
    (wet a) (wet b) (wet c) (wet d) (unknown (dry a)) (unknown (dry b))

    (oneof (gold a) (gold b)))
  (:goal (and (wet a) (wet b))))
""",
    ),
    "facts in one long row get a line each": (
        "(define (problem p) (:domain d) (:init "
        + " ".join(f"(at thing-1{n} place-1{n})" for n in range(4))
        + ") (:goal (p)))",
        """\
(define (problem p)
  (:domain d)
  (:init
    (at thing-10 place-10)
    (at thing-11 place-11)
    (at thing-12 place-12)
    (at thing-13 place-13))
  (:goal (p)))
""",
    ),
    "requirements and parameters continue below the first": (
        "(define (domain d) (:requirements "
        + " ".join(f":requirement-{n}" for n in range(7))
        + ") (:action a :parameters ("
        + " ".join(f"?parameter-{n} - kind-{n}" for n in range(5))
        + ")))",
        """\
(define (domain d)
  (:requirements :requirement-0 :requirement-1 :requirement-2 :requirement-3 :requirement-4
                 :requirement-5 :requirement-6)

  (:action a
    :parameters (?parameter-0 - kind-0 ?parameter-1 - kind-1 ?parameter-2 - kind-2
                 ?parameter-3 - kind-3 ?parameter-4 - kind-4)))
""",
    ),
    "draws have a line for each branch": (
        """(define (domain d) (:action a :parameters () :effect (and (oneof (p) ()) (when (p)
        (probabilistic 1/2 (q) 1/4 (probabilistic 1/3 (p)))))))""",
        """\
(define (domain d)

  (:action a
    :parameters ()
    :effect (and
      (oneof
        (p)
        ())
      (when (p)
        (probabilistic
          1/2 (q)
          1/4 (probabilistic 1/3 (p)))))))
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
        "(define (domain d) (:process  go\n:precondition(= ?x 5) ; long\n))",
        """\
(define (domain d)
  (:process go :precondition (= ?x 5) ; long
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


def test_the_domains_have_their_layout(repository: Path) -> None:
    files = sorted((repository / "domains").glob("*/*.pddl"))
    assert files
    texts = {file.relative_to(repository).as_posix(): file.read_text("utf-8") for file in files}
    assert [name for name, text in texts.items() if print_document(_parse(text)) != text] == [], (
        "run `bbtc fmt domains/*/*.pddl`"
    )
