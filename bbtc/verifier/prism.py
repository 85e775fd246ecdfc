"""Programs as text of the PRISM language (https://www.prismmodelchecker.org/manual/)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from typing_extensions import assert_never

from bbtc.rounding import digits
from bbtc.verifier.naming import Names
from bbtc.verifier.program import (
    REWARDS,
    YES,
    AllOf,
    AnyOf,
    Branch,
    Choose,
    Command,
    Compare,
    Count,
    Expression,
    Increment,
    Literally,
    Negation,
    Program,
    Update,
    Use,
    all_of,
)

KEYWORDS = frozenset({
    "A", "bool", "C", "ceil", "clock", "const", "cos", "ctmc", "ctmdp", "double", "dtmc", "E",
    "endinit", "endinvariant", "endmodule", "endobservables", "endplayer", "endrewards", "endsystem",
    "exp", "F", "false", "filter", "floor", "formula", "func", "G", "global", "I", "init", "int",
    "invariant", "label", "log", "ma", "max", "mdp", "min", "mod", "module", "multi",
    "nondeterministic", "observable", "observables", "of", "P", "player", "Pmax", "Pmin", "pomdp",
    "popta", "pow", "prob", "probabilistic", "pta", "R", "rate", "rewards", "Rmax", "Rmin", "round",
    "S", "sin", "smg", "stochastic", "system", "true", "U", "W", "X", "xor",
})  # fmt: skip
"""Words that cannot be identifiers in PRISM or in Storm's reading of it."""
END = "endmodule"
"""The word that no identifier may hold: wherever it stands, Storm takes it for the end of the module."""
LARGEST = 2**63 - 1
"""The largest whole number that Storm reads as one."""


def prism_text(program: Program, names: Names, preamble: Sequence[str] = ()) -> str:
    """The program as text; ``preamble`` are comment lines for its top, each of one line. Rewards with
    a negative part are left out, for PRISM has none."""
    writer = _Writer(program, names)
    return "".join(f"{line}\n" for line in writer.lines(preamble))


def counted(program: Program) -> list[int]:
    """The rewards, by number, that are never negative, without the task's own where it is 0."""
    found = []
    for number, _ in enumerate(REWARDS):
        counts = REWARDS[number] != "reward" or any(
            command.reward(number) or command.charges(number) for command in program.commands
        )
        if counts and all(command.least(number) >= 0 for command in program.commands):
            found.append(number)
    return found


class _Writer:
    def __init__(self, program: Program, names: Names) -> None:
        self.program = program
        self.names = names

    def lines(self, preamble: Sequence[str]) -> Iterator[str]:
        program, names = self.program, self.names
        yield from (f"// {line}" for line in preamble)
        yield program.kind
        yield ""
        if program.kind == "pomdp":
            yield "observables"
            yield f"  {', '.join(names.cells[cell] for cell in program.observables)}"
            yield "endobservables"
            yield ""
        for name, formula in zip(names.formulas, program.formulas, strict=True):
            yield f"formula {name} = {self.expression(formula.expression)};"
        if program.formulas:
            yield ""
        yield f"module {'tree' if program.kind == 'dtmc' else 'task'}"
        for name, cell, remark in zip(names.cells, program.cells, names.cell_remarks, strict=True):
            yield f"  {name} : [0..{cell.highest}] init {cell.initial};{_comment(remark)}"
        yield ""
        for command, remark in zip(program.commands, names.command_remarks, strict=True):
            yield from self.command(command, remark)
        yield "endmodule"
        yield ""
        for label, expression in program.labels:
            yield f'label "{label}" = {self.expression(expression)};'
        for number in counted(program):
            yield ""
            yield f'rewards "{REWARDS[number]}"'
            yield from dict.fromkeys(self.rewards(number)) or ["  true : 0;"]
            yield "endrewards"

    def rewards(self, number: int) -> Iterator[str]:
        for command in self.program.commands:
            items = [(YES, command.reward(number)), *command.charges(number).items()]
            where = YES if command.action is not None else command.guard
            if all(amount >= 0 for _, amount in items):  # readers add up what stands in several lines
                lines = [
                    (self.expression(all_of(where, when)), _number(amount))
                    for when, amount in items
                    if amount
                ]
            else:
                parts = (f"({self.inner(when)} ? {_number(amount)} : 0)" for when, amount in items if amount)
                lines = [(self.expression(where), " + ".join(parts))]
            yield from (f"  [{self.label(command)}] {holds} : {added};" for holds, added in lines)

    def label(self, command: Command) -> str:
        return "" if command.action is None else self.names.actions[command.action]

    def command(self, command: Command, remark: str) -> Iterator[str]:
        if remark:
            yield f"  // {remark}"
        head = f"  [{self.label(command)}] {self.expression(command.guard)} ->"
        if len(command.branches) == 1:
            yield f"{head} {self.branch(command.branches[0])};"
            return
        yield head
        last = len(command.branches) - 1
        for number, branch in enumerate(command.branches):
            sign = ";" if number == last else " +"
            yield f"    {_number(branch.probability)} : {self.branch(branch)}{sign}"

    def branch(self, branch: Branch) -> str:
        return " & ".join(self.update(update) for update in branch.updates) or "true"

    def update(self, update: Update) -> str:
        name = self.names.cells[update.cell]
        match update:
            case Increment():
                return f"({name}'={name}+1)"
            case Count(_, source, count_cases):
                value = name
                for condition, kind, amount in reversed(count_cases):
                    new = str(update.assigned(amount)) if kind == "assign" else self.sum(update, amount)
                    value = new if condition == YES else f"{self.inner(condition)} ? {new} : {value}"
                del source
                return f"({name}'={value if value.isalnum() else f'({value})'})"
            case Choose(_, cases):
                value = name
                for condition, number in reversed(cases):
                    value = (
                        str(number) if condition == YES else f"{self.inner(condition)} ? {number} : {value}"
                    )
                return f"({name}'={value if value.isalnum() else f'({value})'})"
            case _:
                assert_never(update)

    def sum(self, update: Count, amount: int) -> str:
        """A cell and an amount, no further than to the bounds."""
        name = self.names.cells[update.source]
        total = name if not amount else f"{name}+{amount}" if amount > 0 else f"{name}-{-amount}"
        if amount > 0:
            total = f"min({total}, {update.most})"
        elif amount < 0:
            total = f"max({total}, 0)"
        return f"{total}+{update.shift}" if update.shift else total

    def expression(self, expression: Expression) -> str:
        """In PRISM ``!`` binds more tightly than ``&``, and that more than ``|``."""
        match expression:
            case Compare(cell, relation, number):
                return f"{self.names.cells[cell]}{relation}{number}"
            case AllOf(parts):
                return " & ".join(self.inner(part) for part in parts)
            case AnyOf(parts):
                return " | ".join(self.inner(part) for part in parts)
            case Negation(Compare(cell, relation, number)):
                sign = "!=" if relation == "=" else ">="
                return f"{self.names.cells[cell]}{sign}{number}"
            case Negation(part):
                return f"!{self.inner(part)}"
            case Literally(value):
                return "true" if value else "false"
            case Use(formula):
                return self.names.formulas[formula]
            case _:
                assert_never(expression)

    def inner(self, expression: Expression) -> str:
        text = self.expression(expression)
        return f"({text})" if isinstance(expression, AllOf | AnyOf) else text


def _number(value: Fraction) -> str:
    """The number, exactly as Storm reads it too: a whole number of more than 64 bits has ``.0``."""
    sign = "-" if value < 0 else ""
    whole = sign + _whole(abs(value.numerator))
    return whole if value.denominator == 1 else f"{whole}/{_whole(value.denominator)}"


def _whole(value: int) -> str:
    return digits(value) if value <= LARGEST else f"{digits(value)}.0"


def _comment(remark: str) -> str:
    return f" // {remark}" if remark else ""
