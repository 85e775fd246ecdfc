"""Conditions of more literals than are joined at once have the bindings that they state."""

from __future__ import annotations

import itertools
from random import Random

from tests.ground.examples import task_of

_OBJECTS = [f"o{number}" for number in range(9)]


def test_a_condition_of_a_hundred_parts_has_the_bindings_that_brute_force_finds() -> None:
    """Each part holds of all objects, or all pairs but one; some deny, one compares, one may bind."""
    random = Random(3)
    parts: list[str] = []
    facts: list[str] = []
    tests: list[tuple[list[str], set[tuple[str, ...]]]] = []
    for number in range(100):
        variables = random.sample("xyz", random.choice([1, 2]))
        rows = list(itertools.product(_OBJECTS, repeat=len(variables)))
        missing = set(random.sample(rows, len(variables) - 1))
        denied = number % 7 == 0
        literal = f"(p{number} {' '.join(f'?{name}' for name in variables)})"
        parts.append(f"(not {literal})" if denied else literal)
        facts.extend(f"(p{number} {' '.join(row)})" for row in rows if (row in missing) == denied)
        tests.append((variables, missing))
    arities = {number: len(variables) for number, (variables, _) in enumerate(tests)}
    declared = " ".join(f"(p{n} {' '.join(['?a', '?b'][:k])})" for n, k in arities.items())
    task = task_of(f"""(define (domain d) (:requirements :adl) (:predicates (done ?a ?b ?c ?e) {declared})
      (:action act :parameters (?x ?y ?z ?w)
        :precondition (and (not (= ?x ?y)) {" ".join(parts)} (= ?w ?z))
        :effect (done ?x ?y ?z ?w)))
    (define (problem p) (:domain d) (:objects {" ".join(_OBJECTS)}) (:init {" ".join(facts)})
      (:goal (exists (?a ?b ?c ?e) (done ?a ?b ?c ?e))))""")
    expected = set()
    for x, y, z in itertools.product(_OBJECTS, repeat=3):
        value = {"x": x, "y": y, "z": z}
        if x != y and all(tuple(value[name] for name in names) not in missing for names, missing in tests):
            expected.add((x, y, z, z))
    assert expected
    assert {action.args for action in task.actions} == expected
