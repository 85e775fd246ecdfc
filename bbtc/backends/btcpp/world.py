"""The simulated robot of a C++ skeleton: the tables of its world, and its methods."""

from __future__ import annotations

from collections.abc import Sequence

from typing_extensions import assert_never

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.leaves import LeafWriter
from bbtc.backends.btcpp.monitor import MonitorTable, braces, key_code, key_of
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.interface import Leaf, action_symbol, variable_symbol
from bbtc.backends.shape import normal
from bbtc.backends.world_model import actions_used, changes_of, initial_values, relevant_variables
from bbtc.ground.condition import TRUE, And, Condition, Constant, Is, Known, Not, Or, Within, in_digits
from bbtc.ground.task import Factor, GroundEvent, Outcome, Variable
from bbtc.kleene import Truth
from bbtc.tree.monitor import Monitor, Telling, Walk
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


_MOVING_CLASS = """\
class SimulatedRobot : public Robot {
 public:
  SimulatedRobot(std::uint64_t seed, unsigned ticks, std::ostream* report)
      : world_(model(), moves(), seed, ticks, report) {}

  MovingWorld& world() { return world_; }
"""


_HIDDEN_CLASS = """\
class SimulatedRobot : public Robot {
 public:
  SimulatedRobot(std::uint64_t seed, unsigned ticks, std::ostream* report)
      : world_(model(), hidden(), monitor(), seed, ticks, report) {}

  HiddenWorld& world() { return world_; }
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
        head, kind, begun = _HEAD, "SimulatedWorld", _CLASS
        if self._tree.monitor is not None:
            head = head.replace('"simulated_world.hpp"', '"hidden_world.hpp"')
            kind, begun = "HiddenWorld", _HIDDEN_CLASS
        elif self._task.events:
            head = head.replace('"simulated_world.hpp"', '"moving_world.hpp"')
            kind, begun = "MovingWorld", _MOVING_CLASS
        lines = [cppcode.fill(head, ROBOT_TREE=self._space) + self._model()]
        lines += [self._moves()] if self._task.events else []
        lines += [] if self._tree.monitor is None else [self._hidden(self._tree.monitor)]
        lines += [begun.rstrip(), *map(self._method, self._leaves.asked())]
        lines += ["", " private:", f"  {kind} world_;", "};", ""]
        return "\n".join([*lines, f"}}  // namespace {self._space}", ""])

    # --- the model ---------------------------------------------------------------------------

    def _model(self) -> str:
        variables = [self._task.variables[index] for index in self._relevant]
        facts = [cppcode.literal(self._key(variable)) for variable in variables]
        starts = initial_values(self._task, self._relevant)
        initial = [
            braces([f"{weight}u", braces(_VALUES[value] for value in values)])
            for weight, values in zip(cppcode.weights(starts.values()), starts, strict=True)
        ]
        actions = [
            f"{{{cppcode.literal(key_of(self._names, action_symbol(action), action.args))},\n"
            f"           {self._factors(action.factors)}}}"
            for action in actions_used(self._tree)
        ]
        return "\n".join(
            [
                "inline const Model& model() {",
                "  static const Model all = {",
                f"      /*facts=*/{_rows(facts)},",
                f"      /*initial=*/{_rows(initial)},",
                f"      /*actions=*/{_rows(actions)}{self._numbers()}}};",
                "  return all;",
                "}",
                "",
            ]
        )

    def _numbers(self) -> str:
        """The numbers that the facts are the digits of."""
        rows = []
        for number in self._task.numbers:
            if self._number.keys() >= set(number.digits):
                symbol = variable_symbol(self._task.variables[number.digits[0]])
                name = cppcode.literal(key_of(self._names, symbol, number.args))
                digits = braces(str(self._number[digit]) for digit in number.digits)
                rows.append(f"{{{name}, {{{number.low}, {digits}}}}}")
        return f",\n      /*numbers=*/{_rows(rows)}" if rows else ""

    def _moves(self) -> str:
        """What happens by itself, and which actions that may end."""
        tables: dict[tuple[tuple[GroundEvent, ...], ...], str] = {}
        lines: list[str] = []
        events: list[str] = []
        for action in actions_used(self._tree):
            rounds = self._task.rounds(action)
            if rounds not in tables:
                tables[rounds] = f"moves{len(tables) + 1}"
                lines += [f"  static const Rounds {tables[rounds]} =", f"      {self._rounds(rounds)};"]
            key = cppcode.literal(key_of(self._names, action_symbol(action), action.args))
            events.append(f"{{{key}, {tables[rounds]}}}")
        interrupted = [
            f"{{{cppcode.literal(key_of(self._names, action_symbol(action), action.args))},\n"
            f"           Interruption{{{self._lambda(normal(self._task, action.during))}, "
            f"{self._factors(action.on_abort)}}}}}"
            for action in actions_used(self._tree)
            if action.during is not None
        ]
        return "\n".join(
            [
                "inline const Moves& moves() {",
                *lines,
                "  static const Moves all = {",
                f"      /*events=*/{_rows(events)},",
                f"      /*interrupted=*/{_rows(interrupted)}}};",
                "  return all;",
                "}",
                "",
            ]
        )

    def _hidden(self, monitor: Monitor) -> str:
        """What is true at the start, and what actions tell."""
        table = MonitorTable(self._task, self._names, monitor)
        priors = []
        for prior in monitor.priors:
            weights = cppcode.weights(each.probability for each in prior)
            draws = (
                braces([f"{weight}u", braces(f"{{{self._number[at]}, {_VALUES[v]}}}" for at, v in each.sets)])
                for weight, each in zip(weights, prior, strict=True)
            )
            priors.append(_rows(list(draws)))
        walks = f",\n      /*walks=*/{_rows(list(map(self._walk, monitor.walks)))}" if monitor.walks else ""
        by_action: dict[str, list[str]] = {}
        for telling in monitor.tellings:
            by_action.setdefault(telling.action, []).append(self._telling(telling))
        tellings = [
            f"{{{cppcode.literal(table.action(action))}, {_rows(each)}}}"
            for action, each in by_action.items()
        ]
        return "\n".join(
            [
                "inline const HiddenModel& hidden() {",
                "  static const HiddenModel all = {",
                f"      /*priors=*/{_rows(priors)},",
                f"      /*tellings=*/{_rows(tellings)}{walks}}};",
                "  return all;",
                "}",
                "",
            ]
        )

    def _walk(self, walk: Walk) -> str:
        turns = []
        for turn in walk.turns:
            # What is certain is not rounded to something that may happen.
            sure = turn.true in (0, 1)
            true, false = (
                (int(turn.true), int(1 - turn.true)) if sure else cppcode.weights((turn.true, 1 - turn.true))
            )
            following = f"{{{turn.if_false}, {turn.if_true}}}"
            turns.append(f"{{{turn.level}, {{{false}u, {true}u}}, {following}}}")
        return braces([braces(str(self._number[at]) for at in walk.variables), _rows(turns)])

    def _telling(self, telling: Telling) -> str:
        observation = telling.observation
        right, wrong = cppcode.weights((observation.accuracy, 1 - observation.accuracy))
        if observation.accuracy in (0, 1):
            right, wrong = int(observation.accuracy), 1 - int(observation.accuracy)
        when = "nullptr" if observation.when is None else self._lambda(observation.when)
        items = [cppcode.literal(telling.name), f"{right}u", f"{wrong}u"]
        return f"Telling{braces([*items, self._lambda(observation.condition), when])}"

    def _rounds(self, rounds: Sequence[Sequence[GroundEvent]]) -> str:
        return _rows(
            [
                _rows(
                    [
                        f"Event{{{self._anywhere(normal(self._task, event.precondition))}, "
                        f"{self._factors(event.factors)}}}"
                        for event in events
                    ]
                )
                for events in rounds
            ]
        )

    def _anywhere(self, condition: Condition) -> str:
        return "nullptr" if condition == TRUE else self._lambda(condition)

    def _lambda(self, condition: Condition) -> str:
        return f"[](const State& s) {{ return {self._test(condition)}; }}"

    def _factors(self, factors: tuple[Factor, ...]) -> str:
        return braces(f"Factor{{{braces(self._outcomes(factor))}}}" for factor in factors)

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
            sets = braces(f"{{{self._number[index]}, {_VALUES[value]}}}" for index, value in pairs)
            test = "nullptr" if changes.when == TRUE else self._lambda(changes.when)
            if changes.sets:
                effects.append(f"Effect{{{test}, {sets}}}")
        return braces(effects)

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
            case Within():
                return self._test(in_digits(condition))
            case And(parts):
                return f"all_of({braces(map(self._test, parts))})"
            case Or(parts):
                return f"any_of({braces(map(self._test, parts))})"
            case Not(part):
                return f"negated({self._test(part)})"
            case _:
                assert_never(condition)

    def _key(self, variable: Variable) -> str:
        """What a fact is called in the world. Numbers are kept there digit by digit."""
        if variable.digit is None:
            return key_of(self._names, variable_symbol(variable), variable.args)
        values = ",".join(self._names.values[arg] for arg in variable.args)
        return f"{variable.predicate}({values})"

    # --- the robot ---------------------------------------------------------------------------

    def _method(self, leaf: Leaf) -> str:
        names = cppcode.parameters(leaf.parameters)
        key = key_code(self._names, leaf, list(names))
        declared = self._leaves.declaration(leaf, self._leaves.method(leaf))
        if leaf.symbol.kind == "predicate":
            value = f"world_.read({key})" if leaf.three_valued else f"world_.read({key}).value()"
            return f"\n  {declared} override {{ return {value}; }}"
        if leaf.counts:
            return f"\n  {declared} override {{ return world_.number({key}); }}"
        cancel = self._leaves.declaration(leaf, self._leaves.cancel(leaf))
        return (
            f"\n  {declared} override {{ return world_.act({key}); }}"
            f"\n  {cancel} override {{ world_.cancel({key}); }}"
        )


def _rows(items: list[str]) -> str:
    rows = ",\n          ".join(items)
    return f"{{{rows}}}"
