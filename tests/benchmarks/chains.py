"""How the time of planning grows with the length of the plan: ``python -m tests.benchmarks.chains``.

Families whose solution is a long chain of similar steps, each of which may go wrong and be mended: on a road
one may get lost at every place, on a beam one may fall and has to walk back to the ladder. 298 rules must
take at most 15 times what 28 take, start-up and grounding apart, the least of some runs each; exits with 1
otherwise. ``--strategy`` chooses how to plan.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise

from bbtc.diagnostics import Report
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.options import Options
from bbtc.planner.strategies import DEFAULT
from bbtc.rewrite.simplify import size
from bbtc.source import SourceFile

RULES = (28, 298)
MOST = 15.0
RUNS = 3

ROAD = """
(define (domain road) (:requirements :typing :probabilistic-effects :negative-preconditions)
  (:types place)
  (:predicates (at ?p - place) (next ?a ?b - place) (lost))
  (:action go :parameters (?a ?b - place) :precondition (and (at ?a) (next ?a ?b) (not (lost)))
    :effect (and (not (at ?a)) (at ?b) (probabilistic 1/10 (lost))))
  (:action ask :precondition (lost) :effect (not (lost))))
"""

BEAM = """
(define (domain beam) (:requirements :typing :probabilistic-effects :negative-preconditions)
  (:types place)
  (:predicates (at ?p - place) (next ?a ?b - place) (up) (ladder ?p - place))
  (:action climb :parameters (?p - place) :precondition (and (at ?p) (ladder ?p) (not (up))) :effect (up))
  (:action balance :parameters (?a ?b - place) :precondition (and (at ?a) (next ?a ?b) (up))
    :effect (and (not (at ?a)) (at ?b) (probabilistic 1/10 (not (up)))))
  (:action return :parameters (?a ?b - place) :precondition (and (at ?b) (next ?a ?b) (not (up)))
    :effect (and (not (at ?b)) (at ?a))))
"""


def road(rules: int) -> Task:
    """A road that takes so many rules: one a step, and one to ask the way."""
    return _row(ROAD, "road", rules - 1, "", "(not (lost))")


def beam(rules: int) -> Task:
    """A beam that takes so many rules: two a step, and one to climb it."""
    return _row(BEAM, "beam", (rules - 1) // 2, "(ladder p0)", "(up)")


FAMILIES: dict[str, Callable[[int], Task]] = {"road": road, "beam": beam}


def _row(domain: str, name: str, steps: int, init: str, goal: str) -> Task:
    places = [f"p{number}" for number in range(steps + 1)]
    nexts = " ".join(f"(next {a} {b})" for a, b in pairwise(places))
    problem = (
        f"(define (problem {name}-{steps}) (:domain {name}) (:objects {' '.join(places)} - place)"
        f" (:init (at p0) {init} {nexts}) (:goal (and (at p{steps}) {goal})))"
    )
    sources = [SourceFile("domain.pddl", domain), SourceFile("problem.pddl", problem)]
    return compile_sources(sources, Report(), Limits())


def main() -> int:
    """Print a line for each family and length."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--strategy", default=DEFAULT)
    strategy = parser.parse_args().strategy
    missed, options = 0, Options(retries="unbounded")
    print("family  rules  nodes  seconds  times")
    for name, family in FAMILIES.items():
        first = None
        for rules in RULES:
            task, seconds, nodes = family(rules), float("inf"), 0
            for _ in range(RUNS):
                start = time.process_time()
                plan = plan_task(task, Fraction(1), strategy, Limits(), lambda _: None, options=options)
                seconds, nodes = min(seconds, time.process_time() - start), size(plan.tree.root)
                missed += plan.figures.success != 1
            first = first or seconds
            times = seconds / first
            missed += times > MOST
            print(f"{name:<6}{rules:>7}{nodes:>7}{seconds:>9.3f}{times:>7.1f}", flush=True)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
