"""From the model to the ground task: :func:`ground`."""

from __future__ import annotations

from bbtc.collector import collector_paused
from bbtc.diagnostics import Report
from bbtc.ground import task as gt
from bbtc.ground.hidden.compile import hidden_task
from bbtc.ground.numbers.digits import with_digits
from bbtc.ground.pruning.prune import prune
from bbtc.ground.pruning.relevance import Relevance
from bbtc.ground.reachability.atoms import Atoms
from bbtc.ground.task_builder import TaskBuilder, goal_of, reached_from
from bbtc.limits import Limits
from bbtc.model import domain as md
from bbtc.model.hidden import has_hidden_state


def ground(model: md.Model, report: Report, limits: Limits) -> gt.Task:
    """The ground task of a model: reachable and relevant, static facts folded away.

    Raises :class:`bbtc.diagnostics.BbtcError` with everything in ``report`` where the model cannot
    be grounded or its goal is unreachable even if nothing were ever undone, and
    :class:`bbtc.diagnostics.LimitReached` at a limit.
    """
    model = with_digits(model, report)
    report.raise_errors()
    if has_hidden_state(model):
        return hidden_task(model, report, limits)
    if model.templates:
        return prune(instantiate(model, report, limits))
    with collector_paused():
        begin, reached = reached_from(model, report, limits)
        atoms = Atoms(reached)
        goal = goal_of(model, atoms, report, limits)
        relevance = Relevance(atoms, goal, reached.actions, limits)
        limits.check_time("grounding")
        builder = TaskBuilder(Atoms(reached, relevance.keep()), report, begin, limits)
        rows = relevance.rows()
        del relevance
        return builder.task(rows)


def instantiate(model: md.Model, report: Report, limits: Limits) -> gt.Task:
    """:func:`ground` without leaving out what cannot matter to the goal: every action that can apply
    and do something, or that a template calls."""
    model = with_digits(model, report)
    report.raise_errors()
    with collector_paused():
        begin, reached = reached_from(model, report, limits)
        builder = TaskBuilder(Atoms(reached), report, begin, limits)
        return builder.task(reached.actions)
