"""Identifiers for the parts of a program that is written as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bbtc.verifier.program import Program


@dataclass(frozen=True, slots=True)
class Names:
    """Identifiers of the cells and formulas, by index, and of the actions, by ground name, all
    different; comments of one line for the cells and commands, by index (empty: none)."""

    cells: tuple[str, ...]
    formulas: tuple[str, ...]
    actions: Mapping[str, str]
    cell_remarks: tuple[str, ...]
    command_remarks: tuple[str, ...]


def numbered(program: Program) -> Names:
    """Names that tell nothing, for programs that only a solver reads."""
    actions = dict.fromkeys(command.action for command in program.commands if command.action is not None)
    return Names(
        cells=tuple(f"x{number}" for number in range(len(program.cells))),
        formulas=tuple(f"f{number}" for number in range(len(program.formulas))),
        actions={action: f"a{number}" for number, action in enumerate(actions)},
        cell_remarks=("",) * len(program.cells),
        command_remarks=("",) * len(program.commands),
    )
