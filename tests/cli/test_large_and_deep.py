"""Large and deep input: time grows as the input does, and no depth ends in an internal error."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import bbtc
from bbtc.tree.nodes import tree_depth
from tests.cli.forked import Done, commands
from tests.conftest import REPOSITORY
from tests.long_form import LONG, amount

MOST_SECONDS = amount(5, 12)
"""Of processor time: many times what is needed, and far less than what quadratic time would take."""

PROBLEM = "(define (problem q) (:domain d) {} (:init {}) (:goal (g)))"


def run(*arguments: str | Path, statuses: tuple[int, ...] = (0,)) -> Done:
    """The program; it must end with one of the statuses, and not because of a bug."""
    done = commands().run(REPOSITORY, *map(str, arguments))
    assert done.status in statuses, done.err[-2000:]
    assert "internal error" not in done.err
    return done


def each(count: int, form: str) -> str:
    return " ".join(form.format(i=i, j=i + 1) for i in range(count))


def conjuncts(count: int) -> str:
    """A precondition that says the same again and again."""
    return (
        "(define (domain d) (:predicates (p) (g))"
        f" (:action a :precondition (and {'(p) ' * count}) :effect (g)))" + PROBLEM.format("", "(p)")
    )


def different_conjuncts(count: int) -> str:
    """A precondition of many facts about one object, each made true by one action, and denied by another."""
    facts = each(count, "(q{i} ?x)")
    return (
        f"(define (domain d) (:predicates (p ?x) (g) {facts})"
        f" (:action a :parameters (?x) :precondition (and (p ?x) {facts}) :effect (g))"
        " (:action n :parameters (?x) :effect (g)"
        f" :precondition (and (p ?x) {each(count // 4, '(not (q{i} ?x))')}))"
        f" (:action b :parameters (?x) :precondition (p ?x) :effect (and {facts})))"
        + PROBLEM.format("(:objects o1 o2)", "(p o1)")
    )


def templates(count: int) -> str:
    """Templates that call one another."""
    return (
        "(define (domain d) (:predicates (p) (g)) (:action a :effect (g))"
        f"{each(count - 1, '(:template t{i} :body (sequence (t{j})))')}"
        f" (:template t{count - 1} :body (sequence (a))))" + PROBLEM.format("", "(p)")
    )


def steps_backwards(count: int) -> str:
    """Actions that make one another possible, the last one first."""
    chain = " ".join(
        f"(:action a{i} :precondition (q{i}) :effect (q{i + 1}))" for i in reversed(range(count))
    )
    return (
        f"(define (domain d) (:predicates (p) (g) {each(count + 1, '(q{i})')}) {chain}"
        f" (:action b :precondition (p) :effect (q0)) (:action e :precondition (q{count}) :effect (g)))"
        + PROBLEM.format("", "(p)")
    )


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (conjuncts, amount(20_000, 30_000)),
        (different_conjuncts, amount(4_000, 6_000)),
        (templates, amount(2_600, 4_000)),
        (steps_backwards, amount(2_000, 3_000)),
    ],
)
def test_time_grows_as_the_input_does(tmp_path: Path, text: Callable[[int], str], count: int) -> None:
    file = tmp_path / "large.pddl"
    file.write_text(text(count))
    commands: list[list[str | Path]] = [
        ["check", file],
        ["fmt", "--check", file],
        ["compile", file, "-o", tmp_path / "task.json"],
    ]
    for command in commands:
        done = run(*command, statuses=(0, 1) if command[0] == "fmt" else (0,))
        assert done.seconds < MOST_SECONDS


@pytest.mark.parametrize("command", [["check"], ["fmt", "--check"], ["compile"], ["plan"]])
def test_limits_hold_while_large_input_is_read(tmp_path: Path, command: list[str]) -> None:
    file = tmp_path / "large.pddl"
    actions = each(60_000, "(:action a{i} :precondition (p) :effect (g))")
    file.write_text(f"(define (domain d) (:predicates (p) (g)) {actions})" + PROBLEM.format("", "(p)"))
    done = run(*command, file, "--time-limit", "0.4", statuses=(3,))
    assert "the time limit of 0.4 s ended" in done.err
    assert "a59999" in file.read_text()
    if command[0] != "plan" and not LONG:
        return  # they read as it does
    # In a process that has nothing yet, which is within the limit.
    alone = subprocess.run(
        [sys.executable, "-m", "bbtc.cli.main", *command, str(file), "--max-memory", "60"],
        capture_output=True, text=True, check=False, cwd=REPOSITORY,
    )  # fmt: skip
    assert alone.returncode == 3, alone.stderr[-2000:]
    assert "60 MiB of memory ended" in alone.stderr


# --- deep ----------------------------------------------------------------------------------------


def corridor(count: int) -> str:
    """So many steps from one end to the other."""
    return (
        "(define (domain corridor) (:types place) (:predicates (at ?p - place) (next ?a ?b - place))"
        " (:action step :parameters (?a ?b - place) :precondition (and (at ?a) (next ?a ?b))"
        " :effect (and (at ?b) (not (at ?a)))))"
        f"(define (problem long) (:domain corridor) (:objects {each(count + 1, 'p{i}')} - place)"
        f" (:init (at p0) {each(count, '(next p{i} p{j})')}) (:goal (at p{count})))"
    )


def formats() -> list[str]:
    from bbtc.backends.registry import BUILT_INS

    return list(BUILT_INS)


def test_a_plan_of_hundreds_of_steps(tmp_path: Path) -> None:
    """Search meets the levels that a tree may have; the policy is written as a wide tree."""
    file, made = tmp_path / "corridor.pddl", tmp_path / "tree.json"
    file.write_text(corridor(amount(150, 300)))
    strategies = ("policy",) if not LONG else ("policy", "advised")
    for strategy in strategies:
        run("plan", file, "-q", "--strategy", strategy, "--time-limit", "none", "-o", made)
        tree = bbtc.load_tree(made)
        assert tree.success_probability == 1
        assert tree_depth(tree.root) <= 4
        run("simulate", made)
        run("verify", made)
        run("diff", made, made)
        for form in ("btcpp", "text") if not LONG else formats():
            run("export", made, "--to", form, "-o", tmp_path / form)
        run("import", tmp_path / "btcpp", file, "-o", tmp_path / "again.json")
        assert bbtc.load_tree(tmp_path / "again.json").success_probability == 1


@pytest.mark.parametrize("count", [300, 1000])
def test_a_chain_that_no_tree_of_refinements_can_hold(tmp_path: Path, count: int) -> None:
    """Greedy refinement does not get there: it ends with what it has, by a limit or as it knows no more."""
    file, made = tmp_path / "corridor.pddl", tmp_path / "tree.json"
    file.write_text(corridor(count))
    run("plan", file, "-q", "--strategy", "refine", "--time-limit", "3", "-o", made, statuses=(3,))
    if made.exists():  # unless the time was over before there was anything to plan for
        assert bbtc.load_tree(made).status in {"limit-reached", "stuck"}


def nested(depth: int) -> str:
    """A condition of so many levels that says something else on each."""
    condition = "(p)"
    for level in range(depth):
        condition = f"({'and' if level % 2 else 'or'} (q{level % 5}) {condition})"
    return condition


@pytest.mark.parametrize("depth", [90, 240, 890][amount(1, 0) :])
def test_a_deep_condition(tmp_path: Path, depth: int) -> None:
    """It is worked with up to the limit of reading; what no command could read again is not written."""
    file, made = tmp_path / "deep.pddl", tmp_path / "tree.json"
    facts = each(5, "(q{i})")
    file.write_text(
        f"(define (domain d) (:predicates (p) (g) {facts})"
        f" (:action a :precondition {nested(depth)} :effect (g))"
        f" (:action b :effect (and (p) {facts}))"
        f" (:action c :effect (and (not (p)) {each(5, '(not (q{i}))')})))"
        "(define (problem q) (:domain d) (:init (unknown (q1))) (:goal (g)))"
    )
    deep = ("--max-depth", "900")
    run("check", file, *deep)
    run("fmt", file, *deep)
    for form in ("ast", "model", "prism") if depth < 250 or LONG else ("prism",):
        run("compile", file, *deep, "--emit", form, "-o", tmp_path / form)
    written = (0,) if depth < 250 else (1,)
    # The engine takes no condition so deep: a tree that does not read it again can be exported.
    shallow = ("--strategy", "policy", "--closed-world")
    done = run("plan", file, *deep, *shallow, "-q", "-o", made, statuses=written)
    run("compile", file, *deep, "-o", tmp_path / "task.json", statuses=written)
    if depth > 250:
        assert "BBT0605" in done.err
        return
    for command in (["simulate"], ["verify"], ["run", "--batch"]):
        run(*command, made)
    for form in ("btcpp", "dot", "py_trees", "jani", "yaml"):
        run("export", made, "--to", form, "-o", tmp_path / form)


@pytest.mark.parametrize("levels", [256, 257, 5000])
def test_a_deep_tree(tmp_path: Path, levels: int) -> None:
    """Up to 256 levels every command takes it; beyond, every command says that it is too deep."""
    file, made = tmp_path / "short.pddl", tmp_path / "tree.json"
    file.write_text(
        "(define (domain d) (:predicates (g)) (:action a :effect (g)))"
        "(define (problem q) (:domain d) (:goal (g)))"
    )
    run("plan", file, "-q", "-o", made)
    tree = json.loads(made.read_text())
    root = json.dumps(tree["root"])
    above = "".join(f'{{"id": "c{i}", "type": "sequence", "children": [' for i in range(levels - 2))
    tree["root"] = "ROOT"
    made.write_text(json.dumps(tree).replace('"ROOT"', above + root + "]}" * (levels - 2)))
    statuses = (0,) if levels <= 256 else (1,)
    for command in (["simulate"], ["verify"], ["run", "--batch"]):
        done = run(*command, made, statuses=statuses)
        assert levels <= 256 or "BBT0605" in done.err
    run("diff", made, made, statuses=statuses)
    for form in ("btcpp", "dot", "svg", "mermaid", "py_trees", "jani", "yaml", "text"):
        run("export", made, "--to", form, "-o", tmp_path / form, statuses=statuses)
    inside = "<Fallback>" * levels + "</Fallback>" * levels
    xml = f'<root BTCPP_format="4"><BehaviorTree ID="m">{inside}</BehaviorTree></root>'
    (tmp_path / "tree.xml").write_text(xml)
    run("import", tmp_path / "tree.xml", file, "-o", tmp_path / "read.json", statuses=(1,))


@pytest.mark.parametrize(
    ("text", "statuses"),
    [
        ("derived", (1,)),
        ("types", (0,)),
        ("templates", (0,)),
    ],
)
def test_long_chains(tmp_path: Path, text: str, statuses: tuple[int, ...]) -> None:
    """Derived predicates that rest on one another (more than are unfolded), types below one another, and
    templates that call one another (more levels than a tree has: planning does without)."""
    rules = amount(5_000, 8_000)
    derived = (
        f"(define (domain d) (:predicates (p) (g) {each(rules + 1, '(q{i})')})"
        f" {each(rules, '(:derived (q{i}) (q{j}))')}"
        f" (:derived (q{rules}) (p)) (:action z :effect (p)) (:action a :precondition (q0) :effect (g)))"
    )
    types = (
        f"(define (domain d) (:types {each(20_000, 't{i} - t{j}')}) (:predicates (g))"
        " (:action a :parameters (?x - t16000) :effect (g)))"
    )
    chain = (
        "(define (domain d) (:predicates (g)) (:action a :effect (g))"
        " (:template top :effect (g) :body (sequence (t0)))"
        f" {each(2000, '(:template t{i} :body (sequence (t{j})))')} (:template t2000 :body (sequence (a))))"
    )
    file = tmp_path / "chain.pddl"
    domain = {"derived": derived, "types": types, "templates": chain}[text]
    file.write_text(domain + PROBLEM.format("(:objects o - t0)" if text == "types" else "", ""))
    for words in (["check"], ["fmt"], ["compile", "-o", tmp_path / "task.json"]):
        done = run(*words, file, statuses=statuses if words[0] == "compile" else (0,))
        assert done.seconds < MOST_SECONDS
    if text == "templates" or LONG:
        made = tmp_path / "tree.json"
        done = run("plan", file, "-q", "--time-limit", "none", "-o", made, statuses=statuses)
        assert statuses == (1,) or bbtc.load_tree(made).success_probability == 1
    if text == "derived":
        assert "BBT0408" in done.err
