"""The cells of a task's variables, and the draw of the initial state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from bbtc.ground.task import NumberVariable, Task
from bbtc.verifier.conditions import Cells
from bbtc.verifier.program import YES, Branch, Cell, Command, Compare, Drafting, Expression, put

_ZERO = Fraction(0)


@dataclass(frozen=True, slots=True)
class Start:
    """``cell_of`` gives the cell of each variable that is kept; ``begun`` holds once the initial state
    is drawn, which the ``commands`` do."""

    cell_of: dict[int, int]
    begun: Expression
    commands: tuple[Command, ...]


def write_start(task: Task, kept: Sequence[int], draft: Drafting) -> Start:
    """Add the cells. Where there is one initial state, they begin with its values; else the first
    step draws them."""
    numbers = {digit: number for number in task.numbers for digit in number.digits if digit in kept}
    # Of a number, its first digit that is kept stands for it.
    kept = [each for each in kept if each not in numbers or each == numbers[each].digits[0]]
    belief: dict[tuple[int, ...], Fraction] = {}
    for state in task.initial:
        values = tuple(
            _number_in(numbers[variable], state.values)
            if variable in numbers
            else int(state.values[variable])
            for variable in kept
        )
        if state.probability:
            belief[values] = belief.get(values, _ZERO) + state.probability
    certain = next(iter(belief)) if len(belief) == 1 else (0,) * len(kept)
    cell_of = Cells({digit: number.high - number.low for digit, number in numbers.items()})
    for variable, value in zip(kept, certain, strict=True):
        if variable in numbers:
            number = numbers[variable]
            meaning = f"{number.name}, counted from {number.low}" if number.low else number.name
            cell = draft.cell(Cell("number", number.name, meaning, number.high - number.low, value))
            cell_of.update(dict.fromkeys(number.digits, cell))
            continue
        name = task.variables[variable].name
        cell_of[variable] = draft.cell(Cell("variable", name, name, 2, value))
    if len(belief) == 1:
        return Start(cell_of, YES, ())
    begun = draft.cell(Cell("control", "begun", "has the initial state been drawn?", 1))
    branches = tuple(
        Branch(
            probability,
            (*(put(cell_of[v], k) for v, k in zip(kept, values, strict=True) if k), put(begun, 1)),
            (_ZERO, _ZERO, _ZERO),
        )
        for values, probability in belief.items()
    )
    draw = Command(None, Compare(begun, "=", 0), branches, "the initial state is drawn")
    return Start(cell_of, Compare(begun, "=", 1), (draw,))


def _number_in(number: NumberVariable, values: Sequence[int]) -> int:
    """What the digits of a number say at the start."""
    return sum(1 << place for place, digit in enumerate(number.digits) if values[digit])
