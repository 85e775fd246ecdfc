"""The stages in order: the only module that knows which follows which."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from bbtc.belief.chain import Chain, explore
from bbtc.belief.simulate import Figures, figures, flow
from bbtc.belief.soundness import violations
from bbtc.diagnostics import BbtcError, Related, Report, Severity
from bbtc.export.registry import Artefact, load_exporter, parse_options
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.model.domain import Model
from bbtc.plan.bounds import judged
from bbtc.plan.options import DEFAULTS, Options
from bbtc.plan.result import Plan, Progress
from bbtc.plan.strategies import run_strategy
from bbtc.source import SourceFile
from bbtc.syntax.ast import Definition, Document
from bbtc.tree.nodes import Tree
from bbtc.tree.validate import check_tree


@dataclass(frozen=True, slots=True)
class Inputs:
    """A domain, and the problem to solve in it, if one was given."""

    domain: Definition
    problem: Definition | None


def parse_all(
    sources: Sequence[SourceFile], report: Report, limits: Limits | None = None
) -> tuple[Document, ...]:
    """The syntax tree of every file; syntax errors of all of them go to the report."""
    from bbtc.syntax.parser import parse

    depth = (limits or Limits()).depth
    return tuple(parse(source, report, depth) for source in sources)


def select(documents: Sequence[Document], report: Report) -> Inputs | None:
    """The one domain and the one problem (or none) that the files hold; None and an error in the
    report if there is no domain, or more than one of either."""
    found: dict[str, list[Definition]] = {"domain": [], "problem": []}
    for document in documents:
        for definition in document.definitions:
            found[definition.kind].append(definition)
    names = ", ".join(document.source.name for document in documents)
    if not found["domain"]:
        report.error("BBT0006", f"no domain in {names}", hint="give the domain's file, too")
    for kind, definitions in found.items():
        if len(definitions) > 1:
            report.error(
                "BBT0006",
                f"more than one {kind} in {names}",
                definitions[1].name.span,
                hint=f"give exactly one {kind}",
                related=[Related("the first one is here", definitions[0].name.span)],
            )
    if len(found["domain"]) != 1 or len(found["problem"]) > 1:
        return None
    return Inputs(found["domain"][0], found["problem"][0] if found["problem"] else None)


def resolve_model(inputs: Inputs, report: Report, *, checks: bool) -> Model:
    """Names resolved and, with ``checks``, the doubtful reported (what is only noted is left to
    ``bbtc check``). Raises :class:`BbtcError`."""
    from bbtc.analysis.check import check
    from bbtc.analysis.resolve import resolve

    model = resolve(inputs.domain, inputs.problem, report)
    report.raise_errors()
    assert model is not None
    if checks:
        for diagnostic in check(model):
            if diagnostic.severity is not Severity.NOTE:
                report.add(diagnostic)
        report.raise_errors()
    return model


def compile_sources(
    sources: Sequence[SourceFile], report: Report, limits: Limits, *, checks: bool = False
) -> Task:
    """From text to ground task; with ``checks``, what is doubtful is reported on the way.

    Raises :class:`BbtcError` with every error found, or :class:`bbtc.diagnostics.LimitReached`.
    """
    documents = parse_all(sources, report, limits)
    report.raise_errors()
    inputs = select(documents, report)
    report.raise_errors()
    assert inputs is not None
    if inputs.problem is None:
        names = ", ".join(source.name for source in sources)
        raise BbtcError.single("BBT0006", f"no problem in {names}", hint="give the problem's file, too")
    return ground_model(resolve_model(inputs, report, checks=checks), report, limits)


def task_of_sources(sources: Sequence[SourceFile], report: Report, limits: Limits) -> Task:
    """The task that files hold: one compiled task as JSON, or a domain and a problem. What is
    doubtful in the latter goes to the report. Raises :class:`BbtcError` or ``LimitReached``."""
    from bbtc.artefacts import load_task
    from bbtc.artefacts.kinds import is_artefact

    if not is_artefact(sources[0]):
        return compile_sources(sources, report, limits, checks=True)
    if len(sources) > 1:
        raise BbtcError.single("BBT0006", "a compiled task stands alone", hint="leave the other file out")
    return load_task(sources[0])


def ground_model(model: Model, report: Report, limits: Limits) -> Task:
    """The ground task of a model with a problem. Raises :class:`BbtcError`."""
    from bbtc.ground.instantiate import ground

    task = ground(model, report, limits)
    report.raise_errors()
    return task


def plan_task(
    task: Task,
    target: Fraction | None,
    strategy: str,
    limits: Limits,
    progress: Progress,
    *,
    options: Options = DEFAULTS,
) -> Plan:
    """Plan a tree; ``target`` None stands for the task's own goal probability. Where the tree falls
    short of it, the plan tells what any policy could reach.

    The tree is checked against the soundness invariants before it is returned; a violation is a
    bug and raises ``AssertionError``. Raises :class:`bbtc.diagnostics.LimitReached` where the
    limits do not allow any tree at all.
    """
    wanted = task.goal_probability if target is None else target
    plan = run_strategy(strategy, task, wanted, limits=limits, progress=progress, options=options)
    plan = judged(plan, limits, options)
    check_tree(plan.tree)
    broken = violations(task, explore(task, plan.tree.root, Limits(states=limits.states)))
    if broken:
        raise AssertionError(f"unsound tree: {'; '.join(broken)}")
    return plan


def simulate_tree(tree: Tree, limits: Limits) -> tuple[Figures, Chain]:
    """The exact figures of a tree, and the chain they come from. Raises ``LimitReached``."""
    chain = explore(tree.task, tree.root, limits)
    return figures(tree.task, tree.root, chain), chain


def export_tree(tree: Tree, form: str, options: Mapping[str, str], limits: Limits) -> Artefact:
    """The tree in an export format. Raises :class:`BbtcError` for an unknown format or option and
    for a tree the format cannot hold."""
    exporter = load_exporter(form)
    parsed = parse_options(exporter, options)
    reached = None
    if parsed.get("flow"):
        reached = flow(tree.task, tree.root, explore(tree.task, tree.root, limits))
    return exporter.export(tree, parsed, reached)
