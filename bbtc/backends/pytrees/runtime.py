"""The classes and functions of :mod:`bbtc.runtime` in a generated module: copied, or imported.

Which of them a module needs, and which imports they need in turn, is read from their source, so that
a module holds what it uses and nothing else.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from types import MappingProxyType

from bbtc.backends.exporter import Option
from bbtc.backends.pytrees.pycode import WIDTH
from bbtc.markov import reachable

RUNTIME = Option(
    "runtime",
    "embedded",
    "where its classes come from: copied into the file, or imported from the package bbtc",
    ("embedded", "imported"),
)

MODULES = ("nodes", "world", "beliefs", "monitor", "moving", "numbers", "limits")
"""The modules of :mod:`bbtc.runtime`."""


@dataclass(frozen=True, slots=True)
class _Definition:
    """A class, a function or an assignment of a module, and the names it refers to."""

    module: str
    lines: tuple[str, ...]
    uses: frozenset[str]
    assignment: bool


@dataclass(frozen=True, slots=True)
class _Source:
    """All definitions in their order, and where imported names come from (None: it is a module)."""

    definitions: Mapping[str, _Definition]
    imports: Mapping[str, str | None]


def used_in(lines: Iterable[str]) -> set[str]:
    """The names that a piece of code refers to."""
    return set(_names(ast.parse("\n".join(lines))))


def defined(names: Iterable[str]) -> set[str]:
    """Those of the names that :mod:`bbtc.runtime` defines."""
    return set(names) & _source().definitions.keys()


def needed(names: Iterable[str]) -> set[str]:
    """The names, and all names that their definitions refer to, directly or not."""
    definitions = _source().definitions
    return reachable(names, lambda name: definitions[name].uses if name in definitions else ())


def copied(module: str, names: set[str]) -> list[list[str]]:
    """The definitions of a module that have these names, as they stand there: blocks of lines, one
    for each class, function, and run of assignments."""
    blocks: list[list[str]] = []
    after_assignment = False
    for name, definition in _source().definitions.items():
        if definition.module == module and name in names:
            if definition.assignment and after_assignment:
                blocks[-1] += definition.lines
            else:
                blocks.append(list(definition.lines))
            after_assignment = definition.assignment
    return blocks


def imports(names: set[str], *more: tuple[str, Iterable[str]]) -> list[str]:
    """The imports at the top of a module that refers to these names, in the order of isort: the
    future, the standard library, others. ``more`` are further modules and what to import from them."""
    wanted: dict[str, set[str]] = {}
    plain: list[str] = []
    for name, module in _source().imports.items():
        if name in names:
            if module is None:
                plain.append(f"import {name}")
            else:
                wanted.setdefault(module, set()).add(name)
    for module, extra in more:
        wanted.setdefault(module, set()).update(extra)
    others = sorted(module for module in wanted if module.partition(".")[0] in ("bbtc", "py_trees"))
    standard = sorted(wanted.keys() - set(others))
    sections = [
        ["from __future__ import annotations"],
        [*sorted(plain), *(line for module in standard for line in import_from(module, wanted[module]))],
        [line for module in others for line in import_from(module, wanted[module])],
    ]
    return [line for section in sections if section for line in ("", *section)][1:]


def import_from(module: str, names: Iterable[str]) -> list[str]:
    """The import of names from a module, sorted as isort does."""
    ordered = sorted(names, key=lambda name: (not name[0].isupper(), name))
    line = f"from {module} import {', '.join(ordered)}"
    if len(line) <= WIDTH:
        return [line]
    return [f"from {module} import (", *(f"    {name}," for name in ordered), ")"]


@cache
def _source() -> _Source:
    definitions: dict[str, _Definition] = {}
    imported: dict[str, str | None] = {}
    for module in MODULES:
        text = (resources.files("bbtc") / "runtime" / f"{module}.py").read_text(encoding="utf-8")
        lines = text.splitlines()
        for statement in ast.parse(text).body:
            match statement:
                case ast.Import(names=aliases):
                    imported.update((alias.name, None) for alias in aliases)
                case ast.ImportFrom(module=str(origin), names=aliases):
                    if origin != "__future__" and not origin.startswith("bbtc."):
                        imported.update((alias.name, origin) for alias in aliases)
                case ast.ClassDef(name=name) | ast.FunctionDef(name=name):
                    definitions[name] = _definition(module, lines, statement)
                case ast.Assign(targets=[ast.Name(id=name)]):
                    definitions[name] = _definition(module, lines, statement)
                case _:
                    assert isinstance(statement, ast.Expr), "only what can be copied stands there"
    return _Source(MappingProxyType(definitions), MappingProxyType(imported))


def _definition(module: str, lines: list[str], statement: ast.stmt) -> _Definition:
    first = statement.lineno
    if isinstance(statement, ast.ClassDef | ast.FunctionDef) and statement.decorator_list:
        first = statement.decorator_list[0].lineno
    return _Definition(
        module,
        tuple(lines[first - 1 : statement.end_lineno]),
        frozenset(_names(statement)),
        isinstance(statement, ast.Assign),
    )


def _names(node: ast.AST) -> Iterator[str]:
    return (each.id for each in ast.walk(node) if isinstance(each, ast.Name))
