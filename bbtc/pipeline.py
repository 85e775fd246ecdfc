"""The stages in order: the only module that knows which follows which.

Each stage is imported where it runs: who checks a file needs no planner in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from bbtc.diagnostics import BbtcError, Diagnostic, LimitReached, Related, Report, Severity
from bbtc.ground.task import Task
from bbtc.limits import MOST_WORLDS, Limits
from bbtc.rounding import figure_text
from bbtc.source import AS_WRITTEN, Reading, SourceFile
from bbtc.tree.nodes import PlanStatus, Tree

if TYPE_CHECKING:
    from bbtc.backends.btcpp.reader.xml import Imported
    from bbtc.backends.exporter import Artefact
    from bbtc.belief.chain import Chain
    from bbtc.belief.simulate import Figures
    from bbtc.comparison import Comparison
    from bbtc.model.domain import Model
    from bbtc.planner.options import Options
    from bbtc.planner.result import Plan, Progress
    from bbtc.syntax.ast import Definition, Document
    from bbtc.verifier.verdict import Engine, Verdict


_HOLD_HIDDEN = {"json", "yaml"}
"""Formats that hold what is hidden."""
_RUN = {"py_trees", "py_trees_robot", "btcpp_project"}
"""Formats that run on a robot: they take a monitor along."""
_MOST_LISTED = 8  # problems that a hint names
_LAST_STEPS = 0.04
"""Of the time for planning, what is left for the steps that make a tree of what was found."""


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

    limits = limits or Limits()
    documents = []
    for source in sources:
        limits.check_time("reading")
        documents.append(parse(source, report, limits.depth))
    limits.check_time("reading")
    return tuple(documents)


def select(documents: Sequence[Document], report: Report, reading: Reading = AS_WRITTEN) -> Inputs | None:
    """The one domain and the one problem (or none) that the files hold, or that ``reading`` names; None
    and an error in the report if there is no domain, or more than one of either."""
    found: dict[str, list[Definition]] = {"domain": [], "problem": []}
    for document in documents:
        for definition in document.definitions:
            found[definition.kind].append(definition)
    names = ", ".join(document.source.name for document in documents)
    if reading.problem is not None and not _narrow(found, reading.problem, names, report):
        return None
    if not found["domain"]:
        report.error("BBT0006", f"no domain in {names}", hint="give the domain's file, too")
    for kind, definitions in found.items():
        if len(definitions) > 1:
            report.error(
                "BBT0006",
                f"more than one {kind} in {names}",
                definitions[1].name.span,
                hint=f"give exactly one {kind}" if kind == "domain" else f"name it: {_listed(definitions)}",
                related=[Related("the first one is here", definitions[0].name.span)],
            )
    if len(found["domain"]) != 1 or len(found["problem"]) > 1:
        return None
    return Inputs(found["domain"][0], found["problem"][0] if found["problem"] else None)


def _narrow(found: dict[str, list[Definition]], name: str, names: str, report: Report) -> bool:
    """Leave the problems of a name, and of several domains the one that they are for; False and an error
    where there is no such problem."""
    problems = found["problem"]
    found["problem"] = [problem for problem in problems if problem.name.key == name.lower()]
    if not found["problem"]:
        from difflib import get_close_matches

        near = get_close_matches(name.lower()[:100], [problem.name.key for problem in problems], 1)
        hint = f"did you mean `{near[0]}`?" if near else f"there is {_listed(problems)}" if problems else None
        report.error("BBT0006", f"no problem `{name[:100]}` in {names}", hint=hint)
        return False
    if len(found["domain"]) > 1:
        from bbtc.syntax.ast import DomainReference

        wanted = {s.name.key for s in found["problem"][0].sections if isinstance(s, DomainReference)}
        found["domain"] = [d for d in found["domain"] if d.name.key in wanted] or found["domain"]
    return True


def _listed(problems: Sequence[Definition]) -> str:
    """The options that choose the problems."""
    shown = ", ".join(f"--problem {problem.name.text}" for problem in problems[:_MOST_LISTED])
    return shown if len(problems) <= _MOST_LISTED else f"{shown} …"


def resolve_model(inputs: Inputs, report: Report, reading: Reading = AS_WRITTEN, *, checks: bool) -> Model:
    """Names resolved and, with ``checks``, the doubtful reported (what is only noted is left to
    ``bbtc check``). Raises :class:`BbtcError`."""
    from bbtc.analysis.check import check
    from bbtc.analysis.resolve import resolve

    model = resolve(inputs.domain, inputs.problem, report, lenient=reading.lenient)
    report.raise_errors()
    assert model is not None
    if checks:
        for diagnostic in check(model):
            if diagnostic.severity is not Severity.NOTE:
                report.add(diagnostic)
        report.raise_errors()
    return model


def check_documents(
    documents: Iterable[Document],
    report: Report,
    reading: Reading = AS_WRITTEN,
    limits: Limits | None = None,
) -> list[str]:
    """Everything that is wrong or doubtful in domains and problems, to the report. Each problem is checked
    with the domain of its name; what rests on one problem is a warning only where it holds for all of
    its domain's. What is right but cannot be grounded is noted. Whether a goal can be reached at all, and
    which facts are hidden, is told where the limits, and bounds of its own, allow to find out: the latter is
    what is returned, in lines."""
    from bbtc.analysis.check import check
    from bbtc.analysis.resolve import resolve

    definitions = [definition for document in documents for definition in document.definitions]
    domains: dict[str, Definition] = {}
    problems: list[tuple[Definition, list[Definition | None]]] = []
    for domain in (definition for definition in definitions if definition.kind == "domain"):
        problems.append((domain, []))
        first = domains.setdefault(domain.name.key, domain)
        if first is not domain:
            report.warning(
                "BBT0208",
                f"domain `{domain.name.text}` is defined twice",
                domain.name.span,
                "problems are checked with the first one",
                [Related("the first one", first.name.span)],
            )
    for problem in (definition for definition in definitions if definition.kind == "problem"):
        home = _domain_of(problem, domains)
        if home is None:
            message = f"the domain of problem `{problem.name.text}` is not among the files"
            hint = "give its file, too: without it, only the syntax is checked"
            report.add(Diagnostic("BBT0006", message, problem.name.span, hint, Severity.NOTE))
        for domain, its_problems in problems:
            if domain is home:
                its_problems.append(problem)
    hidden: list[str] = []
    for domain, its_problems in problems:
        models = []
        for each in its_problems or [None]:
            # A report of its own: the errors of one problem do not hide the checks of the next.
            own = Report()
            model = resolve(domain, each, own, lenient=reading.lenient)
            models.extend([] if model is None else [model])
            for diagnostic in own:
                report.add(diagnostic)
        doubted = []
        for model in models:
            doubts = _doubts(model, limits or Limits())
            doubted.extend([model.problem] if doubts and model.problem else [])
            for diagnostic in doubts:
                report.add(diagnostic)
        for diagnostic in check(*models, doubted=doubted) if models else ():
            report.add(diagnostic)
        for model in models:
            hidden.extend(_hidden(model, report, limits or Limits()))
    return hidden


_CHECKED_ACTIONS = 20_000
_NOT_LISTED = {"BBT0403", "BBT0404", "BBT0415", "BBT0416"}
"""What is right, but has too much hidden state to be compiled."""


def _hidden(model: Model, report: Report, limits: Limits) -> Iterator[str]:
    """What of a model cannot be grounded, as notes; which of its facts are hidden, if it is small enough to
    find out in a check."""
    from bbtc.ground.hidden.summary import hidden_summary
    from bbtc.ground.instantiate import ground
    from bbtc.ground.numbers.digits import number_faults
    from bbtc.ground.refused import refused
    from bbtc.model.hidden import has_hidden_state

    for diagnostic in number_faults(model):
        report.add(diagnostic)
    not_yet = list(refused(model))
    for diagnostic in not_yet:
        report.add(replace(diagnostic, severity=Severity.NOTE))
    if not_yet or model.problem is None or not has_hidden_state(model):
        return
    few = replace(
        limits, facts=min(limits.facts, _CHECKED_FACTS), actions=min(limits.actions, _CHECKED_ACTIONS)
    )
    try:
        yield from hidden_summary(ground(model, Report(), few))
    except BbtcError as error:  # a limit, or what is told elsewhere
        for diagnostic in error.diagnostics:
            if diagnostic.code in _NOT_LISTED:
                report.add(replace(diagnostic, severity=Severity.NOTE))
            elif diagnostic.code == "BBT0414":
                report.add(diagnostic)


_CHECKED_FACTS = 300_000
"""So many facts are derived at most to find out in a check whether a goal can be reached: a second or two."""


def _doubts(model: Model, limits: Limits) -> list[Diagnostic]:
    """What is wrong with the start or the goal of a problem, the roots of much else. What cannot be grounded,
    or not within the limits, is judged by its predicates alone."""
    from bbtc.analysis.start import hopeless, not_unknown
    from bbtc.ground.goal import goal_doubts

    few = replace(limits, facts=min(limits.facts, _CHECKED_FACTS))
    try:
        found = goal_doubts(model, few)
    except BbtcError:  # a limit, or what grounding refuses
        found = None
    return (list(hopeless(model)) if found is None else found) or list(not_unknown(model))


def _domain_of(problem: Definition, domains: dict[str, Definition]) -> Definition | None:
    from bbtc.syntax.ast import DomainReference

    wanted = next((s.name.key for s in problem.sections if isinstance(s, DomainReference)), None)
    if wanted in domains:
        return domains[wanted]
    return next(iter(domains.values())) if len(domains) == 1 else None


def format_source(source: SourceFile, limits: Limits | None = None) -> str:
    """The text in canonical layout. Raises :class:`BbtcError` for syntax errors, or ``LimitReached``."""
    from bbtc.syntax.parser import parse
    from bbtc.syntax.printer import print_document

    limits = limits or Limits()
    report = Report()
    limits.check_time("reading")
    document = parse(source, report, limits.depth)
    report.raise_errors()
    limits.check_time("the layout")
    text = print_document(document)
    # The layout must never change what a file says: a bug here must not cost anybody a domain.
    again = parse(SourceFile(source.name, text), report, limits.depth)
    if again.definitions != document.definitions or len(again.comments) != len(document.comments):
        raise AssertionError(f"the layout of {source.name} would change its meaning")
    return text


def compile_sources(
    sources: Sequence[SourceFile],
    report: Report,
    limits: Limits,
    reading: Reading = AS_WRITTEN,
    *,
    checks: bool = False,
) -> Task:
    """From text to ground task; with ``checks``, what is doubtful is reported on the way.

    Raises :class:`BbtcError` with every error found, or :class:`bbtc.diagnostics.LimitReached`.
    """
    documents = parse_all(sources, report, limits)
    report.raise_errors()
    inputs = select(documents, report, reading)
    report.raise_errors()
    assert inputs is not None
    if inputs.problem is None:
        names = ", ".join(source.name for source in sources)
        raise BbtcError.single("BBT0006", f"no problem in {names}", hint="give the problem's file, too")
    model = resolve_model(inputs, report, reading, checks=checks)
    try:
        return ground_model(model, report, limits, reading)
    except BbtcError:
        if model.goal_span is not None and any(error.code == "BBT0412" for error in report.errors):
            report.retract("BBT0304", model.goal_span)  # the error tells more
            report.raise_errors()
        raise


def task_of_sources(
    sources: Sequence[SourceFile], report: Report, limits: Limits, reading: Reading = AS_WRITTEN
) -> Task:
    """The task that files hold: one compiled task as JSON, or a domain and a problem. What is
    doubtful in the latter goes to the report. Raises :class:`BbtcError` or ``LimitReached``."""
    from bbtc.artefacts import load_task
    from bbtc.artefacts.kinds import is_artefact

    if not is_artefact(sources[0]):
        return compile_sources(sources, report, limits, reading, checks=True)
    if len(sources) > 1:
        raise BbtcError.single("BBT0006", "a compiled task stands alone", hint="leave the other file out")
    task = load_task(sources[0])
    if reading.problem is not None and reading.problem.lower() != task.problem.lower():
        message = f"no problem `{reading.problem[:100]}` in {sources[0].name}"
        raise BbtcError.single("BBT0006", message, hint=f"it holds `{task.problem}` alone")
    return task


def import_tree(
    source: SourceFile,
    others: Sequence[SourceFile],
    report: Report,
    limits: Limits,
    *,
    namespace: str = "",
    main: str | None = None,
    reading: Reading = AS_WRITTEN,
    bindings: str = "",
) -> Tree:
    """The tree of an exported BehaviorTree.CPP file or of a tree artefact, by hand edited ones too. Its
    task is that of ``others``: a domain and a problem, a compiled task, or another tree; without them
    the one a tree artefact carries. ``main`` names the BehaviorTree to read, of a file with several that
    nobody calls; ``bindings`` the file of bindings that it was exported with. The claimed figures are those
    of the exact simulation; where the file claimed others, or none, a note says so.

    Raises :class:`BbtcError` with everything that cannot be read, or ``LimitReached``.
    """
    from bbtc.artefacts import load_tree
    from bbtc.artefacts.kinds import is_artefact, is_xml
    from bbtc.backends.btcpp.bindings.read import read_bindings
    from bbtc.backends.btcpp.reader.xml import Imported, tree_from_btcpp

    if not is_xml(source) and not is_artefact(source):
        load_tree(source)  # tells what it is instead
    task = _task_for_import(others, report, limits, reading)
    if not is_xml(source):
        if main is not None:
            message = f"{source.name} holds one tree, which has no name"
            raise BbtcError.single("BBT0619", message, hint="leave --tree out")
        tree = load_tree(source, task)
        imported = Imported(tree, tree.success_probability, None)
    elif task is None:
        hint = "give its domain and problem, its compiled task, or the tree it was exported from"
        raise BbtcError.single("BBT0609", f"{source.name} carries no task", hint=hint)
    else:
        bound = read_bindings(bindings) if bindings else None
        imported = tree_from_btcpp(
            source, task, report, limits, namespace=namespace, main=main, bindings=bound
        )
    return _with_figures(imported, source, report, limits)


def _task_for_import(
    others: Sequence[SourceFile], report: Report, limits: Limits, reading: Reading
) -> Task | None:
    from bbtc.artefacts import load_tree
    from bbtc.artefacts.kinds import is_artefact, is_tree

    if not others:
        return None
    if len(others) == 1 and is_artefact(others[0]) and is_tree(others[0]):
        return load_tree(others[0]).task
    return task_of_sources(others, report, limits, reading)


def _with_figures(imported: Imported, source: SourceFile, report: Report, limits: Limits) -> Tree:
    tree = imported.tree
    success = simulate_tree(tree, limits)[0].success
    found = figure_text(success)
    if imported.claimed is None:
        message = f"{source.name} claims no success probability; it is {found}"
        report.add(Diagnostic("BBT0801", message, severity=Severity.NOTE))
    elif imported.claimed != success:
        message = f"{source.name} claims success probability {figure_text(imported.claimed)}; it is {found}"
        report.add(Diagnostic("BBT0801", message, severity=Severity.NOTE))
    if imported.told is not None and imported.told not in (imported.claimed, success):
        told = figure_text(imported.told)
        message = f"the description in {source.name} tells success probability {told}; it is {found}"
        report.add(Diagnostic("BBT0801", message, severity=Severity.NOTE))
    if success == imported.claimed:
        return tree
    if success >= tree.target:
        status: PlanStatus = "target-reached"
    else:
        status = "stuck" if tree.status == "target-reached" else tree.status
    return replace(tree, success_probability=success, status=status)


def ground_model(model: Model, report: Report, limits: Limits, reading: Reading = AS_WRITTEN) -> Task:
    """The ground task of a model with a problem. Raises :class:`BbtcError`."""
    from bbtc.ground.instantiate import ground

    task = ground(model, report, limits)
    report.raise_errors()
    if not task.components or reading.keep_hidden:
        return task
    from bbtc.belief.lowering import lowered
    from bbtc.planner.stopping import doubtful_goal

    if doubtful_goal(task):
        return task
    return lowered(task, limits)


def plan_task(
    task: Task,
    target: Fraction | None,
    strategy: str,
    limits: Limits,
    progress: Progress,
    *,
    options: Options | None = None,
    search_begins: Callable[[], None] = lambda: None,
    search_ends: Callable[[], None] = lambda: None,
) -> Plan:
    """Plan a tree; ``target`` None stands for the task's own goal probability. Where the tree falls
    short of it, the plan tells what any policy could reach. A limit or an interruption
    (``KeyboardInterrupt``) ends the search with the best tree so far, from ``search_begins`` to
    ``search_ends``, which
    are called then; what is done after that takes no longer than what was done before for this tree.

    The tree is checked against the soundness invariants before it is returned; a violation is a
    bug and raises ``AssertionError``. Raises :class:`bbtc.diagnostics.LimitReached` where the
    limits do not allow any tree at all.
    """
    from bbtc.belief.rerolled import rerolled
    from bbtc.planner.best_tree import BestTree
    from bbtc.planner.bounds import judged, unjudged
    from bbtc.planner.finish import checked
    from bbtc.planner.guard import guarded
    from bbtc.planner.options import DEFAULTS
    from bbtc.planner.strategies import run_strategy

    wanted = task.goal_probability if target is None else target
    options = options or DEFAULTS
    stopping = None
    if task.components:
        from bbtc.planner.stopping import stopping_of

        stopping = stopping_of(task, options)
    task = task if stopping is None else stopping.task
    best = BestTree(task, wanted, options.prefer == "size")
    searching = limits.but_for(_LAST_STEPS)
    plan: Plan | None = None
    try:
        search_begins()
        plan = run_strategy(
            strategy, task, wanted, limits=searching, progress=progress, options=replace(options, best=best)
        )
        plan = judged(plan, searching, options)
        search_ends()
    except LimitReached as reached:
        search_ends()
        if plan is None and best.empty:
            raise
        plan = unjudged(plan or best.plan("limit-reached", reached.diagnostics[0]), reached)
    except KeyboardInterrupt:
        search_ends()
        plan = plan or best.plan("interrupted")
    if not options.closed_world:
        plan = guarded(plan)
    if stopping is not None:
        plan = stopping.tree_of(plan, Limits(states=limits.states))
    plan, chain = checked(plan, limits)
    task = plan.tree.task
    few = Limits(states=min(limits.states, _STATES_OF_WORLDS // 4))
    found = with_worst_world(plan.tree, plan.figures, few)
    return replace(plan, figures=found, rerolled=rerolled(task, chain), chain=None)


def simulate_tree(tree: Tree, limits: Limits) -> tuple[Figures, Chain]:
    """The exact figures of a tree, and the chain they come from. Raises ``LimitReached``."""
    from bbtc.belief.chain import explore
    from bbtc.belief.simulate import figures

    chain = explore(tree.task, tree.root, limits)
    return figures(tree.task, tree.root, chain), chain


_STATES_OF_WORLDS = 20_000
"""So many states are looked at to find the worst world, after planning a quarter of them."""


def with_worst_world(tree: Tree, figures: Figures, limits: Limits) -> Figures:
    """The figures with what the tree attains in the worst world that hidden facts may make at the start, as
    far as the limits allow; else with the reason why that is not told, unless the tree always succeeds."""
    from bbtc.belief.worst_world import WorstWorld, with_worlds, worst_world

    full = with_worlds(tree.task)
    if figures.success == 1:
        worst = None if full is None else WorstWorld(figures.success, (), frozenset())
        return replace(figures, worst=worst)
    if full is None:
        hides = any(variable.hidden for variable in tree.task.variables)
        untold = "the tree does not hold the worlds of its hidden facts: give the domain and the problem, too"
        return replace(figures, worst_untold=untold) if hides else figures
    states = min(limits.states, _STATES_OF_WORLDS)
    try:
        found = worst_world(tree.task, tree.root, replace(limits, states=states))
    except LimitReached as reached:
        untold = reached.diagnostics[0].message
        if not limits.met:
            untold = f"more than {states:,} states of worlds and beliefs would have to be looked at"
        return replace(figures, worst_untold=untold)
    if found is None:
        untold = f"the hidden facts that matter to the tree have more than {MOST_WORLDS:,} worlds"
        return replace(figures, worst_untold=untold)
    return replace(figures, worst=found)


def process_text(task: Task, form: str, limits: Limits) -> str:
    """The task as a Markov decision process, in the format ``prism`` or ``jani``; in the format
    ``prism-pomdp`` of a policy that sees what the robot sees."""
    from bbtc.backends.models import jani, prism
    from bbtc.belief.hidden import refuse_hidden
    from bbtc.belief.worst_world import with_worlds

    if form == "prism-pomdp":
        return prism.partial_task_text(with_worlds(task) or task, limits)
    hint = "--emit prism-pomdp writes what a policy can do that sees what the robot sees"
    refuse_hidden(task, "written as a Markov decision process", hint)
    return prism.task_text(task) if form == "prism" else jani.task_text(task)


def compare_trees(old: Tree, new: Tree, limits: Limits) -> Comparison:
    """What changed from one tree to another, with the figures of both. Raises :class:`LimitReached`."""
    from bbtc.comparison import compare

    first, second = ((tree, simulate_tree(tree, limits)[0]) for tree in (old, new))
    return compare(first, second)


def verify_tree(tree: Tree, limits: Limits, engine: Engine = "auto") -> Verdict:
    """The figures of a tree, recomputed without the simulator and the planner. Raises
    ``LimitReached``, and :class:`BbtcError` where Storm is wanted and cannot answer."""
    from bbtc.verifier.verdict import verify

    return verify(without_hidden(tree, limits), limits, engine, tree.task if tree.task.components else None)


def without_hidden(tree: Tree, limits: Limits) -> Tree:
    """The tree with a task that does the same, but hides nothing (:mod:`bbtc.belief.tree_task`). Raises
    ``LimitReached``."""
    if not tree.task.components:
        return tree
    from bbtc.belief.tree_task import tree_task

    return replace(tree, task=tree_task(tree.task, tree.root, limits))


def with_monitor(tree: Tree, limits: Limits) -> Tree | None:
    """The tree with a monitor, and with a task that tells what is true (:mod:`bbtc.belief.monitored`); None
    where it needs none. Raises ``LimitReached``."""
    if not tree.task.components and tree.task.origin is None:
        return None
    from bbtc.belief.monitored import monitored

    return monitored(tree, limits)


def export_tree(tree: Tree, form: str, options: Mapping[str, str], limits: Limits) -> Artefact:
    """The tree in an export format, the same whether it was just planned or read from a file. Raises
    :class:`BbtcError` for an unknown format or option and for a tree the format cannot hold."""
    from bbtc.artefacts.tree_json import carried
    from bbtc.backends.registry import load_exporter, parse_options, run_exporter

    tree = carried(tree)
    exporter = load_exporter(form)
    if exporter.name not in _HOLD_HIDDEN:
        watched = with_monitor(tree, limits) if exporter.name in _RUN else None
        tree = watched or without_hidden(tree, limits)
    parsed = parse_options(exporter, options)
    reached = None
    if parsed.get("flow"):
        from bbtc.belief.chain import explore
        from bbtc.belief.simulate import flow

        reached = flow(tree.task, tree.root, explore(tree.task, tree.root, limits))
    return run_exporter(exporter, form, tree, parsed, reached)
