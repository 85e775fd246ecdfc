"""What generated py_trees modules share: conditions, methods and texts as code."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from typing_extensions import assert_never

from bbtc.backends.interface import Leaf
from bbtc.backends.pytrees.pycode import Code, call, flat, layout, literal
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within
from bbtc.ground.describe import bounds, digit_of
from bbtc.ground.task import Variable
from bbtc.kleene import Truth


class ConditionCode:
    """Writes conditions in normal form as Python expressions with the values True, False, None, and
    remembers in :attr:`used` which helper functions they call."""

    def __init__(self, variables: Sequence[Variable] = ()) -> None:
        self.used: set[str] = set()
        self._variables = variables

    def write(self, condition: Condition, read: Callable[[int], Code]) -> Code:
        """The expression; ``read`` writes the access to a variable, and to a number by its first digit."""
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
            case Within(digits, low, high):
                least, most = bounds(self._variables, digits, low, high)
                digit = digit_of(self._variables, digits)
                ends = [str(least) if low else "None", str(most) if most < digit.high else "None"]
                return self._helper("between", read(digits[0]), *ends)
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


CONDITION_TYPE = "bool | None"
"""What the method of a condition returns, also where the domain leaves nothing unknown: a robot may know
less, and then the tree starts nothing that needs to know."""


_CONDITION, _ACTION, _UNKNOWN = "Whether ", "Start or continue ", "; None where that is unknown"
_NUMBER = "The value of "


def condition_type(leaf: Leaf) -> str:
    """What the method of a condition, or of a number, returns."""
    return "int | None" if leaf.counts else CONDITION_TYPE


def condition_summary(leaf: Leaf) -> str:
    """The docstring of the method of a condition, or of a number."""
    if leaf.counts:
        return f'"""{_NUMBER}{_signature(leaf)}{_UNKNOWN}."""'
    return f'"""{_CONDITION}{_signature(leaf)} holds{_UNKNOWN if leaf.three_valued else ""}."""'


def action_summary(leaf: Leaf) -> str:
    """The docstring of the method of an action."""
    return f'"""{_ACTION}{_signature(leaf)}."""'


def is_summary(text: str) -> bool:
    """Is this the docstring of a condition or an action?"""
    return text.startswith((_CONDITION, _ACTION, _NUMBER))


def can_be_unknown(summary: str) -> bool:
    """Is this the docstring of a condition that can be unknown?"""
    return summary.startswith(_CONDITION) and summary.endswith(f"{_UNKNOWN}.")


def fact_of(leaf: Leaf) -> list[str]:
    """The name of a leaf and its parameters, as arguments of a call."""
    return [literal(leaf.symbol.name), *leaf.parameters]


def fact_tuple(variable: Variable) -> str:
    """A fact as a tuple of its predicate and its arguments; for a digit, its number."""
    if variable.digit is not None:
        return words_tuple((variable.digit.function, *variable.args))
    return words_tuple((variable.predicate, *variable.args))


def words_tuple(words: tuple[str, ...]) -> str:
    """A tuple of texts."""
    return f"({', '.join(map(literal, words))}{',' if len(words) == 1 else ''})"


def _signature(leaf: Leaf) -> str:
    return f"{harmless(leaf.symbol.name)}({', '.join(leaf.parameters)})"


def harmless(text: str) -> str:
    """The text for a docstring: what could end one, or begin an escape in it, becomes a question
    mark, and it is cut."""
    return "".join(c if c.isascii() and c.isprintable() and c not in '"\\' else "?" for c in text[:100])
