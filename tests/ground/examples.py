"""From text to models and tasks, for the tests of grounding."""

from __future__ import annotations

from bbtc.analysis.resolve import resolve
from bbtc.diagnostics import Report
from bbtc.ground.instantiate import ground
from bbtc.ground.task import GroundAction, Task
from bbtc.limits import Limits
from bbtc.model.domain import Model
from bbtc.source import SourceFile
from bbtc.syntax.parser import parse


def model_of(text: str, report: Report | None = None) -> Model:
    """The model of a text with a domain and perhaps a problem. Raises with all errors."""
    report = report if report is not None else Report()
    document = parse(SourceFile("example.pddl", text), report)
    report.raise_errors()
    found = {definition.kind: definition for definition in document.definitions}
    model = resolve(found["domain"], found.get("problem"), report)
    report.raise_errors()
    assert model is not None
    return model


def task_of(text: str, limits: Limits | None = None) -> Task:
    """The ground task of a text."""
    report = Report()
    return ground(model_of(text, report), report, limits or Limits())


def action(task: Task, name: str) -> GroundAction:
    """A ground action by name."""
    return task.action_by_name[name]
