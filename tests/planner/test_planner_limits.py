"""Every limit of the planner ends it soon, with the best tree so far and what is possible."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
import time
from fractions import Fraction
from pathlib import Path

import pytest

from bbtc.diagnostics import Report
from bbtc.ground.task import Task
from bbtc.limits import Effort, Limits
from bbtc.pipeline import compile_sources, plan_task
from bbtc.planner.bounds import task_value
from bbtc.planner.mdp.explore import explore_space
from bbtc.planner.options import Options
from bbtc.source import SourceFile
from tests.conftest import REPOSITORY
from tests.planner.test_bounds import coins


def lights(count: int) -> str:
    """A row of lights; a button flips its own and both neighbours, most of the time. Far too many
    states, and no way of telling which of them are near the goal."""

    def flip(light: int) -> str:
        return f"(when (lit{light}) (not (lit{light}))) (when (not (lit{light})) (lit{light}))"

    names = range(count)
    presses = " ".join(
        f"(:action press{i} :effect (probabilistic 9/10 (and"
        f" {' '.join(flip(j) for j in (i - 1, i, i + 1) if 0 <= j < count)})))"
        for i in names
    )
    facts = " ".join(f"(lit{i})" for i in names)
    start = " ".join(f"(lit{i})" for i in names if i % 3 != 1)
    return (
        f"(define (domain lights) (:predicates {facts}) {presses})"
        f"(define (problem row) (:domain lights) (:init {start}) (:goal (and {facts})))"
    )


@pytest.fixture(scope="module")
def row() -> Task:
    return compile_sources([SourceFile("lights.pddl", lights(60))], Report(), Limits())


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty coins to toss: three to the fortieth states, nearly all of which have the same hope."""
    file = tmp_path_factory.mktemp("limits") / "coins.pddl"
    file.write_text(coins(40))
    return file


# --- time ------------------------------------------------------------------------------------


class Clock:
    """Measures how much processor time this process takes after a moment to come: unlike the time on
    the wall, that tells about the program and not about what else the machine is doing."""

    def __init__(self, seconds: float) -> None:
        self._used: float | None = None
        self._timer = threading.Timer(seconds, self._note)
        self._timer.daemon = True
        self._timer.start()

    def _note(self) -> None:
        self._used = time.process_time()

    def overrun(self) -> float:
        """Seconds of processor time taken since that moment."""
        self._timer.cancel()
        return 0.0 if self._used is None else time.process_time() - self._used


@pytest.mark.parametrize(
    ("strategy", "max_actions"),
    [
        *((strategy, None) for strategy in ("refine", "policy", "search", "auto", "bounds")),
        *((strategy, 30) for strategy in ("policy", "auto", "bounds")),
    ],
)
def test_a_time_limit_ends_every_strategy_within_a_second(
    row: Task, strategy: str, max_actions: int | None
) -> None:
    options = Options(max_actions=max_actions)
    clock = Clock(0.3)
    limits = Limits(seconds=0.3)
    if strategy == "bounds":
        value = task_value(row, limits, options, costs=True)
        assert clock.overrun() < 1
        assert 0 <= value.lower <= value.upper <= 1
        return
    tree = plan_task(row, None, strategy, limits, lambda _: None, options=options).tree
    assert clock.overrun() < 1
    assert tree.bounds is not None
    assert tree.bounds[0] <= tree.bounds[1]
    assert tree.success_probability <= tree.bounds[1]


# --- states and nodes ------------------------------------------------------------------------


@pytest.mark.parametrize("states", [100, 10_000])
def test_a_limit_on_states_is_met_within_a_tenth(row: Task, states: int) -> None:
    space = explore_space(row, Limits(states=states))
    assert space.stop is not None
    assert states * 0.9 - 2 * 61 < len(space.states) < states * 1.1 + 2 * 61, "a state has 60 successors"
    value = task_value(row, Limits(states=states))
    assert value.states < states * 1.1 + 2 * 61


@pytest.mark.parametrize("strategy", ["refine", "policy", "search", "auto"])
def test_a_limit_on_nodes_is_never_passed(row: Task, strategy: str) -> None:
    from bbtc.tree.nodes import walk

    limits = Limits(nodes=150, states=3000, seconds=5)
    tree = plan_task(row, None, strategy, limits, lambda _: None).tree
    assert sum(1 for _ in walk(tree.root)) <= limits.nodes


@pytest.mark.parametrize("strategy", ["refine", "policy", "search", "strong-cyclic", "auto"])
def test_bounds_are_told_wherever_a_limit_ends_planning(strategy: str) -> None:
    """The limit is met at the first look at it, at the second, and so on until planning ends by itself."""
    task = compile_sources([SourceFile("coins.pddl", coins(3))], Report(), Limits())
    for looks in range(100):
        limits = Limits(effort=Effort(looks))
        tree = plan_task(task, Fraction(999, 1000), strategy, limits, lambda _: None).tree
        assert tree.bounds is not None, looks
        assert tree.bounds[0] <= Fraction(3, 4) ** 3 <= tree.bounds[1], looks
        if tree.status != "limit-reached":
            return
    raise AssertionError("planning did not end")


# --- memory ----------------------------------------------------------------------------------

_MIB = 1 << 20
# Not getrusage: what it tells begins with the memory of the process that started this one.
_PEAK = """
import sys
from bbtc.cli.main import main
try:
    main()
finally:
    (most,) = [line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")]
    print(int(most) << 10, file=open(sys.argv.pop(), "w"))
"""


def run(*arguments: str) -> tuple[int, str, str, int]:
    """Exit status, stdout, stderr and the most memory in bytes that a command took."""
    with tempfile.TemporaryDirectory() as folder:
        peak = Path(folder) / "peak"
        program = _PEAK.replace("sys.argv.pop()", repr(str(peak)))
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments],
            capture_output=True, text=True, check=False, cwd=REPOSITORY, timeout=500,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr, int(peak.read_text())


@pytest.fixture(scope="module")
def least(problem: Path) -> int:
    """The memory in MiB that any planning takes, however little it does."""
    return run("plan", str(problem), "--bounds", "--max-states", "100")[3] // _MIB


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="tells the memory of a process")
@pytest.mark.parametrize("how", ["--bounds", "--strategy=policy"])
def test_a_limit_on_memory_is_met_within_a_tenth(problem: Path, least: int, how: str) -> None:
    limit = least + 9
    unlimited = ("--max-states", "1000000000", "--max-nodes", "1000000000", "-q", "--target", "1/10")
    command = ("plan", str(problem), "--max-memory", str(limit), *unlimited)
    if how == "--bounds":
        status, written, told, peak = run(*command, "--bounds", "--json")
        assert peak < 1.1 * limit * _MIB
        assert status == 3, told
        value = json.loads(written)
        assert value["stop"] == f"the limit of {limit} MiB of memory ended exploration"
        assert float(Fraction(value["lower"])) <= 0.75**40 < float(Fraction(value["upper"]))
        return
    # Making a tree takes long, but little memory: time may end it first.
    status, written, told, peak = run(*command, how, "--time-limit", "8")
    assert peak < 1.1 * limit * _MIB
    assert status == 3, told
    tree = json.loads(written)
    assert tree["status"] == "limit-reached"
    lower, upper = float(Fraction(tree["bounds"]["lower"])), float(Fraction(tree["bounds"]["upper"]))
    assert lower <= 0.7501**40
    assert upper > 0.75**40
    assert 0 < float(Fraction(tree["success_probability"])) <= lower
    assert "the best that any policy can do is between " in told
