"""The changes of the fuzz run: most of what they make gets past the parser, and nothing breaks anything."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

from tests.fuzz.front_end import check_input
from tests.fuzz.mutate import Changes, forms

TEXT = b"""(define (domain d) (:predicates (p) (q ?x - t)) ; (no form)
 (:action a :parameters (?x) :precondition (and (p) (not (q ?x)))
  :effect (when (p) (probabilistic .5 (not (p))))))"""


def test_forms_are_told_apart_by_their_place() -> None:
    found = {TEXT[form.start : form.end]: form.kind for form in forms(TEXT)}
    assert found[TEXT[: len(TEXT)]] == "definition"
    assert found[b"(q ?x - t)"] == "declaration"
    assert found[b"(?x)"] == "parameters"
    assert found[b"(and (p) (not (q ?x)))"] == found[b"(q ?x)"] == "condition"
    assert found[b"(probabilistic .5 (not (p)))"] == found[b"(not (p))"] == "effect"
    assert b"(no form)" not in found


def test_most_of_what_is_changed_gets_past_the_parser(repository: Path) -> None:
    seeds = [
        problem.with_name("domain.pddl").read_bytes() + b"\n" + problem.read_bytes()
        for problem in sorted((repository / "domains").glob("*/[!d]*.pddl"))
    ]
    draw = random.Random(4)
    reached: Counter[str] = Counter()
    for _ in range(60):
        text = draw.choice(seeds)
        change = Changes(seeds, draw)
        for _ in range(draw.randint(1, 3)):
            text = change(text)
        reached[check_input(text)] += 1
    assert reached["refused"] < 20
    assert reached["grounded"] + reached["resolved"] >= 10
