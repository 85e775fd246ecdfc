"""Whatever ends planning, and whenever: the best tree so far is there, it is sound, and it says what ended
it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from pathlib import Path

import pytest

import bbtc
from bbtc.diagnostics import LimitReached, Report
from bbtc.ground.task import Task
from bbtc.limits import PLANNING_SECONDS, Limits, Stage
from bbtc.pipeline import compile_sources, plan_task, simulate_tree
from bbtc.planner.options import DEFAULTS, Options
from bbtc.source import SourceFile
from tests.cli import program
from tests.conftest import REPOSITORY
from tests.long_form import LONG

STRATEGIES = ("auto", "search", "policy", "refine")

NODES = 40
"""So many and no more, or refinement goes on for long."""

# A robot looks for a key in one of two rooms, and its gripper may slip: every strategy has something to do,
# and no tree reaches 1.
TEXT = """
(define (domain keys)
  (:types room)
  (:predicates (in ?r - room) (key-in ?r - room) (held) (broken))
  (:action go :parameters (?r - room) :precondition (not (in ?r))
    :effect (and (in ?r) (forall (?o - room) (when (not (= ?o ?r)) (not (in ?o))))))
  (:action look :parameters (?r - room) :precondition (and (in ?r) (unknown (key-in ?r)))
    :effect (probabilistic 1/2 (key-in ?r) 1/2 (not (key-in ?r))))
  (:action grasp :parameters (?r - room) :precondition (and (in ?r) (key-in ?r) (not (broken)))
    :effect (probabilistic 7/10 (held) 1/10 (broken))))
(define (problem find) (:domain keys) (:objects hall den - room)
  (:init (in hall) (unknown (key-in hall)) (unknown (key-in den)))
  (:goal (held)))
"""


@pytest.fixture(scope="module")
def task() -> Task:
    return compile_sources([SourceFile("keys.pddl", TEXT)], Report(), Limits())


@cache
def looks(task: Task, strategy: str, options: Options = DEFAULTS) -> int:
    """How often planning looks at its limits."""
    told: list[Stage] = []
    limits = Limits(nodes=NODES, watcher=told.append)
    plan_task(task, Fraction(1), strategy, limits, lambda _: None, options=options)
    return len(told)


def at_look(number: int, end: Callable[[], BaseException]) -> Callable[[Stage], None]:
    """A watcher that ends the work when it is told for the so-manieth time."""
    left = [number]

    def watch(_stage: Stage) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise end()

    return watch


def some(count: int, most: int) -> list[int]:
    """Numbers from 1 to ``count``, the first and the last among them."""
    step = 1 if LONG else max(1, count // most)
    return sorted({1, count, *range(1, count + 1, step)})


@pytest.mark.parametrize("strategy", STRATEGIES)
@pytest.mark.parametrize("ended", ["interrupted", "limit-reached"])
def test_the_best_tree_survives_an_end_at_any_moment(task: Task, strategy: str, ended: str) -> None:
    """An interruption, or a limit, at any look at the limits: each is in another phase of planning."""
    end: Callable[[], BaseException] = (
        KeyboardInterrupt if ended == "interrupted" else lambda: Limits.reached("it is over", "--time-limit")
    )
    for number in some(looks(task, strategy), 8):
        plan = plan_task(
            task, Fraction(1), strategy, Limits(nodes=NODES, watcher=at_look(number, end)), lambda _: None
        )
        figures, _ = simulate_tree(plan.tree, Limits())
        assert figures.success == plan.tree.success_probability == plan.figures.success
        # Once it is known what any policy can reach, that is the verdict, whatever ends the rest.
        assert plan.tree.status in {ended, "out-of-reach", *(["stuck"] if ended == "limit-reached" else [])}
        if number == 1 and ended == "interrupted":
            assert plan.tree.status == ended


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_what_was_found_before_the_end_is_what_is_returned(task: Task, strategy: str) -> None:
    """The later planning is ended, the better the tree: at the last look it is as good as without an end.
    In a closed world: else what holds for all states is learnt first, in a moment, and is all that is
    needed."""
    closed = Options(closed_world=True)

    def planned(limits: Limits) -> Fraction:
        plan = plan_task(task, Fraction(1), strategy, limits, lambda _: None, options=closed)
        return plan.tree.success_probability

    last = looks(task, strategy, closed)
    ended = planned(Limits(nodes=NODES, watcher=at_look(last, KeyboardInterrupt)))
    assert ended == planned(Limits(nodes=NODES)) > 0


# --- by the command ----------------------------------------------------------------------------


@pytest.fixture
def endless(tmp_path: Path) -> list[str]:
    """Arguments for planning that takes longer than anybody waits: sixty lights, whose switches flip their
    neighbours, too."""
    flips = "(when (lit {0}) (not (lit {0}))) (when (not (lit {0})) (lit {0}))"
    names = [f"l{number}" for number in range(60)]
    actions = " ".join(
        f"(:action press-{name} :effect (probabilistic 9/10 (and "
        f"{' '.join(flips.format(each) for each in names[max(0, at - 1) : at + 2])})))"
        for at, name in enumerate(names)
    )
    file = tmp_path / "lights.pddl"
    file.write_text(
        f"(define (domain lights) (:constants {' '.join(names)}) (:predicates (lit ?l)) {actions})"
        f"(define (problem row) (:domain lights) (:init (lit l1) (lit l30))"
        f" (:goal (and {' '.join(f'(lit {name})' for name in names)})))"
    )
    return ["plan", str(file), "-o", str(tmp_path / "tree.json")]


def started(*arguments: str) -> subprocess.Popen[str]:
    """The program, planning: it has told what it plans for."""
    process = subprocess.Popen(
        [sys.executable, "-m", "bbtc.cli.main", *arguments], stderr=subprocess.PIPE, text=True, cwd=REPOSITORY
    )
    assert process.stderr is not None
    assert "goal" in process.stderr.readline()
    return process


@pytest.mark.parametrize("strategy", ["search", "policy", "refine"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_program_with_a_tree(
    endless: list[str], strategy: str, number: signal.Signals
) -> None:
    """In the short form Ctrl-C comes at once, the other signal later."""
    short = (0.0,) if number == signal.SIGINT else (0.5,)
    for seconds in short if not LONG else [each / 4 for each in range(24)]:
        process = started(*endless, "--strategy", strategy)
        time.sleep(seconds)
        process.send_signal(number)
        _, told = process.communicate(timeout=120)
        if seconds > 2 and process.returncode == 0:
            break  # it had come to its end before: some planners do on a fast machine
        assert process.returncode == 130, told
        tree = bbtc.load_tree(endless[-1])
        assert tree.status == "interrupted"
        Path(endless[-1]).unlink()


def test_more_signals_do_not_keep_the_tree_from_being_written(endless: list[str]) -> None:
    process = started(*endless, "--strategy", "search")
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=120)
    assert process.returncode == 130
    assert bbtc.load_tree(endless[-1]).status == "interrupted"


def test_a_time_limit_ends_the_program_with_a_tree(endless: list[str]) -> None:
    started_at = time.monotonic()
    done = program.bbtc(*endless, "-q", "--time-limit", "1", "--strategy", "refine")
    assert done.returncode == 3, done.stderr
    assert "the time limit of 1 s ended" in done.stderr
    assert json.loads(Path(endless[-1]).read_text())["status"] == "limit-reached"
    assert time.monotonic() - started_at < 60


# --- unless somebody says otherwise ------------------------------------------------------------


def test_planning_has_a_time_limit_by_default(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In the command, in a build and in Python; ``none`` lifts it."""
    seen: list[float | None] = []
    real = plan_task

    def spy(*arguments: object, **options: object) -> object:
        limits = next(each for each in (*arguments, *options.values()) if isinstance(each, Limits))
        seen.append(limits.seconds)
        return real(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("bbtc.pipeline.plan_task", spy)
    file = tmp_path / "keys.pddl"
    file.write_text(TEXT)
    source = SourceFile("keys.pddl", TEXT)
    from click.testing import CliRunner

    from bbtc.cli.group import cli

    bbtc.plan(source, target=0)
    bbtc.plan(source, target=0, limits=Limits())
    for options in ([], ["--time-limit", "none"], ["--time-limit", "7"]):
        CliRunner().invoke(cli, ["plan", str(file), "--target", "0", *options], catch_exceptions=False)
    CliRunner().invoke(cli, ["export", str(file), "--target", "0", "--to", "text"], catch_exceptions=False)
    limits = ("", "limits: {time: none}", "limits: {time: 7}")
    for number, line in enumerate(limits):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "keys.pddl").write_text(TEXT)
        (folder / "bbtc.yaml").write_text(
            f"version: 1\ntrees:\n  keys:\n    domain: keys.pddl\n    target: 0\n    {line}\n"
        )
        report = bbtc.build(folder / "bbtc.yaml", jobs=1)
        assert not any(outcome.failure for outcome in report.outcomes), report
    default = PLANNING_SECONDS
    assert seen == [default, None, default, None, 7, default, default, None, 7]


def test_a_build_does_not_take_a_tree_that_a_limit_ended_for_done(tmp_path: Path) -> None:
    (tmp_path / "keys.pddl").write_text(TEXT)
    manifest = tmp_path / "bbtc.yaml"
    manifest.write_text(
        "version: 1\ntrees:\n  keys:\n    domain: keys.pddl\n    target: 1/2\n    limits: {nodes: 2}\n"
    )
    for _ in range(2):
        report = bbtc.build(manifest, jobs=1)
        assert [outcome.failure for outcome in report.outcomes] == ["limit"]
    manifest.write_text("version: 1\ntrees:\n  keys:\n    domain: keys.pddl\n    target: 1/2\n")
    assert [outcome.failure for outcome in bbtc.build(manifest, jobs=1).outcomes] == [None]


def test_a_limit_that_allows_no_tree_is_raised(task: Task) -> None:
    with pytest.raises(LimitReached):
        plan_task(task, Fraction(1), "search", Limits(nodes=0), lambda _: None)
