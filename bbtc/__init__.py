"""Compiler from probabilistic, three-valued planning domains to belief behavior trees.

The functions of :mod:`bbtc.api` stand here, imported when they are used. Some of them, such as
:func:`plan`, share their names with subpackages: those modules are made callable.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import MappingProxyType, ModuleType

from bbtc.version import __version__

TYPE_CHECKING = False  # to checkers it is true; the module `typing` takes its time to load
if TYPE_CHECKING:
    from typing import Any

    from bbtc.api import (
        bounds,
        build,
        check,
        compile,  # noqa: A004 - the name of the command
        diff,
        dumps,
        explain,
        export,
        format_text,
        import_tree,
        init,
        load,
        load_tree,
        plan,
        run,
        scenarios,
        simulate,
        verify,
    )
    from bbtc.belief.simulate import Figures
    from bbtc.diagnostics import BbtcError, Diagnostic, LimitReached, Report
    from bbtc.ground.task import Task
    from bbtc.limits import Limits
    from bbtc.model.domain import Model
    from bbtc.plan.result import Plan
    from bbtc.source import SourceFile
    from bbtc.tree.nodes import Tree

__all__ = [
    "BbtcError",
    "Diagnostic",
    "Figures",
    "LimitReached",
    "Limits",
    "Model",
    "Plan",
    "Report",
    "SourceFile",
    "Task",
    "Tree",
    "__version__",
    "bounds",
    "build",
    "check",
    "compile",
    "diff",
    "dumps",
    "explain",
    "export",
    "format_text",
    "import_tree",
    "init",
    "load",
    "load_tree",
    "plan",
    "run",
    "scenarios",
    "simulate",
    "verify",
]

_HOMES = MappingProxyType(
    {
        "BbtcError": "diagnostics",
        "Diagnostic": "diagnostics",
        "Figures": "belief.simulate",
        "LimitReached": "diagnostics",
        "Limits": "limits",
        "Model": "model.domain",
        "Plan": "plan.result",
        "Report": "diagnostics",
        "SourceFile": "source",
        "Task": "ground.task",
        "Tree": "tree.nodes",
    }
)
"""The modules of what does not stand in ``api``."""

_NAMESAKES = ("build", "export", "plan", "verify")
"""Functions of ``api`` that are subpackages, too."""


class _Namesake(ModuleType):
    """A subpackage that can be called like the function of its name."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function; see :mod:`bbtc.api`."""
        function = getattr(import_module("bbtc.api"), self.__name__.rpartition(".")[2])
        return function(*arguments, **options)


class _Package(ModuleType):
    """This package: a namesake becomes callable as soon as it is imported, by whomever."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in _NAMESAKES and isinstance(value, ModuleType):
            value.__class__ = _Namesake
        super().__setattr__(name, value)


if not TYPE_CHECKING:  # a checker shall see only what is named above

    def __getattr__(name: str) -> object:
        if name in _NAMESAKES:
            return import_module(f"bbtc.{name}")
        if name in __all__:
            return getattr(import_module(f"bbtc.{_HOMES.get(name, 'api')}"), name)
        raise AttributeError(f"module 'bbtc' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Package
