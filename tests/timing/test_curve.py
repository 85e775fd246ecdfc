"""Success by a time: both curves beside runs of the tree that an interpreter of its own makes."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import pytest

import bbtc
from bbtc import pipeline
from bbtc.ground.condition import Condition
from bbtc.ground.task import Factor, GroundAction
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.timing.figures import Times
from bbtc.timing.figures import times as times_of
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, Tree
from bbtc.verifier.timed import time_found
from tests.cli.program import bbtc as program
from tests.long_form import LONG, amount
from tests.timing.test_durations import drawn

F = Fraction
RUNS = amount(3_000, 1_000_000)
BAND = math.sqrt(math.log(2 / 0.01) / (2 * RUNS))
"""Dvoretzky, Kiefer, Wolfowitz (Massart 1990): with 99 % the empirical curve is nowhere farther off."""

WORDS = ("number", "uniform", "triangular", "empirical", "lognormal")


def duration_text(generator: random.Random) -> str:
    """A duration, as written."""
    numbers = sorted(generator.randint(1, 40) for _ in range(3))
    match generator.choice(WORDS):
        case "number":
            return f"{numbers[0]}/2"
        case "uniform":
            return f"(uniform {numbers[0]} {numbers[2]})"
        case "triangular":
            return "(triangular {} {} {})".format(*numbers)
        case "empirical":
            return f"(empirical ({numbers[0]} 0.5) ({numbers[1]}.5 0.25) ({numbers[2]} 0.25))"
        case _:
            return f"(lognormal {numbers[1]} 0.{generator.randint(1, 9)})"


def literals(generator: random.Random, count: int) -> str:
    facts = generator.sample(["a", "b", "c"], count)
    return " ".join(f"({fact})" if generator.random() < 0.7 else f"(not ({fact}))" for fact in facts)


def domain_text(generator: random.Random) -> str:
    """A domain with actions that take time, some with a time-out, and its problem."""
    actions = []
    for number in range(generator.randint(2, 4)):
        effect = f"(and {literals(generator, 2)})"
        if generator.random() < 0.7:
            effect = f"(probabilistic 0.{generator.randint(3, 9)} {effect})"
        timed = f":duration {duration_text(generator)}"
        if generator.random() < 0.5:
            timed += f" :timeout {generator.randint(5, 40)}"
            if generator.random() < 0.6:
                timed += f" :on-timeout (and {literals(generator, 1)})"
        if generator.random() < 0.15:
            timed = ""
        actions.append(
            f"(:action act{number} :precondition (and {literals(generator, generator.randint(0, 1))}) "
            f":effect {effect} {timed})"
        )
    return (
        f"(define (domain d) (:predicates (a) (b) (c)) {' '.join(actions)})"
        f"(define (problem p) (:domain d) (:init) (:goal (and {literals(generator, 2)}))"
        "(:goal-probability 0.9))"
    )


# --- an interpreter of its own -------------------------------------------------------------------


def holds(condition: Condition, values: Sequence[bool]) -> bool:
    """All facts are true or false here."""
    match type(condition).__name__, condition:
        case "Constant", _:
            return bool(condition.value)  # type: ignore[union-attr]
        case "Is", _:
            return values[condition.variable] == (condition.value.word == "true")  # type: ignore[union-attr]
        case "And", _:
            return all(holds(part, values) for part in condition.parts)  # type: ignore[union-attr]
        case "Or", _:
            return any(holds(part, values) for part in condition.parts)  # type: ignore[union-attr]
        case "Not", _:
            return not holds(condition.part, values)  # type: ignore[union-attr]
        case name, _:
            raise NotImplementedError(name)


class Run:
    """One run, tick by tick."""

    def __init__(self, tree: Tree, generator: random.Random) -> None:
        self.task, self.root, self.random = tree.task, tree.root, generator
        self.actions = tree.task.action_by_name
        states = tree.task.initial
        state = generator.choices(states, [float(each.probability) for each in states])[0]
        self.values = [value.word == "true" for value in state.values]
        self.finished: set[str] = set()
        self.seconds = 0.0

    def tick(self, node: Node) -> str | ActionNode:
        match node:
            case ConditionNode():
                return "success" if holds(node.condition, self.values) else "failure"
            case ActionNode():
                if node.latched and node.id in self.finished:
                    return "success"
                if node.guarded and not holds(self.actions[node.action].precondition, self.values):
                    return "failure"
                return node
            case ControlNode(kind="sequence" | "fallback"):
                goes_on = "success" if node.kind == "sequence" else "failure"
                for child in node.children:
                    returned = self.tick(child)
                    if returned != goes_on:
                        return returned
                return goes_on
            case _:
                raise NotImplementedError(node)

    def run(self) -> bool:
        """To its end, or far enough."""
        for _ in range(2_000):
            returned = self.tick(self.root)
            if isinstance(returned, str):
                return returned == "success"
            self.finished.add(returned.id)
            self.act(self.actions[returned.action])
        return False

    def act(self, action: GroundAction) -> None:
        """First how long it takes, and from that whether it is given up; then what comes of it."""
        takes = 0.0 if action.duration is None else drawn(action.duration, self.random)
        limit = action.timeout
        late = limit is not None and takes > limit
        self.seconds += float(limit) if late and limit is not None else takes
        before = list(self.values)
        for factor in action.factors:
            self.happen(factor, before, late=late)

    def happen(self, factor: Factor, before: Sequence[bool], *, late: bool | None) -> None:
        outcomes = list(factor.outcomes)
        if any(outcome.timed_out for outcome in outcomes):
            outcomes = [outcome for outcome in outcomes if outcome.timed_out is late]
        outcome = self.random.choices(outcomes, [float(each.probability) for each in outcomes])[0]
        for effect in outcome.effects:
            if effect.when is None or holds(effect.when, before):
                for variable, value in effect.sets:
                    self.values[variable] = value.word == "true"
        for inner in outcome.factors:
            self.happen(inner, before, late=None)


def planned(text: str) -> Tree | None:
    """The tree for a text, if the interpreter knows its nodes."""
    try:
        tree = bbtc.plan(SourceFile("d.pddl", text), limits=Limits(seconds=20)).tree
    except bbtc.BbtcError:
        return None
    kinds = {node.kind for node in _controls(tree.root)}
    return tree if kinds <= {"sequence", "fallback"} and tree.success_probability > 0 else None


def _controls(node: Node) -> Iterator[ControlNode]:
    if isinstance(node, ControlNode):
        yield node
        for child in node.children:
            yield from _controls(child)


def times(tree: Tree, step: Fraction | None = None) -> Times:
    figures, chain = pipeline.simulate_tree(tree, Limits())
    found = times_of(tree.task, chain, figures.success, Limits(), step)
    assert found is not None
    return found


def compared(tree: Tree, seed: int) -> None:
    """Runs of the tree beside its figures of time."""
    found = times(tree).figures
    assert found is not None
    generator = random.Random(seed)
    ends = []
    total = 0.0
    for _ in range(RUNS):
        run = Run(tree, generator)
        if run.run():
            ends.append(run.seconds)
        total += run.seconds
    curve = found.curve
    ends.sort()
    done = 0
    for number, (least, most) in enumerate(zip(curve.late, curve.early, strict=True)):
        assert 0 <= least <= most <= 1
        while done < len(ends) and ends[done] <= float(number * curve.step) + 1e-9:
            done += 1
        assert least - BAND <= done / RUNS <= most + BAND
    assert all(one <= two for one, two in pairwise(curve.late))
    assert all(one <= two for one, two in pairwise(curve.early))
    if found.expected is not None and ends:
        mean = float(found.expected[1])
        assert total / RUNS == pytest.approx(mean, rel=0.12 if not LONG else 0.02)
        assert found.given_success is not None
        assert sum(ends) / len(ends) == pytest.approx(
            float(found.given_success[1]), rel=0.12 if not LONG else 0.02
        )


@pytest.mark.parametrize("seed", range(amount(5, 200)))
def test_the_curves_hold_what_runs_attain(seed: int) -> None:
    generator = random.Random(seed)
    for _ in range(50):
        tree = planned(domain_text(generator))
        if tree is not None and any(action.duration for action in tree.task.actions):
            compared(tree, seed)
            return
    raise AssertionError("no text has a tree")


# --- by hand -------------------------------------------------------------------------------------


def text(timing: str, chance: str = "0.5") -> str:
    return (
        f"(define (domain d) (:predicates (done) (given_up)) (:action go :precondition (not (given_up)) "
        f":effect (probabilistic {chance} (done)) {timing}))"
        "(define (problem p) (:domain d) (:init) (:goal (done)) (:goal-probability 0.9))"
    )


def of(timing: str, chance: str = "0.5", step: Fraction | None = None) -> Times:
    tree = planned(text(timing, chance))
    assert tree is not None
    return times(tree, step)


def test_fixed_durations_are_exact() -> None:
    found = of(":duration 3").figures
    assert found is not None
    assert found.expected == found.given_success == (F(6), F(6))
    assert found.curve.step == 3
    for number in range(6):
        exact = 1 - F(1, 2) ** number
        assert float(exact) * (1 - 1e-9) <= found.curve.late[number] <= exact
        assert exact <= found.curve.early[number] <= float(exact) * (1 + 1e-9)
    # 1/2 is attained at 3 s exactly, which floats cannot be sure of; 9/10 well before 12 s.
    assert [(each.least, each.most) for each in found.quantiles[:2]] == [(3, 6), (12, 12)]


def test_a_uniform_duration_is_between_its_roundings() -> None:
    found = of(":duration (uniform 2 4)", "1", F(1, 4)).figures
    assert found is not None
    assert found.expected == (F(3), F(3))
    for number, (least, most) in enumerate(zip(found.curve.late, found.curve.early, strict=True)):
        here, after = (
            min(F(1), max(F(0), (at - 2) / 2)) for at in (number * F(1, 4), (number + 1) * F(1, 4))
        )
        assert least == pytest.approx(float(here), abs=1e-9)
        assert most == pytest.approx(float(after), abs=1e-9)
        assert least <= here
        assert most >= after


def test_the_upper_curve_is_the_lower_one_a_step_earlier_for_each_action() -> None:
    tree = planned(
        "(define (domain d) (:predicates (a) (b) (c)) "
        "(:action x :precondition (not (a)) :effect (a) :duration (uniform 3 8))"
        "(:action y :precondition (a) :effect (b) :duration (triangular 1 2 9))"
        "(:action z :precondition (b) :effect (c) :duration (lognormal 4 0.4)))"
        "(define (problem p) (:domain d) (:init) (:goal (c)))"
    )
    assert tree is not None
    found = times(tree, F(1, 5)).figures
    assert found is not None
    for number, most in enumerate(found.curve.early[:-3]):
        assert most <= found.curve.late[number + 3] + 1e-8


def test_a_time_out_cuts_the_time_and_the_outcome_together() -> None:
    # Takes 2 or 12 s; after 10 s it is given up for good.
    timing = ":duration (empirical (2 0.75) (12 0.25)) :timeout 10 :on-timeout (given_up)"
    tree = planned(text(timing, "1"))
    assert tree is not None
    assert tree.success_probability == F(3, 4)
    found = times(tree).figures
    assert found is not None
    assert found.expected == (F(4), F(4))  # 3/4 * 2 + 1/4 * 10
    assert found.given_success == (F(2), F(2))
    assert found.curve.step == 2


def test_an_action_that_always_takes_longer_is_always_given_up() -> None:
    written = text(":duration (uniform 12 14) :timeout 10 :on-timeout (probabilistic 0.5 (done))", "1")
    tree = planned(written)
    assert tree is not None
    found = times(tree).figures
    assert found is not None
    assert found.expected == (F(20), F(20))
    (factor,) = tree.task.actions[0].factors
    assert all(outcome.timed_out for outcome in factor.outcomes)
    certain = planned(written.replace("(probabilistic 0.5 (done))", "(done)"))
    assert certain is not None
    found = times(certain).figures
    assert found is not None
    assert found.expected == (F(10), F(10))


def test_without_a_duration_nothing_is_told_of_time() -> None:
    assert times_or_none(text("")) is None
    untold = of(":timeout 10 :timeout-probability 0.25")
    assert untold.figures is None
    assert "does not say how long it takes" in (untold.untold or "")


def times_or_none(written: str) -> Times | None:
    tree = planned(written)
    assert tree is not None
    figures, chain = pipeline.simulate_tree(tree, Limits())
    return times_of(tree.task, chain, figures.success, Limits())


def test_no_curve_begins_before_the_soonest_success() -> None:
    found = of(":duration (uniform 20 21)", "1").figures
    assert found is not None
    assert all(p == 0 for number, p in enumerate(found.curve.early) if (number + 1) * found.curve.step <= 20)


def test_static_functions_give_durations(tmp_path: Path) -> None:
    written = (
        "(define (domain d) (:types p) (:predicates (at ?p - p)) (:functions (far ?a ?b - p)) "
        "(:action go :parameters (?a ?b - p) :precondition (at ?a) :effect (and (at ?b) (not (at ?a))) "
        ":duration (uniform (far ?a ?b) (* 2 (far ?a ?b)))))"
        "(define (problem p) (:domain d) (:objects x y - p) (:init (at x) (= (far x x) 1) (= (far y y) 1) "
        "(= (far x y) 6) (= (far y x) 6)) (:goal (at y)))"
    )
    file = tmp_path / "d.pddl"
    file.write_text(written)
    task = bbtc.compile(file)
    assert task.action_by_name["go(x,y)"].duration == bbtc.durations.Uniform(F(6), F(12))
    tree = planned(written)
    assert tree is not None
    found = times(tree).figures
    assert found is not None
    assert found.expected == (F(9), F(9))


def test_events_happen_after_the_time_of_an_action() -> None:
    tree = planned(
        "(define (domain d) (:predicates (open) (inside)) "
        "(:exogenous closes :precondition (open) :effect (probabilistic 0.5 (not (open)))) "
        "(:action push :precondition (not (open)) :effect (open) :duration 3) "
        "(:action enter :precondition (open) :effect (inside) :duration 2))"
        "(define (problem p) (:domain d) (:init) (:goal (inside)) (:goal-probability 0.9))"
    )
    assert tree is not None
    found = times(tree).figures
    assert found is not None
    assert found.expected == (F(8), F(8))  # two pushes of 3 s on average, then 2 s


def test_what_may_be_aborted_on_the_way_takes_from_none_to_all_of_its_time() -> None:
    tree = planned(
        "(define (domain d) (:predicates (open) (inside)) "
        "(:exogenous closes :precondition (open) :effect (probabilistic 0.5 (not (open)))) "
        "(:action push :precondition (not (open)) :effect (open) :duration 3) "
        "(:action enter :precondition (open) :while (open) :effect (inside) :duration 2))"
        "(define (problem p) (:domain d) (:init) (:goal (inside)) (:goal-probability 0.9))"
    )
    assert tree is not None
    found = times(tree).figures
    assert found is not None
    assert found.expected == (F(14), F(16))  # four pushes of 3 s, then 2 s; on average one is aborted of 2 s
    assert time_found(tree.task, tree.root, Limits(), F(5)) is None


@pytest.mark.parametrize("stage", ["ast", "model", "ground"])
def test_artefacts_of_domains_without_time_say_nothing_of_it(stage: str) -> None:
    files = [f"domains/household/{name}.pddl" for name in ("domain", "look-for-soda")]
    written = program("compile", "--emit", stage, *files).stdout
    assert len(written) > 1000
    assert not any(f'"{word}"' in written for word in ("timing", "duration", "timeout", "timed_out"))
