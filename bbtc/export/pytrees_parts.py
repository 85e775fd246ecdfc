"""What generated py_trees modules share: conditions, methods and texts as code."""

from __future__ import annotations

from collections.abc import Callable

from typing_extensions import assert_never

from bbtc.export.interface import Leaf
from bbtc.export.pycode import Code, call, flat, layout, literal
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


def method(name: str, leaf: Leaf, result: str, *body: str) -> list[str]:
    """A method of a robot for a leaf, after an empty line; ``body`` is its lines, not indented."""
    parameters = ["self", *(f"{parameter}: str" for parameter in leaf.parameters)]
    head = layout(call(f"def {name}", *parameters), suffix=f" -> {result}:", level=1)
    return ["", *head, *(f"        {line}" for line in body)]


def condition_type(leaf: Leaf) -> str:
    """What the method of a condition returns."""
    return "bool | None" if leaf.three_valued else "bool"


def condition_summary(leaf: Leaf) -> str:
    """The docstring of the method of a condition."""
    unknown = "; None where that is unknown" if leaf.three_valued else ""
    return f'"""Whether {_signature(leaf)} holds{unknown}."""'


def action_summary(leaf: Leaf) -> str:
    """The docstring of the method of an action."""
    return f'"""Start or continue {_signature(leaf)}."""'


def fact_of(leaf: Leaf) -> list[str]:
    """The name of a leaf and its parameters, as arguments of a call."""
    return [literal(leaf.symbol.name), *leaf.parameters]


def _signature(leaf: Leaf) -> str:
    return f"{harmless(leaf.symbol.name)}({', '.join(leaf.parameters)})"


def harmless(text: str) -> str:
    """The text for a docstring: what could end one, or begin an escape in it, becomes a question
    mark, and it is cut."""
    return "".join(c if c.isascii() and c.isprintable() and c not in '"\\' else "?" for c in text[:100])
