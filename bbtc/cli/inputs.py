"""What the positional arguments hold: PDDL text, a ground task, or a tree."""

from __future__ import annotations

from bbtc.cli.session import Session
from bbtc.diagnostics import BbtcError
from bbtc.ground.task import Task
from bbtc.limits import Limits
from bbtc.source import SourceFile
from bbtc.tree.nodes import Tree


def is_artefact(source: SourceFile) -> bool:
    """Is this JSON rather than the language? (No file of the language starts with a brace.)"""
    return source.text.lstrip()[:1] == "{"


def load_task(session: Session, paths: tuple[str, ...], limits: Limits) -> Task:
    """The task of a compiled file, or of a domain and a problem. Raises :class:`BbtcError`."""
    return task_of(session, [session.read(path) for path in paths], limits)


def task_of(session: Session, sources: list[SourceFile], limits: Limits) -> Task:
    """The task of files already read. Raises :class:`BbtcError`."""
    from bbtc.artefacts import load_task as task_from_text
    from bbtc.pipeline import compile_sources

    if is_artefact(sources[0]):
        if len(sources) > 1:
            raise BbtcError.single("BBT0006", "a compiled task stands alone", hint="leave the other file out")
        return task_from_text(sources[0])
    return compile_sources(sources, session.report, limits, checks=True)


def tree_of(source: SourceFile) -> Tree:
    """The tree of a JSON artefact. Raises :class:`BbtcError`."""
    from bbtc.artefacts import load_tree

    return load_tree(source)


def is_tree(source: SourceFile) -> bool:
    """Does the JSON artefact say that it is a tree?"""
    import json

    try:
        data = json.loads(source.text)
    except (ValueError, RecursionError):
        return False
    return isinstance(data, dict) and data.get("format") == "bbtc-tree"
