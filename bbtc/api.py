"""What the commands do, as functions: ``import bbtc``, then ``bbtc.plan("domain.pddl", "problem.pddl")``.

Wherever an input is wanted, the result of an earlier function does as well as the path of a file: a
``Model`` or a ``Task`` to plan for, a ``Plan`` or a ``Tree`` to simulate and export. A path may be a
``SourceFile``, too, for a text that is in no file. What is wrong is raised as
:class:`~bbtc.diagnostics.BbtcError`, with every diagnostic of the run; what is merely doubtful goes to
``report``, if one is given. Everything heavy is imported when it is used.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Literal, TypeAlias, overload

from bbtc.diagnostics import Diagnostic, Report
from bbtc.limits import PLANNING_SECONDS, Limits
from bbtc.source import Reading, SourceFile
from bbtc.tree import notebook

if TYPE_CHECKING:
    from pathlib import Path

    from bbtc.backends.exporter import Artefact, Files
    from bbtc.belief.scenarios import Scenario
    from bbtc.belief.simulate import Figures
    from bbtc.belief.stepper import Stepper
    from bbtc.builder.runner import BuildReport
    from bbtc.comparison import Comparison
    from bbtc.disturbance.perturbed import PerturbedRuns
    from bbtc.disturbance.recovery import Recovery
    from bbtc.ground.task import Task
    from bbtc.model.domain import Model
    from bbtc.planner.bounds import TaskValue
    from bbtc.planner.options import Prefer, Retries
    from bbtc.planner.result import Plan, Refinement
    from bbtc.tree.nodes import Tree
    from bbtc.verifier.verdict import Engine, Verdict

Source: TypeAlias = "str | os.PathLike[str] | SourceFile"
"""The path of a file, or a text with the name it is shown under."""

TextFormat: TypeAlias = Literal[
    "btcpp",
    "btcpp_palette",
    "dot",
    "jani",
    "json",
    "mermaid",
    "prism",
    "py_trees",
    "py_trees_robot",
    "svg",
    "text",
    "yaml",
]
BinaryFormat: TypeAlias = Literal["png"]
FolderFormat: TypeAlias = Literal["btcpp_project"]
"""The built-in export formats, by what :func:`export` gives back."""

Probability: TypeAlias = "Fraction | float | str"
"""An exact probability. A float stands for the decimal it prints as: 0.9 is nine tenths."""


def load(
    *sources: Source,
    problem: str | None = None,
    lenient: bool = False,
    limits: Limits | None = None,
    report: Report | None = None,
) -> Model:
    """The domain, and the problem if there is one, that files hold: names resolved, still lifted. Of several
    problems, ``problem`` names one; ``lenient`` lets names through that seem misspelt, as planners do.

    Doubts go to ``report``. Raises :class:`BbtcError` for files that cannot be read and with
    everything that is wrong in them.
    """
    from bbtc import pipeline

    report = Report() if report is None else report
    documents = pipeline.parse_all(_read(sources, limits), report, limits)
    report.raise_errors()
    reading = Reading(problem, lenient)
    inputs = pipeline.select(documents, report, reading)
    report.raise_errors()
    assert inputs is not None
    return pipeline.resolve_model(inputs, report, reading, checks=True)


def check(*sources: Source, lenient: bool = False, limits: Limits | None = None) -> list[Diagnostic]:
    """Everything that is wrong or doubtful in domains and problems, in order of their places; each
    problem is checked with the domain of its name; ``lenient`` as in :func:`load`. Raises
    :class:`BbtcError` only for files that cannot be read."""
    from bbtc import pipeline

    report = Report()
    documents = pipeline.parse_all(_read(sources, limits), report, limits)
    if not report.errors:
        pipeline.check_documents(documents, report, Reading(lenient=lenient), limits)
    return list(report)


def format_text(source: Source) -> str:
    """The text of a file in its canonical layout. Raises :class:`BbtcError` for syntax errors."""
    from bbtc import pipeline

    return pipeline.format_source(_read([source], None)[0])


def compile(  # noqa: A001 - the name of the command
    *inputs: Source | Model,
    problem: str | None = None,
    lenient: bool = False,
    limits: Limits | None = None,
    report: Report | None = None,
) -> Task:
    """The ground task of a domain and a problem (or of a model that has both), or the one that a
    compiled file holds; ``problem`` and ``lenient`` as in :func:`load`.

    Raises :class:`BbtcError` with everything that is wrong, and :class:`LimitReached`.
    """
    return _compiled(inputs, limits or Limits(), report, Reading(problem, lenient))


def plan(
    *inputs: Source | Model | Task,
    target: Probability | None = None,
    strategy: str | None = None,
    max_actions: int | None = None,
    retries: Retries = "unbounded",
    prefer: Prefer = "success",
    closed_world: bool = False,
    guarded: bool | None = None,
    allow_guess: bool = False,
    deadline: Fraction | float | str | None = None,
    problem: str | None = None,
    lenient: bool = False,
    limits: Limits | None = None,
    report: Report | None = None,
    progress: Callable[[Refinement], None] | None = None,
) -> Plan:
    """Plan a tree that reaches the goal with the target probability (default: the problem's own).

    Without ``limits``, planning takes a minute at most. ``strategy`` is ``auto`` (the default),
    ``search``, ``policy``, ``strong-cyclic``, ``refine`` or ``advised``;
    ``max_actions`` bounds the actions of every run; ``retries`` are ``unbounded``, or the ``least`` that meet
    the target; of trees that meet it, ``prefer`` those of most ``success``, least ``cost`` or least ``size``;
    in a ``closed_world`` nobody else changes anything, and what the tree reads only for that is left out
    (``guarded=False`` means the same, and ``guarded=True`` the contrary); with ``allow_guess``, a tree may
    succeed where the goal is believed, but not known; with a ``deadline`` in seconds, the target is one of
    success by then (the plan's ``tree.success_by`` has bounds of it); ``problem`` and ``lenient`` as in
    :func:`load`; ``progress`` is told each refinement as it is made.
    The plan's ``tree.status`` says whether the target was reached; falling short of it raises nothing.
    Raises :class:`BbtcError` for input that is wrong and an unknown strategy, :class:`LimitReached` where the
    limits allow no tree at all, and ``ValueError`` for a target that is no probability, and for a
    guarded tree in a closed world.
    """
    from bbtc import pipeline
    from bbtc.planner.options import Options
    from bbtc.planner.strategies import DEFAULT

    limits = limits or Limits(seconds=PLANNING_SECONDS)
    if closed_world and guarded:
        raise ValueError("in a closed world trees have no guards")
    options = Options(max_actions, retries, prefer, closed_world or guarded is False, allow_guess)
    tell = progress or (lambda _: None)
    task = _task(inputs, limits, report, Reading(problem, lenient, allow_guess))
    name = strategy or DEFAULT
    if deadline is None:
        return pipeline.plan_task(task, _exact(target), name, limits, tell, options=options)
    from bbtc.artefacts.numbers import parse_written
    from bbtc.planner.deadline.plan import plan_by

    seconds, wanted = parse_written(str(deadline)), _exact(target)
    if seconds <= 0:
        raise ValueError("a deadline is above 0 seconds")
    if max_actions is not None:
        raise ValueError("with a deadline, the number of actions cannot be bounded")
    planner = pipeline.plan_task
    found = plan_by(task, seconds, planner, wanted, limits, strategy=name, progress=tell, options=options)
    return found.plan


def bounds(
    *inputs: Source | Model | Task,
    max_actions: int | None = None,
    costs: bool = False,
    allow_guess: bool = False,
    problem: str | None = None,
    lenient: bool = False,
    limits: Limits | None = None,
    report: Report | None = None,
) -> TaskValue:
    """The best probability that any policy can reach, between an upper and a lower bound; with
    ``costs``, the least expected cost of reaching it so often, too; with ``allow_guess``, of stopping where
    the goal is true, whether or not that is known. Limits are as of :func:`plan`, and it
    raises as that does."""
    from bbtc.planner.bounds import task_value
    from bbtc.planner.options import Options

    limits = limits or Limits(seconds=PLANNING_SECONDS)
    task = _task(inputs, limits, report, Reading(problem, lenient, allow_guess))
    options = Options(max_actions=max_actions, allow_guess=allow_guess)
    return task_value(task, limits, options, costs=costs)


def load_tree(source: Source, *, limits: Limits | None = None) -> Tree:
    """The tree that ``bbtc plan`` wrote. Raises :class:`BbtcError` with everything that is wrong."""
    from bbtc.artefacts import load_tree as tree_from_text

    return tree_from_text(_read([source], limits)[0])


def dumps(value: Task | Tree | Plan) -> str:
    """The JSON artefact of a task or a tree, as ``bbtc compile`` and ``bbtc plan`` write it."""
    from bbtc import artefacts
    from bbtc.ground.task import Task

    if isinstance(value, Task):
        return artefacts.dumps(artefacts.task_to_json(value))
    return artefacts.dumps(artefacts.tree_to_json(_tree(value, None)))


def simulate(tree: Source | Tree | Plan, *, limits: Limits | None = None) -> Figures:
    """The exact figures of a tree: how probably it succeeds, why it fails, what it costs.

    Raises :class:`BbtcError` for a file that is no tree, and :class:`LimitReached`.
    """
    from bbtc import pipeline

    limits, known = limits or Limits(), _tree(tree, limits)
    return pipeline.with_worst_world(known, pipeline.simulate_tree(known, limits)[0], limits)


def perturb(
    tree: Source | Tree | Plan,
    rate: Probability,
    *,
    task: Task | None = None,
    runs: int = 10_000,
    seed: int = 0,
    max_ticks: int = 1000,
    limits: Limits | None = None,
) -> PerturbedRuns:
    """What comes of so many runs of a tree where before each tick, with probability ``rate``, a fact of the
    world changes by itself; the same seed gives the same. A tree from a file knows the actions that it uses:
    those of a ``task`` count, too, if one is given.

    Raises as :func:`simulate` does, and ``ValueError`` for a rate that is no probability, and for runs or
    ticks below 1.
    """
    from bbtc.artefacts.numbers import parse_probability
    from bbtc.disturbance.perturbed import perturbed_runs

    chance, limits = parse_probability(str(rate)), limits or Limits()
    known = _on_task(tree, task, limits)
    return perturbed_runs(known.task, known.root, chance, limits, runs=runs, seed=seed, most_ticks=max_ticks)


def recovery(
    tree: Source | Tree | Plan,
    *,
    task: Task | None = None,
    samples: int | None = None,
    seed: int = 0,
    limits: Limits | None = None,
) -> Recovery:
    """What a new tree attains from every state that actions lead to, beside the best that is possible from
    there; of more than 10,000 states, or where ``samples`` are asked for, from a uniform sample of them. A
    tree from a file knows the actions that it uses: give the ``task`` for all.

    Raises as :func:`simulate` does, and ``ValueError`` for samples below 1.
    """
    from bbtc.disturbance.recovery import recovery as recovery_of

    limits = limits or Limits()
    known = _on_task(tree, task, limits)
    return recovery_of(known.task, known.root, limits, samples=samples, seed=seed)


def scenarios(tree: Source | Tree | Plan, count: int, *, limits: Limits | None = None) -> list[Scenario]:
    """The most probable runs of a tree, at most ``count``. Raises as :func:`simulate` does."""
    from itertools import islice

    from bbtc import pipeline
    from bbtc.belief.scenarios import scenarios as runs

    limits = limits or Limits()
    return list(islice(runs(pipeline.simulate_tree(_tree(tree, limits), limits)[1], limits), count))


def verify(tree: Source | Tree | Plan, *, engine: Engine = "auto", limits: Limits | None = None) -> Verdict:
    """The figures of a tree recomputed without the simulator and the planner, by our own solver, by Storm,
    or by both (``own``, ``storm``, ``all``; ``auto``: own, and Storm if it is installed). What is not
    as the tree claims stands in the verdict's ``problems``. Raises as :func:`simulate` does, and
    :class:`BbtcError` where Storm is wanted and cannot answer."""
    from bbtc import pipeline

    return pipeline.verify_tree(_tree(tree, limits), limits or Limits(), engine)


def run(tree: Source | Tree | Plan, *, seed: int = 0, limits: Limits | None = None) -> Stepper:
    """A run of a tree in the simulated world, at its first tick: ``step()`` takes it on by a drawn outcome
    of the running action, ``step(n)`` by outcome number n (from 0), ``back()`` takes it back; ``now`` is
    the last tick, ``finished`` whether it was the last of the run. The same seed draws the same.

    Raises :class:`BbtcError` for a file that is no tree.
    """
    from bbtc.belief.stepper import Stepper

    planned = _tree(tree, limits)
    stepper = Stepper(planned.task, planned.root, seed, limits or Limits())
    stepper.start()
    return stepper


def diff(old: Source | Tree | Plan, new: Source | Tree | Plan, *, limits: Limits | None = None) -> Comparison:
    """What changed from one tree to another: figures, task, and nodes. Raises as :func:`simulate`."""
    from bbtc import pipeline

    return pipeline.compare_trees(_tree(old, limits), _tree(new, limits), limits or Limits())


def import_tree(
    file: Source,
    *task: Source,
    namespace: str = "",
    tree: str | None = None,
    bindings: str | os.PathLike[str] = "",
    problem: str | None = None,
    lenient: bool = False,
    limits: Limits | None = None,
    report: Report | None = None,
) -> Tree:
    """The tree of an exported file, also of one that was edited, as ``bbtc import`` reads it; ``task`` is its
    domain and problem (``problem`` and ``lenient`` as in :func:`load`), its compiled task, or the tree it was
    exported from; ``tree`` is the id of the BehaviorTree to read, of a file with several that nobody calls;
    ``bindings`` is the file of bindings that it was exported with. Where the file claims
    figures that the tree does not have, a note goes to ``report``. Raises :class:`BbtcError` with
    everything that cannot be read, and :class:`LimitReached`."""
    from bbtc import pipeline

    (source,), others = _read([file], limits), _read(task, limits)
    doubts, reading = Report() if report is None else report, Reading(problem, lenient)
    limits = limits or Limits()
    return pipeline.import_tree(
        source,
        others,
        doubts,
        limits,
        namespace=namespace,
        main=tree,
        reading=reading,
        bindings=os.fspath(bindings),
    )


@overload
def export(
    tree: Source | Tree | Plan, to: TextFormat, *, limits: Limits | None = None, **options: bool | int | str
) -> str: ...
@overload
def export(
    tree: Source | Tree | Plan, to: BinaryFormat, *, limits: Limits | None = None, **options: bool | int | str
) -> bytes: ...
@overload
def export(
    tree: Source | Tree | Plan, to: FolderFormat, *, limits: Limits | None = None, **options: bool | int | str
) -> Files: ...
@overload
def export(
    tree: Source | Tree | Plan, to: str, *, limits: Limits | None = None, **options: bool | int | str
) -> Artefact: ...
def export(
    tree: Source | Tree | Plan, to: str, *, limits: Limits | None = None, **options: bool | int | str
) -> Artefact:
    """The tree in an export format: text, bytes where the format is binary, or the files of a folder.
    ``options`` are those that ``bbtc export --list`` shows. Raises :class:`BbtcError` for an unknown format
    or option and for a tree that the format cannot hold."""
    from bbtc import pipeline

    texts = {
        name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in options.items()
    }
    return pipeline.export_tree(_tree(tree, limits), to, texts, limits or Limits())


def build(
    manifest: str | os.PathLike[str] | None = None,
    *names: str,
    jobs: int | None = None,
    check: bool = False,
    force: bool = False,
) -> BuildReport:
    """Build the trees of a project, or only those named, as far as they are out of date.

    ``manifest`` is the file, default: that of the current folder or the nearest one around it; ``jobs``
    are done at once. With ``check`` nothing is written, and a tree fails whose files differ from
    what would be. What is wrong with one tree is part of its outcome; raises :class:`BbtcError`
    for a manifest that is wrong.
    """
    from pathlib import Path

    from bbtc.builder.runner import build as run
    from bbtc.manifest.find import find_manifest

    file = find_manifest(Path()) if manifest is None else Path(manifest)
    return run(file, names=names, jobs=jobs, check=check, force=force)


def init(folder: str | os.PathLike[str] = ".") -> tuple[Path, ...]:
    """Make a small project to start from; the files made. Raises :class:`BbtcError` where one of them is
    there already, and then makes none."""
    from bbtc.builder.starter import make_project

    return make_project(folder)


def explain(code: str) -> str:
    """The page of a diagnostic's code, in Markdown. Raises ``KeyError`` for an unknown code."""
    from bbtc.pages import page

    return page(code)


# --- inputs ----------------------------------------------------------------------------------


def _read(sources: Sequence[Source], limits: Limits | None) -> list[SourceFile]:
    from bbtc.files.sources import read_source

    most = (limits or Limits()).file_bytes
    return [s if isinstance(s, SourceFile) else read_source(os.fspath(s), most) for s in sources]


def _compiled(
    inputs: Sequence[Source | Model], limits: Limits, report: Report | None, reading: Reading
) -> Task:
    from bbtc import pipeline
    from bbtc.model.domain import Model

    report = Report() if report is None else report
    models = [each for each in inputs if isinstance(each, Model)]
    if models:
        if len(inputs) > 1 or reading.problem is not None:
            raise TypeError("a model stands alone: it holds its domain and its problem")
        return pipeline.ground_model(models[0], report, limits, reading)
    sources = _read([each for each in inputs if not isinstance(each, Model)], limits)
    if not sources:
        raise TypeError("give a domain and a problem, or a model")
    return pipeline.task_of_sources(sources, report, limits, reading)


def _task(
    inputs: Sequence[Source | Model | Task], limits: Limits, report: Report | None, reading: Reading
) -> Task:
    from bbtc.ground.task import Task

    tasks = [each for each in inputs if isinstance(each, Task)]
    if not tasks:
        rest = [each for each in inputs if not isinstance(each, Task)]
        return _compiled(rest, limits, report, reading)
    if len(inputs) > 1 or reading.problem is not None:
        raise TypeError("a task stands alone: it holds everything there is to plan for")
    return tasks[0]


def _tree(value: Source | Task | Tree | Plan, limits: Limits | None) -> Tree:
    from bbtc.planner.result import Plan
    from bbtc.tree.nodes import Tree

    if isinstance(value, Tree):
        return value
    if isinstance(value, Plan):
        return value.tree
    if isinstance(value, str | os.PathLike | SourceFile):
        return load_tree(value, limits=limits)
    raise TypeError(f"no tree: {type(value).__name__}")


def _on_task(value: Source | Tree | Plan, task: Task | None, limits: Limits) -> Tree:
    """A tree on a task of which it uses some of the actions."""
    from bbtc.artefacts import dumps as to_text
    from bbtc.artefacts import load_tree as tree_from_text
    from bbtc.artefacts import tree_to_json

    tree = _tree(value, limits)
    if task is None or task is tree.task:
        return tree
    return tree_from_text(SourceFile("the tree", to_text(tree_to_json(tree))), task)


def _exact(value: Probability | None) -> Fraction | None:
    from bbtc.artefacts.numbers import parse_probability

    return None if value is None else parse_probability(str(value))


def _drawn(tree: Tree) -> str:
    """A tree as a picture for notebooks, laid out by ourselves: the same everywhere."""
    return export(tree, "svg", layout="bbtc")


notebook.register(_drawn)
