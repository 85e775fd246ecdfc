"""What the parts of a generated py_trees module share: conditions as code, and copied runtime."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from importlib import resources

from typing_extensions import assert_never

from bbtc.export.interface import Leaf
from bbtc.export.pycode import Code, call, flat
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or
from bbtc.kleene import Truth


class ConditionCode:
    """Writes conditions in normal form as Python expressions with the values True, False, None, and
    remembers in :attr:`used` which helper functions they call."""

    def __init__(self) -> None:
        self.used: set[str] = set()

    def write(self, condition: Condition, read: Callable[[int], Code]) -> Code:
        """The expression; ``read`` writes the access to a variable."""
        match condition:
            case Constant(value):
                return str(value)
            case Is(variable, Truth.TRUE):
                return read(variable)
            case Is(variable, Truth.FALSE):
                return self._helper("negated", read(variable))
            case Is(variable, _):
                return f"{flat(read(variable))} is None"
            case Known(variable):
                return f"{flat(read(variable))} is not None"
            case And(parts):
                return self._helper("all_of", *(self.write(part, read) for part in parts))
            case Or(parts):
                return self._helper("any_of", *(self.write(part, read) for part in parts))
            case Not(part):
                return self._helper("negated", self.write(part, read))
            case _:
                assert_never(condition)

    def _helper(self, function: str, *items: Code) -> Code:
        self.used.add(function)
        return call(function, *items)


def method_parameters(leaf: Leaf) -> list[str]:
    """The parameters of the method for a leaf, with types."""
    return ["self", *(f"{name}: str" for name in leaf.parameters)]


def runtime_source(module: str, names: Iterable[str]) -> list[list[str]]:
    """The definitions with these names, as they stand in a module of :mod:`bbtc.export.runtime`:
    blocks of lines, one for each class, function, and run of assignments."""
    wanted = set(names)
    text = (resources.files("bbtc.export") / "runtime" / f"{module}.py").read_text(encoding="utf-8")
    lines = text.splitlines()
    blocks: list[list[str]] = []
    after_assignment = False
    for statement in ast.parse(text).body:
        if _defined(statement) in wanted:
            source = lines[statement.lineno - 1 : statement.end_lineno]
            assignment = isinstance(statement, ast.Assign)
            if assignment and after_assignment:
                blocks[-1] += source
            else:
                blocks.append(source)
            after_assignment = assignment
    return blocks


def _defined(statement: ast.stmt) -> str | None:
    match statement:
        case ast.ClassDef(name=name) | ast.FunctionDef(name=name):
            return name
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name
        case _:
            return None
