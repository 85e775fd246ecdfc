"""Exporter ``jani``: a tree and its task as a Markov chain in the interchange format of model checkers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from bbtc.backends.exporter import Figures, Option, OptionValue
from bbtc.backends.models.prism import FORM, readable_names, tree_program
from bbtc.ground.task import Task
from bbtc.printable import printable
from bbtc.tree.nodes import Tree
from bbtc.verifier.jani import jani_model
from bbtc.verifier.process import process_of
from bbtc.verifier.program import Program

_MOST_WRITTEN = 1_000  # JANI has no formulas: each use is written out


@dataclass(frozen=True, slots=True)
class JaniExporter:
    """The same chain as the exporter ``prism`` writes. Deterministic."""

    name: str = "jani"
    description: str = "the same Markov chain in JANI, for Storm, the Modest Toolset, Momba"
    suffix: str = ".jani"
    options: tuple[Option, ...] = (FORM,)

    def export(
        self,
        tree: Tree,
        options: Mapping[str, OptionValue],
        figures: Figures | None,  # noqa: ARG002 - of other exporters
    ) -> str:
        """The chain as JSON text."""
        return _text(tree_program(tree, options, _MOST_WRITTEN))


jani = JaniExporter()


def task_text(task: Task) -> str:
    """The decision process of a task: what any policy could do."""
    return _text(process_of(task))


def _text(program: Program) -> str:
    model = jani_model(program, readable_names(program))
    model["metadata"]["description"] = printable(program.title)
    return json.dumps(model, indent=1, ensure_ascii=False) + "\n"
