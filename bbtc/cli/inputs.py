"""What the positional arguments hold: PDDL text, a ground task, or a tree."""

from __future__ import annotations

from dataclasses import replace

from bbtc.artefacts.kinds import is_artefact, is_tree
from bbtc.cli.session import Session
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree

__all__ = ["is_artefact", "is_tree", "load_task", "task_of", "tree_of"]


def load_task(session: Session, paths: tuple[str, ...], limits: Limits, *, keep_hidden: bool = False) -> Task:
    """The task of a compiled file, or of a domain and a problem. Raises :class:`BbtcError`."""
    return task_of(session, [session.read(path) for path in paths], limits, keep_hidden=keep_hidden)


def task_of(
    session: Session, sources: list[SourceFile], limits: Limits, *, keep_hidden: bool = False
) -> Task:
    """The task of files already read. Raises :class:`BbtcError`."""
    from bbtc.pipeline import task_of_sources

    reading = replace(session.reading, keep_hidden=keep_hidden)
    task = task_of_sources(sources, session.report, limits, reading)
    session.clear()
    return task


def tree_of(source: SourceFile) -> Tree:
    """The tree of a JSON artefact. Raises :class:`BbtcError`."""
    from bbtc.artefacts import load_tree

    return load_tree(source)
