"""The JSON artefacts: ground tasks and trees as text, and back. What is only written (figures, verdicts, the
stages of a compilation) stands in modules that are imported where it is: it rests on much more."""

from __future__ import annotations

from bbtc.artefacts.jsontext import dumps, loads
from bbtc.artefacts.numbers import figure_text, given_text, parse_number
from bbtc.artefacts.task_json import task_from_json, task_to_json
from bbtc.artefacts.tree_json import tree_from_json, tree_to_json
from bbtc.ground.task import Task
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree

__all__ = [
    "dumps",
    "figure_text",
    "given_text",
    "load_task",
    "load_tree",
    "loads",
    "parse_number",
    "task_from_json",
    "task_to_json",
    "tree_from_json",
    "tree_to_json",
]


def load_task(source: SourceFile) -> Task:
    """The task of a JSON text. Raises :class:`~bbtc.diagnostics.BbtcError` with the places of
    everything that is wrong."""
    return task_from_json(loads(source), source)


def load_tree(source: SourceFile, task: Task | None = None) -> Tree:
    """The tree of a JSON text, on the task it carries unless another is given. Raises
    :class:`~bbtc.diagnostics.BbtcError` with the places of everything that is wrong."""
    return tree_from_json(loads(source), task, source)
