"""Every problem under ``domains/``, and every artefact the command line makes of it."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from click.testing import CliRunner

from bbtc.api import load_tree
from bbtc.cli.group import cli
from bbtc.diagnostics import Report
from bbtc.files.sources import read_source
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.pipeline import compile_sources, plan_task, without_hidden
from bbtc.planner.result import Plan
from bbtc.tree.nodes import Tree
from tests.long_form import LONG
from tests.sharing import shared

REPOSITORY = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, order=True)
class Problem:
    """A problem of one of our domains."""

    domain: str
    name: str

    @property
    def files(self) -> tuple[str, str]:
        """The paths of the domain and the problem, from the top of the repository."""
        return f"domains/{self.domain}/domain.pddl", f"domains/{self.domain}/{self.name}.pddl"

    @property
    def strategy(self) -> str:
        """How its artefacts are planned: the paper's domain as in the paper, the others with the smallest
        trees."""
        return "refine" if self.domain == "household" else "auto"

    @property
    def switches(self) -> list[str]:
        """What to tell ``bbtc plan`` for that."""
        return ["--strategy", self.strategy]

    def __str__(self) -> str:
        return f"{self.domain}/{self.name}"


PROBLEMS = sorted(
    Problem(path.parent.name, path.stem)
    for path in (REPOSITORY / "domains").glob("*/*.pddl")
    if path.name != "domain.pddl"
)
SHORTER = [
    problem
    for problem in PROBLEMS
    if LONG
    or str(problem) not in ("bin-picking/full-tray", "building/letter-upstairs", "building/nearly-empty")
]
"""Of the worlds that move, a problem or two each; for what takes long. In the long form, all."""
DOMAINS = sorted({problem.domain for problem in PROBLEMS})


@functools.cache
def task_of(problem: Problem) -> Task:
    """The ground task."""
    sources = [read_source(str(REPOSITORY / file)) for file in problem.files]
    return compile_sources(sources, Report(), Limits())


def tree_of(problem: Problem, strategy: str | None = None) -> Tree:
    """The tree that is planned for a problem. By the problem's own strategy that is the one in its golden
    file, which ``test_golden.py`` plans anew; where facts are hidden, a saved task has its variables in
    another order, and the tree is planned here, too."""
    if strategy in {None, problem.strategy} and not task_of(problem).components:
        return _golden_tree(problem)
    return plan_of(problem, strategy).tree


@functools.cache
def _golden_tree(problem: Problem) -> Tree:
    saved = load_tree(REPOSITORY / "tests" / "golden" / str(problem) / "tree.json")
    return replace(saved, task=task_of(problem))


def plan_of(problem: Problem, strategy: str | None = None) -> Plan:
    """The plan for the problem's own target, by the problem's own strategy unless another is given: made
    once, whichever worker of the test run asks first."""
    return _plan_of(problem, strategy or problem.strategy)


@functools.cache
def _plan_of(problem: Problem, strategy: str) -> Plan:
    task = task_of(problem)
    plan = shared(
        f"{problem.domain}-{problem.name}-{strategy}",
        lambda: plan_task(task, None, strategy, Limits(), lambda _: None),
    )
    if task.components and plan.tree.task != task:  # asks about what is believed, too
        assert plan.tree.task.variables[: len(task.variables)] == task.variables
        return plan
    assert plan.tree.task == task
    return replace(plan, tree=replace(plan.tree, task=task))


def seen_tree(problem: Problem) -> Tree:
    """The tree of a problem's plan as exports have it: where facts are hidden, with a task for its runs that
    hides nothing."""
    return without_hidden(tree_of(problem), Limits())


# --- the command line ------------------------------------------------------------------------


@dataclass(frozen=True)
class Done:
    """What a command wrote, and its exit status."""

    status: int
    out: bytes
    err: str


@contextmanager
def _top_of_repository() -> Iterator[None]:
    before = Path.cwd()
    os.chdir(REPOSITORY)
    try:
        yield
    finally:
        os.chdir(before)


def bbtc(*arguments: str, stdin: bytes | None = None) -> Done:
    """Run the command line at the top of the repository, in this process."""
    # click 8.1 mixes stderr into stdout unless told; 8.2 never does and has no such option.
    apart: dict[str, Any] = (
        {"mix_stderr": False} if "mix_stderr" in inspect.signature(CliRunner).parameters else {}
    )
    runner = CliRunner(**apart)
    with _top_of_repository():
        result = runner.invoke(cli, list(arguments), input=stdin)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Done(result.exit_code, result.stdout_bytes, result.stderr)


EXPORTS = {"tree.dot": "dot", "tree.xml": "btcpp", "tree.py": "py_trees"}


def artefacts(problem: Problem, *, saved: bool = False) -> dict[str, bytes]:
    """Every artefact of a problem, by file name; ``saved``: planned from the compiled task."""
    made: dict[str, bytes] = {}

    def run(*arguments: str, stdin: bytes | None = None) -> Done:
        done = bbtc(*arguments, stdin=stdin)
        assert done.status == 0, f"bbtc {' '.join(arguments)}: exit status {done.status}\n{done.err}"
        return done

    made["task.json"] = run("compile", *problem.files).out
    source = ["-"] if saved else problem.files
    # Without the usual limit of a minute, which a busy machine may exceed.
    planned = run("plan", *source, *problem.switches, "--time-limit", "none", stdin=made["task.json"])
    made["tree.json"], made["plan.txt"] = planned.out, planned.err.encode()
    for name, form in EXPORTS.items():
        made[name] = run("export", "-", "--to", form, stdin=planned.out).out
    made["simulate.txt"] = run("simulate", "-", "--scenarios", "5", stdin=planned.out).out
    return made
