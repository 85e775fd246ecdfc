"""Compiler from probabilistic, three-valued planning domains to belief behavior trees.

The functions of :mod:`bbtc.api` stand here, imported when they are used.
"""

from __future__ import annotations

from importlib import import_module
from types import MappingProxyType

from bbtc.version import __version__

TYPE_CHECKING = False  # to checkers it is true; the module `typing` takes its time to load
if TYPE_CHECKING:
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
        perturb,
        plan,
        recovery,
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
    from bbtc.planner.result import Plan
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
    "perturb",
    "plan",
    "recovery",
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
        "Plan": "planner.result",
        "Report": "diagnostics",
        "SourceFile": "source",
        "Task": "ground.task",
        "Tree": "tree.nodes",
    }
)
"""The modules of what does not stand in ``api``."""

if not TYPE_CHECKING:  # a checker shall see only what is named above

    def __getattr__(name: str) -> object:
        if name in __all__:
            return getattr(import_module(f"bbtc.{_HOMES.get(name, 'api')}"), name)
        raise AttributeError(f"module 'bbtc' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
