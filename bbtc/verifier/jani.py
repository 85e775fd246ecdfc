"""Programs as models of JANI (Budde et al., "JANI: Quantitative Model and Tool Interaction", 2017;
https://jani-spec.org/), version 1."""

from __future__ import annotations

from fractions import Fraction
from itertools import count
from typing import Any, TypeAlias

from typing_extensions import assert_never

from bbtc.diagnostics import BbtcError
from bbtc.rounding import too_long
from bbtc.verifier.naming import Names
from bbtc.verifier.prism import LARGEST, counted
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
)

Json: TypeAlias = Any

_PLACE = "here"


def jani_model(program: Program, names: Names) -> dict[str, Json]:
    """The model as a JSON value. Labels and rewards are transient variables, the latter assigned on
    edges; the properties ask for what ``bbtc verify`` reports."""
    writer = _Writer(program, names)
    kind = "tree" if program.kind == "dtmc" else "task"
    model: dict[str, Json] = {
        "jani-version": 1,
        "name": kind,
        "type": program.kind,
        "metadata": {"description": program.title},
    }
    if names.actions:
        model["actions"] = [{"name": name} for name in names.actions.values()]
    model["variables"] = writer.variables()
    model["properties"] = writer.properties()
    model["automata"] = [
        {
            "name": kind,
            "locations": [
                {
                    "name": _PLACE,
                    "transient-values": [
                        {"ref": label, "value": writer.expression(expression)}
                        for label, expression in program.labels
                    ],
                }
            ],
            "initial-locations": [_PLACE],
            "edges": [
                writer.edge(command, remark)
                for command, remark in zip(program.commands, names.command_remarks, strict=True)
            ],
        }
    ]
    synchronous = [{"synchronise": [name], "result": name} for name in names.actions.values()]
    model["system"] = {"elements": [{"automaton": kind}], "syncs": synchronous}
    return model


def _number(value: Fraction) -> Json:
    """The number, exactly. Raises :class:`BbtcError` for one that JSON texts have no room for."""
    if too_long(value):
        message = "a probability, cost or reward has too many digits for JANI"
        raise BbtcError.single("BBT0113", message, hint="prism writes it")
    scale = next(
        n for n in count(1) if not (_misread(n * value.numerator) or _misread(n * value.denominator))
    )
    if value.denominator == scale == 1:
        return value.numerator
    return {"op": "/", "left": scale * value.numerator, "right": scale * value.denominator}


def _misread(whole: int) -> bool:
    """Does Storm take the number for a negative one? It reads what fits into 64 bits, and into 63 not, so."""
    return LARGEST < whole <= 2 * LARGEST + 1


class _Writer:
    def __init__(self, program: Program, names: Names) -> None:
        self.program = program
        self.names = names
        self.counted = counted(program)
        self.formulas: list[Json] = []
        for formula in program.formulas:
            self.formulas.append(self.expression(formula.expression))

    def variables(self) -> list[Json]:
        cells = [
            {
                "name": name,
                "type": {"kind": "bounded", "base": "int", "lower-bound": 0, "upper-bound": cell.highest},
                "initial-value": cell.initial,
                **({"comment": remark} if remark else {}),
            }
            for name, cell, remark in zip(
                self.names.cells, self.program.cells, self.names.cell_remarks, strict=True
            )
        ]
        labels = [
            {"name": label, "type": "bool", "transient": True, "initial-value": False}
            for label, _ in self.program.labels
        ]
        rewards = [
            {"name": REWARDS[number], "type": "real", "transient": True, "initial-value": 0}
            for number in self.counted
        ]
        return [*cells, *labels, *rewards]

    def properties(self) -> list[Json]:
        def ask(name: str, values: Json) -> Json:
            states = {"op": "initial"}
            return {
                "name": name,
                "expression": {"op": "filter", "fun": "values", "values": values, "states": states},
            }

        if self.program.kind == "mdp":
            return [ask("goal", {"op": "Pmax", "exp": {"op": "F", "exp": "goal"}})]
        asked = [
            ask(label, {"op": "Pmin", "exp": {"op": "F", "exp": label}})
            for label in ("success", "failure", "blocked")
        ]
        return asked + [
            ask(
                f"expected-{REWARDS[number]}",
                {"op": "Emin", "exp": REWARDS[number], "accumulate": ["steps"], "reach": "finished"},
            )
            for number in self.counted
        ]

    def edge(self, command: Command, remark: str) -> Json:
        edge: dict[str, Json] = {"location": _PLACE}
        if command.action is not None:
            edge["action"] = self.names.actions[command.action]
        if remark:
            edge["comment"] = remark
        edge["guard"] = {"exp": self.expression(command.guard)}
        earned = [
            {"ref": REWARDS[number], "value": value}
            for number in self.counted
            if (value := self.reward(command, number))
        ]
        edge["destinations"] = [self.destination(branch, earned) for branch in command.branches]
        return edge

    def reward(self, command: Command, number: int) -> Json:
        """The expectation of a reward over the branches, in terms of the state before; 0 for none."""
        total: Json = _number(command.reward(number))
        for when, amount in command.charges(number).items():
            added = {"op": "ite", "if": self.expression(when), "then": _number(amount), "else": 0}
            total = {"op": "+", "left": total, "right": added} if total else added
        return total

    def destination(self, branch: Branch, earned: list[Json]) -> Json:
        destination: dict[str, Json] = {"location": _PLACE}
        if branch.probability != 1:
            destination["probability"] = {"exp": _number(branch.probability)}
        assignments = [*(self.assignment(update) for update in branch.updates), *earned]
        if assignments:
            destination["assignments"] = assignments
        return destination

    def assignment(self, update: Update) -> Json:
        name = self.names.cells[update.cell]
        value: Json = name
        match update:
            case Increment():
                value = {"op": "+", "left": name, "right": 1}
            case Count(_, _, count_cases):
                for condition, kind, amount in reversed(count_cases):
                    new: Json = update.assigned(amount) if kind == "assign" else self.sum(update, amount)
                    if condition == YES:
                        value = new
                    else:
                        value = {"op": "ite", "if": self.expression(condition), "then": new, "else": value}
            case Choose(_, cases):
                for condition, number in reversed(cases):
                    if condition == YES:
                        value = number
                    else:
                        value = {"op": "ite", "if": self.expression(condition), "then": number, "else": value}
            case _:
                assert_never(update)
        return {"ref": name, "value": value}

    def sum(self, update: Count, amount: int) -> Json:
        """A cell and an amount, no further than to the bounds."""
        total: Json = self.names.cells[update.source]
        if amount > 0:
            total = {"op": "min", "left": {"op": "+", "left": total, "right": amount}, "right": update.most}
        elif amount < 0:
            total = {"op": "max", "left": {"op": "-", "left": total, "right": -amount}, "right": 0}
        return {"op": "+", "left": total, "right": update.shift} if update.shift else total

    def expression(self, expression: Expression) -> Json:
        match expression:
            case Compare(cell, relation, number):
                return {"op": relation, "left": self.names.cells[cell], "right": number}
            case AllOf(parts):
                return self.joined("∧", parts)
            case AnyOf(parts):
                return self.joined("∨", parts)
            case Negation(part):
                return {"op": "¬", "exp": self.expression(part)}
            case Literally(value):
                return value
            case Use(formula):
                return self.formulas[formula]
            case _:
                assert_never(expression)

    def joined(self, operator: str, parts: tuple[Expression, ...]) -> Json:
        """Operators of JANI take two operands: a balanced tree, so that it stays flat."""
        if len(parts) == 1:
            return self.expression(parts[0])
        half = len(parts) // 2
        return {
            "op": operator,
            "left": self.joined(operator, parts[:half]),
            "right": self.joined(operator, parts[half:]),
        }
