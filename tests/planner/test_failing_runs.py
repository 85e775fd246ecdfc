"""The runs that fail: which, how probable, what they did and what they lack. A hospital worked out by hand,
and random trees against the plain enumeration of their chains."""

from __future__ import annotations

import json
from collections.abc import Iterator
from fractions import Fraction
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import given

from bbtc.belief.chain import Chain, explore
from bbtc.belief.scenarios import scenarios
from bbtc.belief.simulate import figures
from bbtc.belief.tick import NodeStatus
from bbtc.diagnostics import LimitReached
from bbtc.ground.condition import Condition, Is, conjunction
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.planner.failing_runs import failing_runs
from bbtc.planner.why_not import Block, RootFinder
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Tree
from tests.domains.problems import bbtc
from tests.long_form import amount
from tests.planner.test_refine import action, task
from tests.profiles import examples
from tests.strategies import trees

T, F = Truth.TRUE, Truth.FALSE
_NONE = "and no action of the tree makes that true"

HOSPITAL = """; A robot brings medicine to the nurse of a ward. Driving may empty the battery, which only the
; dock charges, and whoever has an empty battery does not get there; the nurse may be away.
(define (domain hospital)
  (:requirements :typing :unknown :probabilistic-effects)
  (:types place - object ward - place)
  (:constants dock hall - place)
  (:predicates (at ?place - place) (linked ?from ?to - place) (charged) (nurse-in ?ward - ward) (delivered))
  (:action drive
    :parameters (?from ?to - place)
    :precondition (and (at ?from) (linked ?from ?to) (charged))
    :effect (and (at ?to) (not (at ?from)) (probabilistic 1/10 (not (charged)))))
  (:action charge :precondition (at dock) :effect (charged))
  (:action look
    :parameters (?ward - ward)
    :precondition (and (at ?ward) (unknown (nurse-in ?ward)))
    :effect (probabilistic 4/5 (nurse-in ?ward) 1/5 (not (nurse-in ?ward))))
  (:action hand-over
    :parameters (?ward - ward)
    :precondition (and (at ?ward) (nurse-in ?ward))
    :effect (delivered)))
(define (problem one-ward)
  (:domain hospital)
  (:objects ward-1 - ward)
  (:init (at dock) (charged) (linked dock hall) (linked hall dock) (linked hall ward-1) (linked ward-1 hall)
         (unknown (nurse-in ward-1)))
  (:goal GOAL))
"""


@pytest.fixture
def hospital(tmp_path: Path) -> Path:
    """The tree for the hospital."""
    (tmp_path / "hospital.pddl").write_text(HOSPITAL.replace("GOAL", "(delivered)"))
    bbtc("plan", str(tmp_path / "hospital.pddl"), "-q", "--closed-world", "-o", str(tmp_path / "tree.json"))
    return tmp_path / "tree.json"


def test_each_way_to_fail_is_told_with_the_fact_at_its_root(hospital: Path) -> None:
    """81/500: two drives that leave charge (9/10 each), nobody there (1/5). 1/10: the first drive empties the
    battery. 9/500: the second does, which alone would not matter, and nobody is there."""
    done = bbtc("simulate", str(hospital))
    text = done.out.decode()
    assert text[text.index("failing runs") :].splitlines() == [
        "failing runs, the most probable first:",
        f"  81/500 (0.162): hand-over(ward-1) needs nurse-in(ward-1), {_NONE}",
        "    drive(dock,hall): at(dock) = false, at(hall) = true",
        "    drive(hall,ward-1): at(hall) = false, at(ward-1) = true",
        "    look(ward-1): nurse-in(ward-1) = false",
        f"  1/10 (0.1): drive(hall,ward-1) needs charged(), {_NONE}",
        "    drive(dock,hall): at(dock) = false, at(hall) = true, charged() = false",
        f"  9/500 (0.018): hand-over(ward-1) needs nurse-in(ward-1), {_NONE}",
        "    drive(dock,hall): at(dock) = false, at(hall) = true",
        "    drive(hall,ward-1): at(hall) = false, at(ward-1) = true, charged() = false",
        "    look(ward-1): nurse-in(ward-1) = false",
    ]
    first = bbtc("simulate", str(hospital), "--failing", "1").out.decode().splitlines()
    assert first[-1] == "  59/500 (0.118): other runs", "the rest is 1/10 + 9/500"
    assert "failing runs" not in bbtc("simulate", str(hospital), "--failing", "0").out.decode()


def test_planning_tells_the_same_of_a_target_out_of_reach(tmp_path: Path) -> None:
    file = tmp_path / "hospital.pddl"
    file.write_text(HOSPITAL.replace("GOAL", "(delivered)"))
    told = bbtc("plan", str(file), "-q", "-o", str(tmp_path / "tree.json")).err.replace(f"{tmp_path}/", "")
    lines = told.splitlines()
    assert lines[2:8] == [
        "  9/50 (0.18): after look(ward-1) [hospital.pddl:13:3], nothing can bring about delivered()",
        "    hand-over(ward-1) [hospital.pddl:17:3] needs nurse-in(ward-1), and no action makes that true",
        "    most probably so, 81/500 (0.162):",
        "      drive(dock,hall): at(dock) = false, at(hall) = true",
        "      drive(hall,ward-1): at(hall) = false, at(ward-1) = true",
        "      look(ward-1): nurse-in(ward-1) = false",
    ]
    assert lines[8].startswith("  1/10 (0.1): after drive(dock,hall)")


def test_a_blocked_run_names_the_empty_battery_and_not_the_fact_it_never_came_to_observe(
    tmp_path: Path,
) -> None:
    """It is enough to find out that nobody is there. In the hall with an empty battery nobody finds out."""
    file = tmp_path / "hospital.pddl"
    file.write_text(HOSPITAL.replace("GOAL", "(or (delivered) (not (nurse-in ward-1)))"))
    done = bbtc("plan", str(file), "--closed-world", "-o", str(tmp_path / "tree.json"), "-q")
    battery = "needs charged(), and no action brings it back: charge() can never do so"
    assert done.err.replace(f"{tmp_path}/", "").splitlines()[-3:] == [
        f"    drive(hall,ward-1) [hospital.pddl:8:3] {battery}",
        "    most probably so:",
        "      drive(dock,hall): at(dock) = false, at(hall) = true, charged() = false",
    ]
    told = bbtc("simulate", str(tmp_path / "tree.json")).out.decode()
    assert "nurse-in(ward-1) is unknown" in told, "the condition that the tree stopped at"
    assert told.splitlines()[-3:] == [
        "failing runs, the most probable first:",
        f"  1/10 (0.1), blocked: drive(hall,ward-1) needs charged(), {_NONE}",
        "    drive(dock,hall): at(dock) = false, at(hall) = true, charged() = false",
    ]


def test_the_failing_runs_are_in_the_figures_as_json(hospital: Path) -> None:
    data = json.loads(bbtc("simulate", str(hospital), "--json", "--failing", "2").out)
    assert [run["p"] for run in data["failing_runs"]] == ["81/500", "1/10"]
    assert data["other_failing_runs"] == "9/500"
    empty = data["failing_runs"][1]
    assert empty["status"] == "failure"
    assert [step["changes"] for step in empty["steps"]] == [
        {"at(dock)": "false", "at(hall)": "true", "charged()": "false"}
    ]
    assert empty["missing"] == [
        {"fact": "charged()", "needed": "true", "now": "false", "by": "drive(hall,ward-1)", "setters": []}
    ]
    assert empty["lost"] == [["is", "delivered()", "true"]]
    assert (empty["condition"], empty["value"]) == (["is", "charged()", "true"], "false")


def test_attempts_used_up_lose_nothing_for_good(tmp_path: Path) -> None:
    file = tmp_path / "coin.pddl"
    file.write_text(
        """(define (domain coin) (:predicates (heads))
          (:action toss :precondition (not (heads)) :effect (probabilistic 1/2 (heads))))
        (define (problem three) (:domain coin) (:init) (:goal (heads)) (:goal-probability 0.8))"""
    )
    bbtc("plan", str(file), "--retries", "least", "-q", "-o", str(tmp_path / "tree.json"))
    lines = bbtc("simulate", str(tmp_path / "tree.json")).out.decode().splitlines()
    assert lines[-4] == (
        "  1/8 (0.125): all 3 attempts used up, node n3: "
        "the goal may be in reach, but the tree has nothing left to try"
    )
    assert lines[-3:] == ["    toss(): no change"] * 3


def test_of_a_long_run_the_end_is_told(tmp_path: Path) -> None:
    steps = " ".join(f"(s{n})" for n in range(20))
    actions = " ".join(f"(:action a{n} :precondition (s{n}) :effect (s{n + 1}))" for n in range(19))
    last = "(and (s19) (not (broken))) :effect (probabilistic 1/2 (won) 1/2 (broken))"
    file = tmp_path / "long.pddl"
    file.write_text(
        f"(define (domain d) (:predicates {steps} (broken) (won)) {actions}"
        f" (:action last :precondition {last}))"
        " (define (problem p) (:domain d) (:init (s0)) (:goal (won)) (:goal-probability 1/2))"
    )
    bbtc("plan", str(file), "--strategy", "policy", "-q", "-o", str(tmp_path / "tree.json"))
    lines = bbtc("simulate", str(tmp_path / "tree.json")).out.decode().splitlines()
    start = lines.index("failing runs, the most probable first:")
    assert (
        lines[start + 1]
        == "  1/2 (0.5): last() needs not broken(), and no action of the tree makes that true"
    )
    assert lines[start + 2] == "    8 actions before, then"
    assert lines[start + 3].strip().startswith("a8():")
    assert lines[-1] == "    last(): broken() = true"
    assert len(lines) == start + 3 + 12


# --- against the plain enumeration -----------------------------------------------------------


def _all_runs(chain: Chain, most: int) -> Iterator[tuple[Fraction, int]]:
    """Every run with its probability and its last state, breadth first, as the edges say; runs of a chain
    with loops are too many."""
    todo = [(p, state) for p, state in chain.initial]
    for count, (probability, state) in enumerate(todo):
        if count > most:
            raise OverflowError
        if not chain.edges[state]:
            yield probability, state
        successors: dict[int, Fraction] = {}
        for edge in chain.edges[state]:
            successors[edge.successor] = successors.get(edge.successor, Fraction(0)) + edge.result.probability
        todo.extend((probability * p, after) for after, p in successors.items())


@examples(amount(40, 80))
@given(trees())
def test_the_failing_runs_are_those_of_the_plain_enumeration(tree: Tree) -> None:
    chain = explore(tree.task, tree.root, Limits())
    try:
        runs = [
            (p, end) for p, end in _all_runs(chain, 5000) if chain.status[end] is not NodeStatus.SUCCESS and p
        ]
    except OverflowError:
        return
    listed = list(scenarios(chain, Limits(), failing=True))
    assert [run.probability for run in listed] == sorted((p for p, _ in runs), reverse=True)
    assert sorted((run.probability, run.end) for run in listed) == sorted(runs)
    found = figures(tree.task, tree.root, chain)
    assert sum((run.probability for run in listed), Fraction(0)) == found.failure + found.blocked


@examples(amount(40, 80))
@given(trees())
def test_with_what_it_lacks_given_the_goal_is_in_reach_again(tree: Tree) -> None:
    """Of whatever state: where parts of the goal are lost, setting the facts named takes that back."""
    names = {variable.name: number for number, variable in enumerate(tree.task.variables)}
    roots = RootFinder(tree.task, Limits())
    for run in islice(failing_runs(tree, explore(tree.task, tree.root, Limits()), Limits(), 20), 20):
        assert bool(run.blocks) <= bool(run.lost)
        values = bytearray(run.run.final)
        for block in run.blocks:
            assert block.value is not block.now
            values[names[block.fact]] = block.value
        if run.blocks:
            assert not roots.lost(bytes(values))


# --- roots of single states ------------------------------------------------------------------


def test_the_fact_that_a_circle_comes_back_to_is_the_root() -> None:
    """An empty battery keeps it from the charger, which would fill it."""
    go = action("go", Is(0, T), ("1", {1: T}))
    charge = action("charge", Is(1, T), ("1", {0: T}))
    win = action("win", Is(0, T), ("1", {2: T}))
    of = task("full there won", {}, Is(2, T), go, charge, win)
    (block,) = RootFinder(of, Limits()).blocks(bytes([F, F, F]))
    assert block == Block("full()", T, F, "win()", None, ("charge()",))
    assert RootFinder(of, Limits()).blocks(bytes([F, T, F])) == (), "at the charger nothing is lost"


def test_of_what_asks_for_a_fact_and_its_contrary_nothing_is_told() -> None:
    """Neither value would do; the second goal needs both of an action."""
    of = task("a b", {}, conjunction([Is(0, T), Is(0, F)]))
    assert RootFinder(of, Limits()).blocks(bytes([T, F])) == ()
    win = action("win", conjunction([Is(1, T), Is(1, F)]), ("1", {0: T}))
    assert RootFinder(task("a b", {}, Is(0, T), win), Limits()).blocks(bytes([F, F])) == ()


def test_two_things_lost_are_both_told() -> None:
    of = task("a b won", {}, Is(2, T), action("win", _both(0, 1), ("1", {2: T})))
    assert [block.fact for block in RootFinder(of, Limits()).blocks(bytes([F, F, F]))] == ["a()", "b()"]


def test_what_two_needs_have_in_common_is_told_once_at_its_root() -> None:
    """Both parts come from the battery, which is empty far from its charger."""
    of = task(
        "full there a b m won",
        {},
        Is(5, T),
        action("go", Is(0, T), ("1", {1: T})),
        action("charge", Is(1, T), ("1", {0: T})),
        action("get-a", Is(0, T), ("1", {2: T})),
        action("get-b", Is(0, T), ("1", {3: T})),
        action("make", _both(2, 3), ("1", {4: T})),
        action("win", Is(4, T), ("1", {5: T})),
    )
    (block,) = RootFinder(of, Limits()).blocks(bytes([F] * 6))
    assert (block.fact, block.action, block.setters) == ("full()", "get-a()", ("charge()",))


def test_a_circle_and_a_fact_that_nobody_sets_are_both_told() -> None:
    of = task(
        "full there lost m won",
        {},
        Is(4, T),
        action("go", Is(0, T), ("1", {1: T})),
        action("charge", Is(1, T), ("1", {0: T})),
        action("make", _both(0, 2), ("1", {3: T})),
        action("win", Is(3, T), ("1", {4: T})),
    )
    assert [block.fact for block in RootFinder(of, Limits()).blocks(bytes([F] * 5))] == ["lost()", "full()"]


def test_of_two_ways_the_one_that_lacks_less_is_told() -> None:
    hard = action("hard", _both(0, 1), ("1", {3: T}))
    easy = action("easy", Is(2, T), ("1", {3: T}))
    of = task("a b c won", {}, Is(3, T), hard, easy)
    assert [block.fact for block in RootFinder(of, Limits()).blocks(bytes([F, F, F, F]))] == ["c()"]


def _both(one: int, other: int) -> Condition:
    return conjunction([Is(one, T), Is(other, T)])


def test_rare_failures_are_found_among_very_many_runs_that_succeed() -> None:
    """Ten coins decide nothing: a thousand beginnings, and one run of a thousand fails at the end. To list
    them by what they are so far would come to the first failure after all that succeed."""
    coins = [action(f"coin{n}", Is(n, F), ("1/2", {n: T}), ("1/2", {})) for n in range(10)]
    last = action("last", Is(10, F), ("999/1000", {10: T}), ("1/1000", {11: T}))
    of = task(" ".join([*(f"c{n}" for n in range(10)), "won", "lost"]), {}, Is(10, T), *coins, last)
    nodes = tuple(ActionNode(f"n{n}", f"coin{n}()") for n in range(10))
    root = ControlNode("r", "sequence", (*nodes, ActionNode("l", "last()"), ConditionNode("g", Is(10, T))))
    chain = explore(of, root, Limits())
    first = next(scenarios(chain, Limits(states=40), failing=True))
    assert first.probability == Fraction(1, 2**10 * 1000)
    with pytest.raises(LimitReached):
        list(scenarios(chain, Limits(states=40), failing=True))
