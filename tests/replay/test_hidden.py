"""Where facts are hidden, exported trees and their monitors do what the simulator says: same actions, same
end, same known facts at the end, whatever the robot is told."""

from __future__ import annotations

import functools
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import given

import bbtc
from bbtc.backends.btcpp.monitor import MonitorTable, monitor_files
from bbtc.backends.btcpp.names import btcpp_names
from bbtc.belief.chain import Chain, explore
from bbtc.belief.hidden import Readings, number_in
from bbtc.belief.monitored import ObservationNames, changes_of, with_hidden
from bbtc.belief.scenarios import scenarios
from bbtc.diagnostics import BbtcError, Report
from bbtc.ground.condition import Is
from bbtc.ground.task import Observation, Task
from bbtc.kleene import Truth
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, with_monitor
from bbtc.replay.script import TIMINGS, run_of
from bbtc.replay.tellings import Tellings
from bbtc.source import SourceFile
from bbtc.tree.monitor import FIRST, Monitor
from bbtc.tree.nodes import Tree
from tests.belief.hidden_tasks import search, tiger
from tests.domains.problems import PROBLEMS, tree_of
from tests.ground.examples import task_of
from tests.hidden.test_diagram_beliefs import gates
from tests.hidden.texts import texts
from tests.long_form import amount
from tests.profiles import examples
from tests.replay.all_engines import ENGINES, Compared, EngineName, Make, engine
from tests.sharing import shared

HALF = Fraction(1, 2)
ACCURACY = Fraction(17, 20)
TREES = amount(8, 500)
RUNS = amount(10, 100)


def compiled(text: str) -> Task:
    return compile_sources([SourceFile("x.pddl", text)], Report(), Limits())


def first_told(task: Task) -> Task:
    """The robot is told something before its first action."""
    (component,) = task.components
    observation = Observation(Is(0, Truth.TRUE), Fraction(3, 4))
    return replace(task, components=(replace(component, first=(observation,)),))


WINGS = """
(define (domain wings)
  (:types place)
  (:predicates (robot-at ?p - place) (bag-at ?p - place) (have))
  (:action go :parameters (?p ?q - place) :precondition (robot-at ?p)
    :effect (and (not (robot-at ?p)) (robot-at ?q)))
  (:action look :parameters (?p - place) :precondition (robot-at ?p) :observe (bag-at ?p))
  (:action ask :observe (or (bag-at hall) (bag-at lab)))
  (:action take :parameters (?p - place) :precondition (and (robot-at ?p) (bag-at ?p))
    :effect (have)))
(define (problem fetch) (:domain wings)
  (:objects hall lab cellar attic - place)
  (:init (robot-at hall) (oneof (bag-at hall) (bag-at lab) (bag-at cellar) (bag-at attic)))
  (:goal (have)))
"""

WARD = """(define (domain ward) (:predicates (ill) (fresh) (treated) (well))
  (:action test :precondition (and (fresh) (not (treated))) :effect (not (fresh))
    :observe (probabilistic 0.85 (ill)) :repeats)
  (:action flip :precondition (not (fresh))
    :effect (and (fresh) (when (ill) (not (ill))) (when (not (ill)) (ill))))
  (:action give :precondition (not (treated)) :effect (and (treated) (when (ill) (well))))
  (:action spare :precondition (not (treated)) :effect (and (treated) (when (not (ill)) (well)))))
(define (problem p) (:domain ward) (:init (fresh) (unknown (ill))) (:goal (believed (well) 0.95)))"""
"""Readings that stay, and a goal that is believed."""
BOXES = """(define (domain boxes) (:types box)
  (:predicates (in ?b - box) (have)) (:observables (seen ?b - box))
  (:action shake)
  (:action take :parameters (?b - box) :precondition (believed (in ?b) 0.9)
    :effect (when (in ?b) (have)))
  (:observation there :parameters (?b - box) :condition (in ?b)
    :distribution (probabilistic 0.9 (seen ?b) 0.1 (not (seen ?b))))
  (:observation gone :parameters (?b - box) :condition (not (in ?b))
    :distribution (probabilistic 0.1 (seen ?b) 0.9 (not (seen ?b)))))
(define (problem p) (:domain boxes) (:objects left right - box)
  (:init-belief (joint 0.5 (and (in left) (not (in right)))) (joint 0.5 (and (not (in left)) (in right))))
  (:goal (have)))"""
"""A model of observation after every action, and preconditions on what is believed."""
CLINIC = """(define (domain clinic) (:types illness)
  (:predicates (cured) (ill ?i - illness) (stain ?i - illness))
  (:variable disease (cured) (forall (?i - illness) (ill ?i)))
  (:obs-variable (result ?i - illness) (stain ?i))
  (:action treat :parameters (?i - illness) :precondition (ill ?i) :effect (cured))
  (:action test :sensing-model (forall (?i - illness) (when (ill ?i) (stain ?i)))))
(define (problem p) (:domain clinic) (:objects flu cold cough - illness) (:init) (:goal (cured)))"""
"""A variable of several values, and a model of sensing."""

HAND_MADE = {
    "search": (search(3), Fraction(1)),
    "noisy search": (search(2, HALF), Fraction(9, 10)),
    "tiger": (tiger(ACCURACY, Fraction(99, 100)), HALF),
    "counted tiger": (tiger(ACCURACY), Fraction(9, 10)),
    "told first": (first_told(search(3)), Fraction(1)),
    "wings": (compiled(WINGS), Fraction(1)),
    "ward": (compiled(WARD), HALF),
    "boxes": (compiled(BOXES), HALF),
    "clinic": (compiled(CLINIC), HALF),
    "gates": (task_of(gates(4), Limits(worlds=0)), Fraction(1)),
}


@functools.cache
def hand_made(name: str) -> tuple[Tree, Tree]:
    """The trees of a task made by hand, planned in one worker of a test run."""
    task, target = HAND_MADE[name]
    pair = shared(f"hidden-{name}", lambda: planned(task, target))
    assert pair is not None
    return pair


def planned(task: Task, target: Fraction = HALF, seconds: float = 20) -> tuple[Tree, Tree] | None:
    """A tree of a task, and the same with its monitor; None where it needs none."""
    tree = bbtc.plan(task, target=target, limits=Limits(seconds=seconds), allow_guess=True).tree
    watched = with_monitor(tree, Limits())
    return None if watched is None else (replace(tree, task=with_hidden(tree.task)), watched)


@functools.cache
def random_trees(wanted: int, *, noise: bool) -> list[tuple[Tree, Tree]]:
    """Trees of random texts that need a monitor, planned in one worker of a test run."""
    return shared(f"hidden-random-{wanted}-{noise}", lambda: _random_trees(wanted, noise))


def _random_trees(wanted: int, noise: bool) -> list[tuple[Tree, Tree]]:
    found: list[tuple[Tree, Tree]] = []

    @examples(12 * wanted)
    @given(texts(noise=noise))
    def collect(text: str) -> None:
        if len(found) >= wanted:
            return
        try:
            pair = planned(compiled(text), seconds=1)
        except BbtcError:  # no world, no goal, or more than fits in the limits
            return
        found.extend([] if pair is None else [pair])

    collect()
    return found


def assert_replayed(tree: Tree, watched: Tree, make: Make) -> int:
    """How many runs were replayed."""
    told = Tellings(tree.task, watched)
    found = list(islice(scenarios(explore(tree.task, tree.root, Limits()), Limits()), RUNS))
    scripts = [told.script(scenario) for scenario in found]
    expected = [told.run(run_of(scenario)) for scenario in found]
    replay = make(watched, "embedded")
    for timing in TIMINGS:
        done = replay.runs([(script, timing) for script in scripts])
        assert done == expected, (timing, replay.source)
    return len(scripts) * len(TIMINGS)


@pytest.mark.parametrize("name", ENGINES)
def test_hand_made_trees_run_as_simulated(name: EngineName) -> None:
    with engine(name) as (_, make):
        for each in HAND_MADE:
            assert assert_replayed(*hand_made(each), make) >= len(TIMINGS)


@pytest.mark.parametrize("name", ENGINES)
def test_a_bag_in_one_of_four_rooms_is_found(name: EngineName) -> None:
    with engine(name) as (_, make):
        assert assert_replayed(*hand_made("wings"), make) >= 4 * len(TIMINGS)


_BOX = """
(define (domain box)
  (:predicates (whole) (armed) (shaken))
  (:action shake
    :observe (probabilistic 3/4 (whole))
    :effect (and (when (armed) (probabilistic 1/2 (not (whole)))) (not (armed)) (shaken))))
(define (problem parcel) (:domain box) (:init (armed) (unknown (whole))) (:goal (and (shaken) (whole))))
"""


@pytest.mark.parametrize("name", ENGINES)
def test_an_action_may_end_what_decides_over_what_it_changes_unseen(name: EngineName) -> None:
    pair = planned(compiled(_BOX), Fraction(1, 5))
    assert pair is not None
    with engine(name) as (_, make):
        assert assert_replayed(*pair, make) > 0


HIDDEN = {"corridors", "diagnosis", "press", "shelves"}


@pytest.mark.parametrize("name", ENGINES)
def test_trees_of_the_domains_run_as_simulated(name: EngineName) -> None:
    with engine(name) as (_, make):
        for problem in PROBLEMS:
            if problem.domain not in HIDDEN:
                continue
            tree = tree_of(problem)
            watched = with_monitor(tree, Limits())
            assert watched is not None or problem.domain == "corridors", problem
            if watched is not None:
                assert assert_replayed(replace(tree, task=with_hidden(tree.task)), watched, make) > 0


@pytest.mark.parametrize("noise", [False, True])
@pytest.mark.parametrize("name", ENGINES)
def test_random_hidden_trees_run_as_simulated(
    name: EngineName, noise: bool, record_property: Callable[[str, object], None]
) -> None:
    with engine(name) as (version, make):
        compared = Compared(record_property, f"random trees over hidden facts: simulator and {version}")
        trees = random_trees(TREES, noise=noise)
        assert len(trees) == TREES
        for tree, watched in trees:
            compared.add(trees=1, runs=assert_replayed(tree, watched, make))


# --- the tables themselves -------------------------------------------------------------------


class Edge:
    """A step of a chain: the action, the seen facts before it and after it, what it told, and the state
    after it."""

    def __init__(self, action: str, before: bytes, told: dict[str, bool], after: bytes) -> None:
        self.action, self.before, self.told, self.after = action, before, told, after


def edges_of(task: Task, chain: Chain, monitor: Monitor) -> list[tuple[int, Edge, int]]:
    """Every edge of a chain with every reading that leads along it, by its ends."""
    names = ObservationNames(task)
    found = []
    for at, state in enumerate(chain.states):
        for edge in chain.edges[at]:
            action = chain.actions[chain.action[at]].action
            after = edge.result.values
            found += [
                (at, Edge(action, state.values, told, after), edge.successor)
                for told in tellings(task, names, monitor, action, state.values, after)
            ]
    return found


def tellings(
    task: Task, names: ObservationNames, monitor: Monitor, action: str, before: bytes, after: bytes
) -> list[dict[str, bool]]:
    found: list[dict[str, bool]] = [{}]
    for change in changes_of(task, action):
        listed = names.of(action, change.component)
        seen = bytes(before[v] for v in change.seen)
        options = []
        for reading in Readings(task, change, lambda work, many: None).after(
            number_in(task, before, change.component), seen
        ):
            then = bytearray(seen)
            for place, value in reading.shown:
                then[place] = value
            same = bytes(then) == bytes(after[v] for v in change.seen)
            if same and reading.belief == number_in(task, after, change.component):
                told = {listed[place]: bool(value) for place, value in reading.told}
                options.append({k: v for k, v in told.items() if k in monitor.readings.get(action, ())})
        found = [{**one, **other} for one in found for other in options]
    return found


def known_of(monitor: Monitor, values: bytes) -> dict[int, Truth]:
    return {variable: Truth(values[variable]) for variable in sorted(monitor.known)}


DRIVER = """\
#include <iostream>
#include <map>
#include <string>
#include "monitor.hpp"
TABLES
int main(int, char** argv) {
  const std::vector<const std::vector<robot_tree::Part>*> tables = {LIST};
  std::map<std::string, int> seen;
  robot_tree::Monitor monitor(*tables[std::stoi(argv[1])], [&](const std::string& fact) {
    const int value = seen[fact];
    return value == 1 ? std::nullopt : std::optional<bool>(value == 2);
  });
  std::string word;
  robot_tree::Readings readings;
  while (std::getline(std::cin, word)) {
    const std::string rest = word.size() > 1 ? word.substr(2) : "";
    if (word[0] == 'R') monitor.restart();
    if (word[0] == 'S') seen[rest.substr(2)] = rest[0] - '0';
    if (word[0] == 'O') readings[rest.substr(2)] = rest[0] == '1';
    if (word[0] == 'B') monitor.begin(rest);
    if (word[0] == 'T') { monitor.told(rest, readings); readings.clear(); }
    if (word[0] == 'A') {
      for (const auto& fact : monitor.facts()) {
        const auto value = monitor.value(fact);
        std::cout << fact << '=' << (!value ? '1' : *value ? '2' : '0') << ';';
      }
      std::cout << monitor.outside() << std::endl;
    }
  }
}
"""


def walks(chain: Chain, edges: list[tuple[int, Edge, int]]) -> list[list[Edge]]:
    """Walks through the chain that together take every edge."""
    out: dict[int, list[tuple[Edge, int]]] = {}
    for at, edge, then in edges:
        out.setdefault(at, []).append((edge, then))
    way: dict[int, list[Edge]] = {at: [] for _, at in chain.initial}
    queue = list(way)
    for at in queue:
        for edge, then in out.get(at, []):
            if then not in way:
                way[then] = [*way[at], edge]
                queue.append(then)
    return [[*way[at], edge] for at, edge, _ in edges]


def test_every_edge_of_the_chain_is_in_the_table_of_cpp(tmp_path: Path) -> None:
    """For the table in C++, compiled by itself, and what is known in every state that the tree reaches."""
    if shutil.which("c++") is None:
        pytest.skip("no c++ on the PATH")
    cases = [hand_made(name) for name in HAND_MADE if name != "told first"]
    cases += random_trees(TREES, noise=True)[: amount(4, 40)]
    driver = driver_of([watched for _, watched in cases], tmp_path)
    for number, pair in enumerate(cases):
        check_in_cpp(*pair, [driver, str(number)])


def driver_of(trees: list[Tree], folder: Path) -> Path:
    """One program with the tables of some trees: compiled once, as that takes long."""
    tables = []
    for number, watched in enumerate(trees):
        assert watched.monitor is not None
        space = f"table{number}"
        written = monitor_files(watched.task, btcpp_names(watched), watched.monitor, space)
        (folder / f"{space}.hpp").write_text(written["monitor_table.hpp"], encoding="utf-8")
        tables.append(f'namespace {space} {{ using robot_tree::Part; }}\n#include "{space}.hpp"\n')
        if not number:
            alone = monitor_files(watched.task, btcpp_names(watched), watched.monitor, "robot_tree")
            (folder / "monitor.hpp").write_text(alone["monitor.hpp"], encoding="utf-8")
    names = ", ".join(f"&table{number}::monitorTable()" for number in range(len(trees)))
    text = DRIVER.replace("TABLES", "".join(tables)).replace("LIST", names)
    (folder / "driver.cpp").write_text(text, encoding="utf-8")
    flags = ["-std=c++17", "-O0", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    done = subprocess.run(
        ["c++", *flags, "driver.cpp", "-o", "driver"],
        cwd=folder, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder / "driver"


def check_in_cpp(tree: Tree, watched: Tree, driver: list[str | Path]) -> None:
    monitor = watched.monitor
    assert monitor is not None
    names = btcpp_names(watched)
    table = MonitorTable(watched.task, names, monitor)
    chain = explore(tree.task, tree.root, Limits())
    lines: list[str] = []
    expected: list[dict[int, Truth]] = []
    for walk in walks(chain, edges_of(tree.task, chain, monitor)):
        lines.append("R")
        for edge in walk:
            lines += [f"S {edge.before[v]} {table.fact(v)}" for v in monitor.seen]
            lines.append(f"B {table.action(edge.action)}")
            lines += [f"S {edge.after[v]} {table.fact(v)}" for v in monitor.seen]
            lines += [f"O {int(value)} {name}" for name, value in edge.told.items()]
            lines.append(f"T {table.action(edge.action)}")
        lines.append("A")
        expected.append(known_of(monitor, walk[-1].after))
    twice = [table.action(name) for name in monitor.readings if name != FIRST][:1] * 2
    lines += ["R", *(f"B {name}" for name in twice), "A"]
    said = subprocess.run(
        driver, input="\n".join(lines) + "\n", capture_output=True, text=True, check=True
    ).stdout.splitlines()
    *answers, last = said
    assert ("outside the model: " in last) == bool(twice)
    assert len(answers) == len(expected)
    for answer, known in zip(answers, expected, strict=True):
        facts = {f"{table.fact(variable)}={int(value)}" for variable, value in known.items()}
        assert set(answer.split(";")) == {*facts, ""}


def test_what_cannot_be_in_the_model_ends_in_failure() -> None:
    """A second no in two places is impossible; the tree fails and says why, and nothing is known any more."""
    pytest.importorskip("py_trees")
    from py_trees.common import Status

    from bbtc.replay.engines import exported_module

    pair = planned(search(2), Fraction(1))
    assert pair is not None
    module = exported_module(pair[1])

    class Robot:
        def __init__(self) -> None:
            self.monitor = module.Monitor(module.MONITOR, lambda *fact: False)
            self.looked = 0

        def have(self) -> bool:
            return False

        def look(self, place: str) -> Status:
            self.looked += 1
            self.monitor.told("look", place, readings={"seen()": False, "nonsense": True})
            return Status.SUCCESS

        def take(self, place: str) -> Status:
            raise AssertionError

        def cancel(self, action: str) -> None:
            raise AssertionError

    robot = Robot()
    root = module.create_root(robot)
    assert module.run(root) == Status.FAILURE
    assert root.feedback_message == "outside the model: look(0): it has no reading nonsense"
    assert robot.looked == 1
    assert robot.monitor.value("at", "0") is None


def test_trees_over_what_is_seen_need_no_monitor() -> None:
    seen = WINGS.replace("(oneof (bag-at hall) (bag-at lab) (bag-at cellar) (bag-at attic))", "(bag-at lab)")
    assert planned(compiled(seen), Fraction(1)) is None


def test_one_fact_that_is_seen_when_looked_at_needs_no_monitor() -> None:
    """The robot knows what it saw; nothing follows from that for any other fact."""
    text = """(define (domain d) (:predicates (shut) (in))
      (:action look :observe (shut))
      (:action open :precondition (shut) :effect (not (shut)))
      (:action enter :precondition (not (shut)) :effect (in)))
    (define (problem x) (:domain d) (:init (unknown (shut))) (:goal (in)))"""
    assert planned(compiled(text), Fraction(1)) is None
