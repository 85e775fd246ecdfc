"""The LALR automaton of the grammar, as plain data.

Lark reads ``grammar/bbtc.lark`` and computes the automaton, which takes longer than a whole run of
``bbtc check``. So the result stands beside the grammar, as ``grammar/bbtc.tables.json``, with the checksum of
the text that it was made from: tables of another text are made anew instead, and a test holds the two in
step. After a change of the grammar ``python -m bbtc.syntax.tables`` writes them.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

END = "$END"
START = "document"
"""The start rule of the grammar."""
FLAGS = re.IGNORECASE | re.ASCII
_GRAMMAR = "bbtc.lark"
_TABLES = "bbtc.tables.json"


class Production(NamedTuple):
    """A rule of the grammar."""

    origin: str
    size: int
    empty: tuple[int, ...]
    """Positions of the lists that are empty: Lark makes two productions of ``OR formula* CLOSE``, with the
    list and without it, and both must have the same children."""
    call: str | None
    """Name of the builder's method; None for a list."""
    single: bool
    """A single child stands for the whole (``?rule``)."""
    grows: bool
    """A list of the form ``list: list item``; others are ``list: item``."""


@dataclass(frozen=True, slots=True)
class Tables:
    """An LALR automaton. States are numbered in the order in which they are met from the start."""

    start: int
    end: int
    productions: tuple[Production, ...]
    actions: Mapping[int, Mapping[str, int]]
    """By state and terminal: the next state, or ``-1 - n`` to reduce production n."""
    goto: Mapping[int, Mapping[str, int]]
    """By state and rule: the next state."""
    terminals: Mapping[str, str]
    """Regular expression of each terminal, in the order in which they are tried."""


def tables() -> Tables:
    """The automaton of the grammar: as it stands beside it, or computed if that is of another text."""
    grammar, made = grammar_text(), _text(_TABLES)
    if made is not None:
        found = json.loads(made)
        if found["grammar"] == _checksum(grammar):
            return _loaded(found)
    return make_tables(grammar, START)


def grammar_text() -> str:
    """The grammar of the language. Raises :class:`FileNotFoundError` in a broken installation."""
    text = _text(_GRAMMAR)
    if text is None:
        raise FileNotFoundError(_GRAMMAR)
    return text


def _text(name: str) -> str | None:
    """A file of the grammar, if it is there: package data in a wheel, under ``grammar/`` in a checkout."""
    packaged = files("bbtc") / "grammar" / name
    file = packaged if packaged.is_file() else Path(__file__).parents[2] / "grammar" / name
    return file.read_text("utf-8") if file.is_file() else None


def _checksum(grammar: str) -> str:
    return hashlib.sha256(grammar.encode()).hexdigest()


# --- computing -------------------------------------------------------------------------------


def make_tables(grammar: str, start: str) -> Tables:
    """The automaton of a Lark grammar."""
    from lark import Lark
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    lark = Lark(grammar, parser="lalr", lexer="contextual", start=start, g_regex_flags=FLAGS)
    data, memo = lark.memo_serialize([TerminalDef, Rule])
    table = data["parser"]["parser"]
    terminals = sorted(lark.terminals, key=lambda t: (-t.priority, -len(t.pattern.to_regexp()), t.name))
    kinds = {terminal.name for terminal in terminals} | {END}
    written = {number: rule for number, rule in memo.items() if rule["__type__"] == "Rule"}
    rules = {number: _production(rule, written.values()) for number, rule in written.items()}
    # Lark numbers rules and states as its sets happen to be ordered.
    order = sorted(rules, key=lambda number: (rules[number].origin, _expansion(memo[number])))
    position = {number: at for at, number in enumerate(order)}
    rows: dict[int, dict[str, tuple[bool, int]]] = {
        state: {
            table["tokens"][symbol]: (bool(reduces), position[target["@"]] if reduces else target)
            for symbol, (reduces, target) in row.items()
        }
        for state, row in table["states"].items()
    }
    number_of = _numbered(table["start_states"][start], rows)
    actions: dict[int, dict[str, int]] = {}
    goto: dict[int, dict[str, int]] = {}
    for state, number in number_of.items():
        cells = {
            symbol: -1 - target if reduces else number_of[target]
            for symbol, (reduces, target) in sorted(rows[state].items())
        }
        actions[number] = {symbol: cell for symbol, cell in cells.items() if symbol in kinds}
        goto[number] = {symbol: cell for symbol, cell in cells.items() if symbol not in kinds}
    return Tables(
        number_of[table["start_states"][start]],
        number_of[table["end_states"][start]],
        tuple(rules[number] for number in order),
        actions,
        goto,
        {
            terminal.name: terminal.pattern.to_regexp()
            for terminal in terminals
            if terminal.name not in lark.ignore_tokens
        },
    )


def _numbered(start: int, rows: Mapping[int, Mapping[str, tuple[bool, int]]]) -> dict[int, int]:
    """Numbers of the states, breadth first from the start, by the names of the symbols."""
    found = {start: 0}
    todo = [start]
    for state in todo:
        for _, (reduces, target) in sorted(rows[state].items()):
            if not reduces and target not in found:
                found[target] = len(found)
                todo.append(target)
    return found


def _expansion(rule: Mapping[str, Any]) -> list[str]:
    return [symbol["name"] for symbol in rule["expansion"]]


def _production(rule: Mapping[str, Any], rules: Iterable[Mapping[str, Any]]) -> Production:
    origin, alias = rule["origin"]["name"], rule["alias"]
    expansion = _expansion(rule)
    if origin.startswith("_"):
        return Production(origin, len(expansion), (), None, False, expansion[0] == origin)
    single = bool(rule["options"]["expand1"]) and len(expansion) == 1 and alias is None
    empty: tuple[int, ...] = ()
    for other in (_expansion(each) for each in rules if each["origin"] == rule["origin"]):
        # An underscore marks the names of the rules that Lark makes for `item*` and `item+`.
        lists = tuple(at for at, name in enumerate(other) if name.startswith("_"))
        if lists and expansion == [name for name in other if not name.startswith("_")]:
            empty = lists
    return Production(origin, len(expansion), empty, alias or origin, single, False)


# --- text ------------------------------------------------------------------------------------


def dumped(grammar: str) -> str:
    """The tables of the grammar as JSON, a line for each state."""
    made = make_tables(grammar, START)
    parts = {
        "grammar": json.dumps(_checksum(grammar)),
        "start": json.dumps(made.start),
        "end": json.dumps(made.end),
        "productions": _lines(map(json.dumps, made.productions), "[]"),
        "terminals": _lines(map(json.dumps, made.terminals.items()), "[]"),
        "actions": _lines((json.dumps(made.actions[state]) for state in range(len(made.actions))), "[]"),
        "goto": _lines((json.dumps(made.goto[state]) for state in range(len(made.goto))), "[]"),
    }
    return _lines((f'"{key}": {text}' for key, text in parts.items()), "{}") + "\n"


def _lines(texts: Any, brackets: str) -> str:
    return brackets[0] + "\n" + ",\n".join(texts) + "\n" + brackets[1]


def _loaded(found: Mapping[str, Any]) -> Tables:
    return Tables(
        found["start"],
        found["end"],
        tuple(
            Production(origin, size, tuple(empty), call, single, grows)
            for origin, size, empty, call, single, grows in found["productions"]
        ),
        dict(enumerate(found["actions"])),
        dict(enumerate(found["goto"])),
        dict(found["terminals"]),
    )


def main() -> None:
    """Write the tables beside the grammar, in a checkout."""
    folder = Path(__file__).parents[2] / "grammar"
    grammar = (folder / _GRAMMAR).read_text("utf-8")
    (folder / _TABLES).write_text(dumped(grammar), "utf-8", newline="\n")


if __name__ == "__main__":
    main()
