"""Three-valued conditions of a task as two-valued expressions over the cells of a program.

A cell of a task's variable holds 0 for false, 1 for unknown and 2 for true. Strong Kleene logic is
carried by two expressions for each condition: where it is true, and where it is false.
"""

from __future__ import annotations

from collections.abc import Mapping

from typing_extensions import assert_never

from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or
from bbtc.kleene import Truth
from bbtc.verifier.program import NO, YES, Compare, Expression, Literally, all_of, any_of, none_of

FALSE, UNKNOWN, TRUE = 0, 1, 2


def where_true(condition: Condition, cell_of: Mapping[int, int]) -> Expression:
    """Where the condition is true. ``cell_of`` gives the cell of each variable."""
    match condition:
        case Is(variable, Truth.TRUE):
            return Compare(cell_of[variable], "=", TRUE)
        case Is(variable, Truth.FALSE):
            return Compare(cell_of[variable], "=", FALSE)
        case Is(variable, _):
            return Compare(cell_of[variable], "=", UNKNOWN)
        case Known(variable):
            return none_of(Compare(cell_of[variable], "=", UNKNOWN))
        case And(parts):
            return all_of(*(where_true(part, cell_of) for part in parts))
        case Or(parts):
            return any_of(*(where_true(part, cell_of) for part in parts))
        case Not(part):
            return where_false(part, cell_of)
        case Constant(value):
            return Literally(value)
        case _:
            assert_never(condition)


def where_false(condition: Condition, cell_of: Mapping[int, int]) -> Expression:
    """Where the condition is false."""
    match condition:
        case Is(variable, Truth.TRUE):
            return Compare(cell_of[variable], "=", FALSE)
        case Is(variable, Truth.FALSE):
            return Compare(cell_of[variable], "=", TRUE)
        case Is(variable, _):  # a test for unknown is itself never unknown
            return none_of(Compare(cell_of[variable], "=", UNKNOWN))
        case Known(variable):
            return Compare(cell_of[variable], "=", UNKNOWN)
        case And(parts):
            return any_of(*(where_false(part, cell_of) for part in parts))
        case Or(parts):
            return all_of(*(where_false(part, cell_of) for part in parts))
        case Not(part):
            return where_true(part, cell_of)
        case Constant(value):
            return NO if value else YES
        case _:
            assert_never(condition)
