"""Which module of a package imports which: by statements wherever they stand, and by names in strings.

Linters see statements only. A string may name a module as well: one handed to ``import_module``, a row of a
table of ``module:attribute``, the argument after ``-m`` of a process, or a program that a process is given as
text. Where only the beginning of a name is known (an f-string), every module whose name begins so counts.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

_LOADERS = frozenset(("import_module", "__import__"))
_NAME = re.compile(r"(\w+(?:\.\w+)+)(?::\w+)?")


class UnknownImport(Exception):
    """A module is loaded by a name that cannot be told from the text of the module that loads it."""


def sources_of(package: Path) -> dict[str, str]:
    """The text of every module of a package, by its dotted name."""
    found = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path.read_text(encoding="utf-8")
    return found


def import_graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """For every module the other modules of its package that it imports, now or ever.

    Raises :class:`UnknownImport`.
    """
    graph = {name: set(_Reader(name, sources).imports(ast.parse(text))) for name, text in sources.items()}
    return {name: found - {name} for name, found in graph.items()}


class _Reader:
    """Reads the imports of one module."""

    def __init__(self, module: str, sources: Mapping[str, str]) -> None:
        self._module = module
        self._sources = sources
        self._package = module.partition(".")[0]

    def imports(self, tree: ast.Module) -> Iterator[str]:
        """The modules that a text names."""
        told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
        named = []
        calls = []
        for node in ast.walk(tree):
            match node:
                case ast.Import(names):
                    yield from (found for each in names for found in self._known(each.name))
                case ast.ImportFrom(module, names, level):
                    if level:
                        raise UnknownImport(f"{self._module}:{node.lineno}: a relative import")
                    for each in names:
                        yield from self._known(f"{module}.{each.name}")
                case ast.Constant(str(text)) if id(node) not in told:
                    named += self._in_text(text)
                case ast.Call(func, [first, *_]) if _last_name(func) in _LOADERS:
                    calls.append(first)
                case _:
                    pass
        yield from named
        for argument in calls:
            yield from self._loaded(argument, named)

    def _known(self, name: str) -> list[str]:
        """The module that a name stands for: its own, or that of which it is an attribute."""
        while name and name not in self._sources:
            name = name.rpartition(".")[0]
        return [name] if name else []

    def _in_text(self, text: str) -> list[str]:
        """What a string names: a module, an attribute of one, or what a program imports."""
        match = _NAME.fullmatch(text)
        if match is not None:
            found = self._known(match[1])
            return found if found != [self._package] else []  # a file name or a group: `bbtc.yaml`
        if "import " not in text:
            return []
        try:
            return list(self.imports(ast.parse(text)))
        except SyntaxError:
            return []

    def _loaded(self, argument: ast.expr, named: list[str]) -> list[str]:
        """What a call loads. A variable takes its names from a table of the module."""
        match argument:
            case ast.Constant(str(name)):
                found = self._known(name) if name.partition(".")[0] == self._package else []
                if found and found != [name]:
                    raise UnknownImport(f"{self._module}:{argument.lineno}: there is no module {name}")
                return found
            case ast.JoinedStr([ast.Constant(str(start)), *_]):
                found = [name for name in self._sources if name.startswith(start)]
            case _:
                found = named
        if not found:
            raise UnknownImport(f"{self._module}:{argument.lineno}: nothing tells which modules this loads")
        return found


def _last_name(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
