"""The monitor of a tree as a C++ table."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import resources

from bbtc.backends.btcpp import cppcode
from bbtc.backends.btcpp.names import BtcppNames
from bbtc.backends.interface import Leaf, action_symbol, variable_symbol
from bbtc.backends.names import Symbol
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.monitor import FIRST, Monitor, Move, Part, Row

_VALUES = {Truth.FALSE: "0", Truth.TRUE: "1", Truth.UNKNOWN: "2"}

_HEAD = """\
// What is known, by what the robot was told. Made by bbtc; no need to edit it.
#pragma once

#include "monitor.hpp"

namespace ROBOT_TREE {

/// It has what the runs of the tree reach.
inline const std::vector<Part>& monitorTable() {
  static const std::vector<Part> parts = {
"""


def key_of(names: BtcppNames, symbol: Symbol, args: Iterable[str]) -> str:
    """What a fact or an action is called in C++: the id of its leaf, and the values of its ports."""
    known = names.ids.get(symbol)
    # A fact that no leaf reads still matters to effects.
    name = known if known is not None else f"{symbol.name}/{symbol.arity}"
    return f"{name}({','.join(names.values[arg] for arg in args)})"


def key_code(names: BtcppNames, leaf: Leaf, arguments: list[str]) -> str:
    """The same as C++ that puts it together, of the arguments of a leaf."""
    name = cppcode.literal(f"{names.ids[leaf.symbol]}({'' if arguments else ')'}")
    inner = ' + "," + '.join(arguments)
    return f'std::string({name}) + {inner} + ")"' if arguments else name


def braces(items: Iterable[str]) -> str:
    """``{items, …}``."""
    return f"{{{', '.join(items)}}}"


def monitor_files(task: Task, names: BtcppNames, monitor: Monitor, space: str) -> dict[str, str]:
    """The files of the monitor, by name."""
    text = (resources.files("bbtc.backends.btcpp") / "cpp" / "monitor.hpp").read_text(encoding="utf-8")
    return {
        "monitor.hpp": cppcode.fill(text, ROBOT_TREE=space),
        "monitor_table.hpp": MonitorTable(task, names, monitor).header(space),
    }


class MonitorTable:
    """Writes ``monitor_table.hpp``."""

    def __init__(self, task: Task, names: BtcppNames, monitor: Monitor) -> None:
        self._task, self._names, self._monitor = task, names, monitor

    def header(self, space: str) -> str:
        """The text of the file."""
        parts = [line for part in self._monitor.parts for line in self._part(part)]
        return "\n".join(
            [
                cppcode.fill(_HEAD, ROBOT_TREE=space).rstrip("\n"),
                *parts,
                "  };",
                "  return parts;",
                "}",
                "",
                f"}}  // namespace {space}",
                "",
            ]
        )

    def fact(self, variable: int) -> str:
        """What a fact is called."""
        read = self._task.variables[variable]
        return key_of(self._names, variable_symbol(read), read.args)

    def action(self, name: str) -> str:
        """What an action is called."""
        if name == FIRST:
            return ""
        action = self._task.action_by_name[name]
        return key_of(self._names, action_symbol(action), action.args)

    def _part(self, part: Part) -> list[str]:
        values = [f"         {braces(_VALUES[value] for value in values)}," for values in part.values]
        moves = [line for move in part.moves for line in self._move(move)]
        return [
            f"      {{/*facts=*/{braces(cppcode.literal(self.fact(known)) for known in part.known)},",
            "       /*values=*/{",
            *values,
            "       },",
            f"       /*start=*/{part.start},",
            "       /*moves=*/{",
            *moves,
            "       }},",
        ]

    def _move(self, move: Move) -> list[str]:
        seen = braces(cppcode.literal(self.fact(variable)) for variable in move.seen)
        readings = braces(map(cppcode.literal, move.readings))
        rows = [f"             {{{_key(row)}, {row.then}}}," for row in move.rows]
        return [
            f"           {{{cppcode.literal(self.action(move.action))},",
            f"            {{/*seen=*/{seen}, /*readings=*/{readings}, /*rows=*/{{",
            *rows,
            "            }}},",
        ]


def _key(row: Row) -> str:
    return braces([str(row.belief), *(_VALUES[value] for value in (*row.before, *row.told, *row.after))])
