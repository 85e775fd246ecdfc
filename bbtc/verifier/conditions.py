"""Three-valued conditions of a task as two-valued expressions over the cells of a program.

A cell of a task's variable holds 0 for false, 1 for unknown and 2 for true. Strong Kleene logic is
carried by two expressions for each condition: where it is true, and where it is false.
"""

from __future__ import annotations

from collections.abc import Mapping

from typing_extensions import assert_never

from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within, in_digits
from bbtc.kleene import Truth
from bbtc.verifier.program import NO, YES, Compare, Expression, Literally, all_of, any_of, none_of

FALSE, UNKNOWN, TRUE = 0, 1, 2


class Cells(dict[int, int]):
    """The cell of each variable. Of a number all digits have the same one, which holds the number, counted
    from its least value; ``numbers`` tells by digit the greatest value of that."""

    def __init__(self, numbers: Mapping[int, int]) -> None:
        super().__init__()
        self.numbers = dict(numbers)


def _between(cell: int, low: int, high: int, most: int) -> Expression:
    if low > most:
        return NO
    if low == high:
        return Compare(cell, "=", low)
    above = none_of(Compare(cell, "<", low)) if low > 0 else YES
    return all_of(above, Compare(cell, "<", high + 1) if high < most else YES)


def where_true(condition: Condition, cell_of: Mapping[int, int]) -> Expression:
    """Where the condition is true. ``cell_of`` gives the cell of each variable."""
    return _where(condition, cell_of, True)


def where_false(condition: Condition, cell_of: Mapping[int, int]) -> Expression:
    """Where the condition is false."""
    return _where(condition, cell_of, False)


def _where(condition: Condition, cell_of: Mapping[int, int], value: bool) -> Expression:
    match condition:
        case Is(variable, Truth.UNKNOWN):  # a test for unknown is itself never unknown
            unknown = Compare(cell_of[variable], "=", UNKNOWN)
            return unknown if value else none_of(unknown)
        case Known(variable):
            unknown = Compare(cell_of[variable], "=", UNKNOWN)
            return none_of(unknown) if value else unknown
        case Is(variable, wanted):
            return Compare(cell_of[variable], "=", TRUE if (wanted is Truth.TRUE) == value else FALSE)
        case Within(digits, low, high):
            if not isinstance(cell_of, Cells) or digits[0] not in cell_of.numbers:
                return _where(in_digits(condition), cell_of, value)
            inside = _between(cell_of[digits[0]], low, high, cell_of.numbers[digits[0]])
            return inside if value else none_of(inside)
        case And(parts) | Or(parts):
            each = (_where(part, cell_of, value) for part in parts)
            return all_of(*each) if isinstance(condition, And) == value else any_of(*each)
        case Not(part):
            return _where(part, cell_of, not value)
        case Constant(constant):
            return Literally(constant == value)
        case _:
            assert_never(condition)
