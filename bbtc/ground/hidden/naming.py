"""Names for what is known of formulas."""

from __future__ import annotations

from collections.abc import Sequence

from typing_extensions import assert_never

from bbtc.ground import task as gt
from bbtc.ground.condition import And, Condition, Constant, Is, Known, Not, Or, Within
from bbtc.kleene import Truth

_LONGEST = 60


def formula_names(variables: Sequence[gt.Variable], formulas: Sequence[Condition]) -> list[str]:
    """A readable name of its own for each formula, which no predicate of the variables has."""
    taken = {variable.predicate for variable in variables}
    names = []
    for number, formula in enumerate(formulas, 1):
        name = _words(variables, formula)
        if len(name) > _LONGEST:
            name = f"formula_{number}"
        while name in taken:
            name += "_"
        taken.add(name)
        names.append(name)
    return names


def _words(variables: Sequence[gt.Variable], formula: Condition) -> str:
    match formula:
        case Is(variable, value):
            read = variables[variable]
            return ("" if value is Truth.TRUE else "not_") + "_".join((read.predicate, *read.args))
        case And(parts):
            return "_and_".join(_words(variables, part) for part in parts)
        case Or(parts):
            return "_or_".join(_words(variables, part) for part in parts)
        case Not(part):
            return "not_" + _words(variables, part)
        case Known(variable):
            return f"known_{variables[variable].predicate}"
        case Within(digits, low, high):
            return f"{low}_to_{high}_" + "_".join(variables[digit].predicate for digit in digits[:1])
        case Constant(value):
            return Truth.of(value).word
        case _:
            assert_never(formula)
