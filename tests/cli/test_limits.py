"""Input made to exhaust the machine ends soon, within bounded memory, with a message and a status."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.cli.forked import commands
from tests.conftest import REPOSITORY
from tests.long_form import amount

_MEMORY = 6 << 30  # bytes of address space; more than that ends the process
_SECONDS = 60.0  # processor time
_SOON = "0.2"  # seconds, for what would take years


def _run(*arguments: str, seconds: float = _SECONDS) -> subprocess.CompletedProcess[str]:
    """Run the program; fails if it takes too much processor time."""
    done = commands().run(REPOSITORY, *arguments, most_memory=_MEMORY)
    assert done.seconds < seconds, f"{done.seconds:.1f} s of processor time"
    assert "Traceback" not in done.err
    assert "internal error" not in done.err
    return subprocess.CompletedProcess(arguments, done.status, done.out, done.err)


def _wide(path: Path, parameters: int, objects: int, condition: str) -> Path:
    names = [f"?x{n}" for n in range(parameters)]
    path.write_text(
        f"""(define (domain wide)
          (:predicates (p ?x) (q ?x ?y) (done))
          (:action all :parameters ({" ".join(names)})
            :precondition {condition.format(" ".join(f"(p {name})" for name in names))}
            :effect (done)))
        (define (problem many) (:domain wide)
          (:objects {" ".join(f"o{n}" for n in range(objects))})
          (:init {" ".join(f"(p o{n})" for n in range(objects))})
          (:goal (done)))"""
    )
    return path


@pytest.mark.parametrize("text", ["(", ")", "()"])
def test_200_megabytes_of_parentheses(tmp_path: Path, text: str) -> None:
    file = tmp_path / "parentheses.pddl"
    megabyte = text.encode() * (1_000_000 // len(text))
    with file.open("wb") as out:
        for _ in range(200):
            out.write(megabyte)
    done = _run("check", str(file))
    assert done.returncode == 1
    assert "BBT0005" in done.stderr
    assert "larger than" in done.stderr


def test_as_many_parentheses_as_a_file_may_hold(tmp_path: Path) -> None:
    file = tmp_path / "parentheses.pddl"
    file.write_text("(" * 60_000_000)
    done = _run("check", str(file))
    assert done.returncode == 1
    assert "BBT0005" in done.stderr
    assert "nested" in done.stderr


def test_a_hundred_thousand_nested_conjunctions(tmp_path: Path) -> None:
    file = tmp_path / "nested.pddl"
    nested = "(and " * 100_000 + "(p)" + ")" * 100_000
    file.write_text(
        f"(define (domain d) (:predicates (p)) (:action a :precondition {nested} :effect (not (p))))"
    )
    done = _run("check", str(file))
    assert done.returncode == 1
    assert "nested.pddl:1:" in done.stderr
    assert "BBT0005" in done.stderr


@pytest.mark.parametrize("condition", ["(and {})", "(and)", "(or {})"])
def test_twelve_parameters_over_a_thousand_objects(tmp_path: Path, condition: str) -> None:
    file = _wide(tmp_path / "wide.pddl", 12, 1000, condition)
    done = _run("compile", str(file), "--time-limit", _SOON, "-o", str(tmp_path / "task.json"))
    assert done.returncode == 3
    assert "BBT0007" in done.stderr


def test_a_condition_that_no_objects_meet_takes_no_time_to_refute(tmp_path: Path) -> None:
    """Every object has `p`, so none of the thousand to the twelfth bindings is worth a look."""
    file = _wide(tmp_path / "wide.pddl", 12, 1000, "(not (and {}))")
    done = _run("compile", str(file), "--time-limit", "2", "-o", str(tmp_path / "task.json"))
    assert done.returncode == 1
    assert "BBT0412" in done.stderr
    assert "no action ever achieves `(done)`" in done.stderr


def test_twelve_parameters_that_few_objects_fit(tmp_path: Path) -> None:
    file = _wide(tmp_path / "wide.pddl", 12, 1, "(and {})")
    done = _run("compile", str(file), "-o", str(tmp_path / "task.json"))
    assert done.returncode == 0


def _draws(path: Path, count: int) -> Path:
    """An action of so many independent draws: two to that power outcomes."""
    facts = " ".join(f"(p{n})" for n in range(count))
    draws = " ".join(f"(probabilistic 1/2 (p{n}))" for n in range(count))
    path.write_text(
        f"(define (domain draws) (:predicates {facts}) (:action all :effect (and {draws})))"
        f"(define (problem p) (:domain draws) (:init) (:goal (and {facts})))"
    )
    return path


@pytest.fixture
def drawing(tmp_path: Path) -> Path:
    """A tree whose one action has two to the fortieth outcomes."""
    task = tmp_path / "task.json"
    assert _run("compile", str(_draws(tmp_path / "draws.pddl", 40)), "-o", str(task)).returncode == 0
    compiled = json.loads(task.read_text())
    root = {"id": "n1", "type": "action", "action": "all()", "latched": True}
    tree = {
        "format": "bbtc-tree", "version": 1, "domain": "draws", "problem": "p",
        "success_probability": "0", "target": "1", "status": "stuck", "root": root, "task": compiled,
    }  # fmt: skip
    file = tmp_path / "tree.json"
    file.write_text(json.dumps(tree))
    return file


@pytest.mark.parametrize("strategy", ["auto", "refine", "policy", "search"])
def test_an_action_of_very_many_outcomes_ends_planning_at_the_limit(tmp_path: Path, strategy: str) -> None:
    file = _draws(tmp_path / "draws.pddl", 40)
    done = _run("plan", str(file), "--strategy", strategy, "--time-limit", "0.5", "-o", str(tmp_path / "t"))
    assert done.returncode == 3
    assert (tmp_path / "t").exists()


@pytest.mark.parametrize(
    "command", [["simulate"], ["run", "--batch"], ["export", "--to", "dot", "-O", "flow=true"]]
)
@pytest.mark.parametrize("limit", [f"--time-limit={_SOON}", "--max-states=1000"])
def test_an_action_of_very_many_outcomes_ends_at_the_limit(
    drawing: Path, command: list[str], limit: str
) -> None:
    done = _run(command[0], str(drawing), *command[1:], limit)
    assert done.returncode == 3
    assert f"raise it with {limit.partition('=')[0]}" in done.stderr


def test_very_many_branches_take_time_in_proportion(tmp_path: Path) -> None:
    file, count = tmp_path / "branches.pddl", amount(10_000, 30_000)
    branches = " ".join([f"1/{count} (done)"] * count)
    file.write_text(
        f"(define (domain d) (:predicates (done)) (:action a :effect (probabilistic {branches})))"
        "(define (problem p) (:domain d) (:init) (:goal (done)))"
    )
    seconds = _SECONDS / amount(3**2, 1)  # what grows with the square is told as well
    done = _run("compile", str(file), "-o", str(tmp_path / "task.json"), seconds=seconds)
    assert done.returncode == 0


@pytest.mark.parametrize("digits", [4001, 99_000])
def test_a_task_of_very_long_numbers_is_refused(drawing: Path, digits: int) -> None:
    text = (drawing.parent / "task.json").read_text()
    for old, field in (('"cost": "1"', "cost"), ('"p": "0.5"', "p")):
        long = drawing.parent / f"{field}.json"
        long.write_text(text.replace(old, f'"{field}": "0.{"4" * digits}"', 1))
        done = _run("plan", str(long))
        assert done.returncode == 1
        assert "has too many digits" in done.stderr


def test_numbers_beyond_all_floats_are_planned_with_and_shown(tmp_path: Path) -> None:
    cost, p = "1" + "0" * 1789, "0." + "0" * 1789 + "1"
    rest = "0." + "9" * 1790
    effect = {"when": None, "set": {"g()": "true"}}
    action: dict[str, object] = {
        "name": "a()",
        "schema": "a",
        "args": [],
        "cost": cost,
        "precondition": ["true"],
    }
    action["outcomes"] = [{"p": p, "effects": [effect]}, {"p": rest, "effects": []}]
    task = {
        "format": "bbtc-task", "version": 1, "domain": "d", "problem": "p", "goal_probability": p,
        "variables": [{"name": "g()", "values": ["true", "false"], "hidden": False}],
        "initial": [{"p": "1", "assign": {"g()": "false"}}],
        "goal": ["is", "g()", "true"], "actions": [action],
    }  # fmt: skip
    file, tree = tmp_path / "task.json", tmp_path / "tree.json"
    file.write_text(json.dumps(task))
    for strategy in ("policy", "search", "auto", "refine"):
        # What is below all floats, searches in floats may miss.
        assert _run("plan", str(file), "--strategy", strategy, "-q", "-o", str(tree)).returncode in {0, 3}
    assert "e+" in _run("simulate", str(tree)).stdout
    for command in (["verify", "--engine", "own"], ["run", "--batch"], ["diff", str(tree)]):
        assert _run(command[0], str(tree), *command[1:]).returncode == 0
    for form in ("btcpp", "py_trees", "prism", "jani", "svg"):
        assert _run("export", str(tree), "--to", form, "-o", str(tmp_path / form)).returncode == 0


_OBJECTS = " ".join(f"o{n}" for n in range(300))
_QUANTIFIED = "(forall (?a ?b ?c ?d) {})"
_WIDE = {
    "a quantified effect": (
        "(p ?x) (q ?x)",
        "(:action a :effect " + _QUANTIFIED.format("(when (and (p ?b) (p ?c) (p ?d)) (q ?a))") + ")"
        "(:action b :parameters (?x) :effect (not (p ?x)))",
        " ".join(f"(p o{n})" for n in range(300)),
        "(q o1)",
    ),
    "a body": (
        "(p ?x) (g)",
        (
            "(:action a :parameters (?x) :effect (p ?x))"
            "(:template t :effect (g) :body (sequence (foreach (?a ?b ?c ?d) (a ?a))))"
        ),
        "",
        "(p o1)",
    ),
    "a draw at the start": (
        "(p ?x) (g)",
        "(:action a :effect (g))",
        _QUANTIFIED.format("(probabilistic 1/2 (p o1))"),
        "(g)",
    ),
}


@pytest.mark.parametrize("what", _WIDE)
def test_quantifiers_over_billions_of_bindings_end_at_the_time_limit(tmp_path: Path, what: str) -> None:
    predicates, actions, init, goal = _WIDE[what]
    file = tmp_path / "wide.pddl"
    file.write_text(
        f"(define (domain d) (:predicates {predicates}) {actions})"
        f"(define (problem p) (:domain d) (:objects {_OBJECTS}) (:init {init}) (:goal {goal}))"
    )
    done = _run("compile", str(file), "--time-limit", _SOON, "-o", str(tmp_path / "task.json"))
    assert done.returncode == 3
    assert "raise it with --time-limit" in done.stderr


def _doubling(levels: int) -> tuple[str, str]:
    """Derived predicates, and templates, each of which stands for twice what the one before does."""
    rules = "(:derived (d0) (e0))" + "".join(
        f"(:derived (d{n}) (or (and (d{n - 1}) (e{n % 3})) (and (d{n - 1}) (not (e{n % 2})))))"
        for n in range(1, levels)
    )
    bodies = "(:template t0 :effect (g) :body (sequence (a) (a)))" + "".join(
        f"(:template t{n} :effect (g) :body (sequence (t{n - 1}) (t{n - 1})))" for n in range(1, levels)
    )
    return rules, bodies


def test_derived_predicates_of_exponential_size_are_refused(tmp_path: Path) -> None:
    rules, _ = _doubling(60)
    names = " ".join(f"(d{n})" for n in range(60))
    file = tmp_path / "derived.pddl"
    file.write_text(
        f"(define (domain d) (:predicates (e0) (e1) (e2) (g) {names}) {rules}"
        "(:action x :effect (e0)) (:action y :effect (e1)) (:action z :effect (not (e2)))"
        "(:action b :precondition (d59) :effect (g)))"
        "(define (problem p) (:domain d) (:init (e2)) (:goal (g)))"
    )
    done = _run("compile", str(file), "-o", str(tmp_path / "task.json"))
    assert done.returncode == 1
    assert "BBT0408" in done.stderr
    assert "derived.pddl:1:" in done.stderr


def test_a_derived_predicate_with_very_many_ways_to_prove_itself_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "derived.pddl"
    objects = " ".join(f"o{n}" for n in range(40))
    file.write_text(
        "(define (domain d) (:predicates (e ?x ?y) (r ?x ?y))"
        "(:derived (r ?x ?y) (or (e ?x ?y) (exists (?z) (and (r ?x ?z) (r ?z ?y)))))"
        "(:action a :parameters (?x ?y) :effect (e ?x ?y)))"
        f"(define (problem p) (:domain d) (:objects {objects}) (:init) (:goal (r o1 o2)))"
    )
    done = _run("compile", str(file), "-o", str(tmp_path / "task.json"))
    assert done.returncode == 1
    assert "BBT0408" in done.stderr
    done = _run("check", str(file))
    assert (done.returncode, "error" in done.stderr) == (0, False), "a check says what it can without that"


@pytest.mark.parametrize("strategy", ["auto", "refine"])
def test_templates_that_stand_for_very_many_nodes_end_at_the_limit_on_nodes(
    tmp_path: Path, strategy: str
) -> None:
    _, bodies = _doubling(60)
    file = tmp_path / "templates.pddl"
    file.write_text(
        f"(define (domain d) (:predicates (p) (g)) (:action a :precondition (p) :effect (p)) {bodies}"
        "(:action b :precondition (p) :effect (probabilistic 1/2 (g) 1/2 (not (p)))))"
        "(define (problem p) (:domain d) (:init (p)) (:goal (g)))"
    )
    done = _run("plan", str(file), "--strategy", strategy, "-q", "-o", str(tmp_path / "tree.json"))
    assert done.returncode in {1, 3}
    assert (tmp_path / "tree.json").exists()


@pytest.mark.parametrize("how", [["--bounds"], ["--strategy", "policy"], ["--strategy", "search"]])
def test_a_goal_of_very_many_conditions_ends_at_the_time_limit(tmp_path: Path, how: list[str]) -> None:
    objects = [f"o{n}" for n in range(6000)]
    file = tmp_path / "goal.pddl"
    file.write_text(
        "(define (domain d) (:predicates (p ?x)) (:action a :parameters (?x) :effect (p ?x)))"
        f"(define (problem p) (:domain d) (:objects {' '.join(objects)}) (:init)"
        f"(:goal (and {' '.join(f'(p {name})' for name in objects)})))"
    )
    done = _run("plan", str(file), *how, "--time-limit", "0.5", "-q", "-o", str(tmp_path / "out"))
    assert done.returncode in {0, 3}


@pytest.mark.parametrize("command", [["check"], ["compile"], ["plan", "-q"], ["export", "--to", "prism"]])
def test_what_a_raised_limit_on_depth_lets_in_is_worked_with(tmp_path: Path, command: list[str]) -> None:
    file = tmp_path / "nested.pddl"
    nested = "(not " * 880 + "(p)" + ")" * 880
    file.write_text(
        f"(define (domain d) (:predicates (p) (g)) (:action a :precondition {nested} :effect (g))"
        "(:action b :effect (p)))(define (problem q) (:domain d) (:init) (:goal (g)))"
    )
    done = _run(command[0], str(file), *command[1:], "--max-depth", "900")
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stderr
