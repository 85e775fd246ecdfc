"""Making the artefacts of one tree, in memory: no files are read or written here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal, TypeAlias

from bbtc import pipeline
from bbtc.artefacts import dumps, load_tree, tree_to_json
from bbtc.artefacts.numbers import exact
from bbtc.backends.exporter import Begun, Files
from bbtc.diagnostics import BbtcError, Diagnostic, Report
from bbtc.exit_status import OF_TREE, ExitStatus
from bbtc.files.read_write import system_trouble
from bbtc.files.sources import decode_source
from bbtc.limits import PLANNING_SECONDS, Limits
from bbtc.manifest.entries import Export, TreeEntry
from bbtc.manifest.measured import Measured
from bbtc.planner.options import Options
from bbtc.planner.result import Plan
from bbtc.source import SourceFile
from bbtc.tree.deep import stack_room
from bbtc.tree.nodes import Tree, walk
from bbtc.watch import Watch, watching

TREE = "tree"
FIGURES = "figures"

Failure: TypeAlias = Literal["error", "limit", "internal"]


def export_step(name: str) -> str:
    """The name of the step that makes an export."""
    return f"export:{name}"


@dataclass(frozen=True, slots=True)
class Job:
    """What to make for a tree. ``sources`` are the contents of its inputs with the names that messages give
    them, which may be left out where nothing reads them; ``tree`` is its artefact where that is up to date;
    ``exports`` are those that are not."""

    entry: TreeEntry
    sources: tuple[tuple[str, bytes], ...]
    tree: bytes | None
    figures: bool
    exports: tuple[Export, ...]


@dataclass(frozen=True, slots=True)
class Made:
    """What came of a job: by step, the content of the files, by path; ``begun`` are those that people fill in
    (:class:`bbtc.backends.registry.Begun`). ``unmet`` tells, by number, which
    expectations are not met, and what is the case; ``short`` why the target is not reached."""

    name: str
    steps: Mapping[str, Mapping[str, bytes]] = field(default_factory=dict)
    diagnostics: tuple[Diagnostic, ...] = ()
    short: str | None = None
    unmet: tuple[tuple[int, str], ...] = ()
    failure: Failure | None = None
    summary: str | None = None
    begun: frozenset[str] = frozenset()


def perform(job: Job) -> Made:
    """Make what the job asks for. Whatever is wrong is part of the result; only an interruption is raised
    (``KeyboardInterrupt``)."""
    report = Report()
    try:
        return _perform(job, report)
    except BbtcError as error:
        found = [*report, *(d for d in error.diagnostics if d not in list(report))]
        failure: Failure = "limit" if error.exit_status is ExitStatus.LIMIT else "error"
        return Made(job.entry.name, diagnostics=tuple(found), failure=failure)
    except Exception as error:  # noqa: BLE001 - a bug met in one tree must not lose the others
        trouble = system_trouble(error)
        if trouble is not None:
            found = [*report, Diagnostic("BBT0004", f"cannot write a temporary file: {trouble}")]
            return Made(job.entry.name, diagnostics=tuple(found), failure="error")
        return broken(job.entry.name, f"{type(error).__name__}: {error}")


def broken(name: str, why: str) -> Made:
    """The result of a job that ended by a bug."""
    message = f"internal error while building '{name}': {why}"
    hint = "this is a bug in bbtc, not in your input; please report it"
    return Made(name, diagnostics=(Diagnostic("BBT1006", message, hint=hint),), failure="internal")


def _perform(job: Job, report: Report) -> Made:
    limits = Limits(**{"seconds": PLANNING_SECONDS, **dict[str, Any](job.entry.limits)})
    with stack_room(), watching(limits) as (watch, watched):
        return _steps(job, report, watch, watched)


def _steps(job: Job, report: Report, watch: Watch, limits: Limits) -> Made:
    entry = job.entry
    steps: dict[str, dict[str, bytes]] = {}
    text = job.tree
    if text is None:
        plan = _plan(job, report, limits, watch)
        tree = plan.tree
        if tree.success_probability < tree.target:
            failure: Failure = "error" if OF_TREE[tree.status] is ExitStatus.ERRORS else "limit"
            return Made(entry.name, diagnostics=tuple(report), short=_shortfall(plan), failure=failure)
        text = dumps(tree_to_json(tree)).encode()
        steps[TREE] = {entry.file: text}
        limits = watch.over(limits.afresh())  # planning may have used all of the time
    # Exports are made of the artefact, as it will be read by others.
    tree = load_tree(SourceFile(entry.file, text.decode()))
    unmet: list[tuple[int, str]] = []
    if job.figures:
        figures, _ = pipeline.simulate_tree(tree, limits)
        measured = Measured(
            tree, figures, lambda: _whole(job, text, limits), entry.perturb or Fraction(0), limits
        )
        found = [expectation.unmet(measured) for expectation in entry.expect]
        unmet = [(number, why) for number, why in enumerate(found) if why is not None]
        steps[FIGURES] = {}
    if unmet:
        return Made(entry.name, {}, tuple(report), unmet=tuple(unmet), failure="error")
    begun: set[str] = set()
    for export in job.exports:
        files = _export(tree, export, limits)
        begun |= {path for path, text in files.items() if isinstance(text, Begun)}
        steps[export_step(export.name)] = {path: _bytes(text) for path, text in files.items()}
    return Made(entry.name, steps, tuple(report), summary=_summary(tree), begun=frozenset(begun))


def _whole(job: Job, text: bytes, limits: Limits) -> Tree:
    """The tree of an artefact on the task that it was planned for, which knows actions that the tree does
    not."""
    sources = [decode_source(name, data) for name, data in job.sources]
    task = pipeline.task_of_sources(sources, Report(), limits, job.entry.reading)
    return load_tree(SourceFile(job.entry.file, text.decode()), task)


def _plan(job: Job, report: Report, limits: Limits, watch: Watch) -> Plan:
    entry = job.entry
    sources = [decode_source(name, data) for name, data in job.sources]
    task = pipeline.task_of_sources(sources, report, limits, entry.reading)
    options = Options(entry.max_actions, entry.retries, entry.prefer, entry.closed_world)
    plan = pipeline.plan_task(
        task, entry.target, entry.strategy, limits, lambda _: None, options=options, search_ends=watch.off
    )
    if plan.tree.status == "interrupted":
        raise KeyboardInterrupt
    return plan


def _export(tree: Tree, export: Export, limits: Limits) -> dict[str, str | bytes]:
    made = pipeline.export_tree(tree, export.form, dict(export.options), limits)
    if isinstance(made, Files):
        return {f"{export.file}/{name}": text for name, text in made.texts.items()}
    return {export.file: made}


def _bytes(text: str | bytes) -> bytes:
    return text.encode() if isinstance(text, str) else text


def _summary(tree: Tree) -> str:
    nodes = sum(1 for _ in walk(tree.root))
    return f"success {exact(tree.success_probability)}, {nodes} nodes"


def _shortfall(plan: Plan) -> str:
    """Why the best tree falls short of the target."""
    tree = plan.tree
    best = f"the best tree found succeeds with probability {exact(tree.success_probability)}"
    match tree.status:
        case "out-of-reach":
            why = f"no policy can; {best}"
        case "limit-reached" if plan.stop is not None:
            why = f"{plan.stop.message}; {best}"
        case _:
            why = best
    return f"the target {exact(tree.target)} is not reached: {why}"
