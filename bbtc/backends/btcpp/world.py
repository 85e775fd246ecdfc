"""The simulated robot of a C++ skeleton: the tables of its world, and its methods."""

from __future__ import annotations

from collections.abc import Iterable

from typing_extensions import assert_never

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.leaves import LeafWriter
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.interface import Leaf, action_symbol, variable_symbol
from bbtc.backends.names import Symbol
from bbtc.backends.world_model import actions_used, changes_of, initial_values, relevant_variables
from bbtc.ground.condition import TRUE, And, Condition, Constant, Is, Known, Not, Or
from bbtc.ground.task import Factor, Outcome
from bbtc.kleene import Truth
from bbtc.tree.nodes import Tree

_VALUES = {Truth.TRUE: "Truth::True", Truth.FALSE: "Truth::False", Truth.UNKNOWN: "Truth::Unknown"}

_HEAD = """\
// A robot that lives in a simulated world. Made by bbtc; no need to edit it.
#pragma once

#include "robot.hpp"
#include "simulated_world.hpp"

namespace ROBOT_TREE {

"""

_CLASS = """\
class SimulatedRobot : public Robot {
 public:
  SimulatedRobot(std::uint64_t seed, unsigned ticks, std::ostream* report)
      : world_(model(), seed, ticks, report) {}

  SimulatedWorld& world() { return world_; }
"""


class SimulatedRobotWriter:
    """Writes ``simulated_robot.hpp``. Facts and actions are called as leaves and ports call them."""

    def __init__(self, tree: Tree, names: BtcppNames, leaves: LeafWriter, space: str) -> None:
        self._tree = tree
        self._task = tree.task
        self._names = names
        self._leaves = leaves
        self._space = space
        self._relevant = relevant_variables(tree)
        self._number = {variable: number for number, variable in enumerate(self._relevant)}

    def header(self) -> str:
        """The text of the file."""
        lines = [cppcode.fill(_HEAD, ROBOT_TREE=self._space) + self._model()]
        lines += [_CLASS.rstrip(), *map(self._method, self._leaves.leaves())]
        lines += ["", " private:", "  SimulatedWorld world_;", "};", ""]
        return "\n".join([*lines, f"}}  // namespace {self._space}", ""])

    # --- the model ---------------------------------------------------------------------------

    def _model(self) -> str:
        variables = [self._task.variables[index] for index in self._relevant]
        facts = [cppcode.literal(self._name(variable_symbol(v), v.args)) for v in variables]
        starts = initial_values(self._task, self._relevant)
        initial = [
            _braces([f"{weight}u", _braces(_VALUES[value] for value in values)])
            for weight, values in zip(cppcode.weights(starts.values()), starts, strict=True)
        ]
        actions = [
            f"{{{cppcode.literal(self._name(action_symbol(action), action.args))},\n"
            f"           {self._factors(action.factors)}}}"
            for action in actions_used(self._tree)
        ]
        return "\n".join(
            [
                "inline const Model& model() {",
                "  static const Model all = {",
                f"      /*facts=*/{_rows(facts)},",
                f"      /*initial=*/{_rows(initial)},",
                f"      /*actions=*/{_rows(actions)}}};",
                "  return all;",
                "}",
                "",
            ]
        )

    def _name(self, symbol: Symbol, args: Iterable[str]) -> str:
        known = self._names.ids.get(symbol)
        # A fact that no leaf reads still matters to effects.
        name = known if known is not None else f"{symbol.name}/{symbol.arity}"
        values = [self._names.values[arg] for arg in args]
        return f"{name}({','.join(values)})"

    def _factors(self, factors: tuple[Factor, ...]) -> str:
        return _braces(f"Factor{{{_braces(self._outcomes(factor))}}}" for factor in factors)

    def _outcomes(self, factor: Factor) -> list[str]:
        weights = cppcode.weights(outcome.probability for outcome in factor.outcomes)
        return [
            f"Outcome{{{weight}u, {self._effects(outcome)}, {self._factors(outcome.factors)}}}"
            for weight, outcome in zip(weights, factor.outcomes, strict=True)
        ]

    def _effects(self, outcome: Outcome) -> str:
        effects = []
        for changes in changes_of(self._task, outcome):
            pairs = sorted(changes.sets.items())
            sets = _braces(f"{{{self._number[index]}, {_VALUES[value]}}}" for index, value in pairs)
            if changes.when == TRUE:
                test = "nullptr"
            else:
                test = f"[](const State& s) {{ return {self._test(changes.when)}; }}"
            if changes.sets:
                effects.append(f"Effect{{{test}, {sets}}}")
        return _braces(effects)

    def _test(self, condition: Condition) -> str:
        match condition:
            case Constant(value):
                return f"truth({str(value).lower()})"
            case Is(variable, Truth.TRUE):
                return f"s[{self._number[variable]}]"
            case Is(variable, Truth.FALSE):
                return f"negated(s[{self._number[variable]}])"
            case Is(variable, _):
                return f"is_unknown(s[{self._number[variable]}])"
            case Known(variable):
                return f"is_known(s[{self._number[variable]}])"
            case And(parts):
                return f"all_of({_braces(map(self._test, parts))})"
            case Or(parts):
                return f"any_of({_braces(map(self._test, parts))})"
            case Not(part):
                return f"negated({self._test(part)})"
            case _:
                assert_never(condition)

    # --- the robot ---------------------------------------------------------------------------

    def _method(self, leaf: Leaf) -> str:
        names = cppcode.parameters(leaf.parameters)
        inner = ' + "," + '.join(names)
        name = cppcode.literal(f"{self._names.ids[leaf.symbol]}({'' if names else ')'}")
        key = f'std::string({name}) + {inner} + ")"' if names else name
        declared = self._leaves.declaration(leaf, self._leaves.method(leaf))
        if leaf.symbol.kind == "predicate":
            value = f"world_.read({key})" if leaf.three_valued else f"world_.read({key}).value()"
            return f"\n  {declared} override {{ return {value}; }}"
        cancel = self._leaves.declaration(leaf, self._leaves.cancel(leaf))
        return (
            f"\n  {declared} override {{ return world_.act({key}); }}"
            f"\n  {cancel} override {{ world_.cancel({key}); }}"
        )


def _braces(items: Iterable[str]) -> str:
    return f"{{{', '.join(items)}}}"


def _rows(items: list[str]) -> str:
    rows = ",\n          ".join(items)
    return f"{{{rows}}}"
