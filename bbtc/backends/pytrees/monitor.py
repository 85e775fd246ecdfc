"""The monitor of a tree, and what its simulated world tells, as Python tables."""

from __future__ import annotations

from collections.abc import Iterable

from bbtc.backends.pytrees.parts import ConditionCode, fact_tuple, words_tuple
from bbtc.backends.pytrees.pycode import Code, Prefixed, call, layout, literal, mapping, sequence
from bbtc.ground.condition import Condition
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.monitor import FIRST, Monitor, Move, Part, Row, Telling, Walk

VALUES = {Truth.TRUE: "True", Truth.FALSE: "False", Truth.UNKNOWN: "None"}


class MonitorWriter:
    """Writes the tables ``MONITOR``, ``PRIORS`` and ``TELLINGS`` of a module."""

    def __init__(self, task: Task, monitor: Monitor, conditions: ConditionCode) -> None:
        self._task = task
        self._monitor = monitor
        self._conditions = conditions

    def tables(self) -> list[list[str]]:
        """The tables."""
        parts = sequence(map(self._part, self._monitor.parts))
        priors = sequence(
            sequence(call("", literal(str(each.probability)), self._state(each.sets)) for each in prior)
            for prior in self._monitor.priors
        )
        by_action: dict[str, list[Code]] = {}
        for telling in self._monitor.tellings:
            by_action.setdefault(telling.action, []).append(self._telling(telling))
        tellings = mapping((self.action(name), sequence(each)) for name, each in by_action.items())
        walks = sequence(map(self._walk, self._monitor.walks))
        more = [
            [
                *layout(walks, "WALKS: list[Walk] = "),
                '"""What may be true at the start, drawn one after the other."""',
            ]
        ]
        return [
            [
                *layout(parts, "MONITOR: list[Part] = "),
                '"""What is known, by what the robot was told. It has what the runs of the tree reach."""',
            ],
            [
                *layout(priors, "PRIORS: list[list[tuple[str, State]]] = "),
                '"""What may be true at the start, with probabilities: independent choices."""',
            ],
            [
                *layout(tellings, "TELLINGS: dict[Fact, list[Telling]] = "),
                '"""What each action tells."""',
            ],
            *(more if self._monitor.walks else []),
        ]

    def action(self, name: str) -> str:
        """An action as a tuple of words."""
        if name == FIRST:
            return "()"
        action = self._task.action_by_name[name]
        return words_tuple((action.schema, *action.args))

    def _part(self, part: Part) -> Code:
        return call(
            "Part",
            sequence(map(self._fact, part.known)),
            sequence(_entries(VALUES[value] for value in values) for values in part.values),
            str(part.start),
            mapping((self.action(move.action), self._move(move)) for move in part.moves),
        )

    def _move(self, move: Move) -> Code:
        return call(
            "Move",
            sequence(map(self._fact, move.seen)),
            sequence(map(literal, move.readings)),
            mapping((_key(row), str(row.then)) for row in move.rows),
        )

    def _telling(self, telling: Telling) -> Code:
        observation = telling.observation
        items: list[Code] = [
            literal(telling.name),
            literal(str(observation.accuracy)),
            self._test(observation.condition),
        ]
        if observation.when is not None:
            items.append(self._test(observation.when))
        return call("Telling", *items)

    def _walk(self, walk: Walk) -> Code:
        turns = (
            call("", str(turn.level), literal(str(turn.true)), str(turn.if_false), str(turn.if_true))
            for turn in walk.turns
        )
        return call("Walk", sequence(map(self._fact, walk.variables)), sequence(turns))

    def _test(self, condition: Condition) -> Code:
        return Prefixed("lambda s: ", self._conditions.write(condition, lambda at: f"s[{self._fact(at)}]"))

    def _state(self, sets: Iterable[tuple[int, Truth]]) -> Code:
        return mapping((self._fact(index), VALUES[value]) for index, value in sets)

    def _fact(self, index: int) -> str:
        return fact_tuple(self._task.variables[index])


def _key(row: Row) -> str:
    values = [VALUES[value] for value in (*row.before, *row.told, *row.after)]
    return _entries([str(row.belief), *values])


def _entries(entries: Iterable[str]) -> str:
    listed = list(entries)
    return f"({', '.join(listed)}{',' if len(listed) == 1 else ''})"
