"""The simulated world of a generated py_trees module: the exact outcome distribution of the task,
as far as the tree can tell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from bbtc.backends.interface import Interface
from bbtc.backends.names import Symbol
from bbtc.backends.pytrees.monitor import VALUES, MonitorWriter
from bbtc.backends.pytrees.parts import (
    ConditionCode,
    condition_type,
    fact_of,
    fact_tuple,
    method,
    words_tuple,
)
from bbtc.backends.pytrees.pycode import Code, Prefixed, call, flat, layout, literal, mapping, sequence
from bbtc.backends.shape import normal
from bbtc.backends.world_model import actions_used, changes_of, initial_values, relevant_variables
from bbtc.ground.condition import Condition, number_in
from bbtc.ground.task import Factor, GroundEvent, NumberChange, Outcome, Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import Tree


class WorldWriter:
    """Writes the tables of facts and actions, and the class that plays the robot."""

    def __init__(
        self, tree: Tree, interface: Interface, methods: Mapping[Symbol, str], conditions: ConditionCode
    ) -> None:
        self._task: Task = tree.task
        self._interface = interface
        self._methods = methods
        self._conditions = conditions
        self._actions = actions_used(tree)
        self._monitor = tree.monitor
        # The monitor tells the one, and the priors the other.
        elsewhere = frozenset() if tree.monitor is None else tree.monitor.known | tree.monitor.drawn
        relevant = [index for index in relevant_variables(tree) if index not in elsewhere]
        self._relevant = [index for index in relevant if index not in self._task.number_of_digit]
        numbers = {self._task.number_of_digit[index] for index in relevant if index not in self._relevant}
        self._numbers = [number for number in self._task.numbers if number in numbers]

    def tables(self) -> list[list[str]]:
        """``INITIAL`` and ``ACTIONS``."""
        kind = "Values" if self._numbers else "State"
        initial = layout(self._initial(), f"INITIAL: list[tuple[str, {kind}]] = ")
        actions = mapping(
            (words_tuple((action.schema, *action.args)), self._factors(action.factors))
            for action in self._actions
        )
        more: list[list[str]] = []
        if self._task.events:
            more = self._moving()
        if self._monitor is not None:
            more = MonitorWriter(self._task, self._monitor, self._conditions).tables()
        return [
            [*initial, '"""The states a run may start in, with their probabilities."""'],
            [
                *layout(actions, "ACTIONS: dict[Fact, list[Factor]] = "),
                '"""What each action does: independent choices between outcomes."""',
            ],
            *more,
        ]

    @property
    def base(self) -> str:
        """The class of the simulated world's behaviour."""
        if self._monitor is not None:
            return "HiddenWorld"
        numbers = "Number" if self._numbers else ""
        return f"Moving{numbers}World" if self._task.events else f"{numbers}World"

    def _moving(self) -> list[list[str]]:
        """What happens by itself, and ``INTERRUPTED``."""
        tables: dict[tuple[tuple[GroundEvent, ...], ...], str] = {}
        names: list[tuple[str, Code]] = []
        lines: list[list[str]] = []
        for action in self._actions:
            rounds = self._task.rounds(action)
            if rounds not in tables:
                tables[rounds] = "MOVES" if not tables else f"MOVES_{len(tables) + 1}"
                lines.append(layout(self._rounds(rounds), f"{tables[rounds]}: Rounds = "))
            names.append((words_tuple((action.schema, *action.args)), tables[rounds]))
        interrupted = mapping(
            (
                words_tuple((action.schema, *action.args)),
                call("", self._test(action.during), self._factors(action.on_abort)),
            )
            for action in self._actions
            if action.during is not None
        )
        return [
            *lines,
            [
                *layout(mapping(names), "EVENTS: dict[Fact, Rounds] = "),
                '"""What happens by itself with each action, round by round: where it may, and what."""',
            ],
            [
                *layout(interrupted, "INTERRUPTED: dict[Fact, tuple[Test, list[Factor]]] = "),
                '"""While what actions go on that events may end, and what happens else."""',
            ],
        ]

    def _rounds(self, rounds: Sequence[Sequence[GroundEvent]]) -> Code:
        return sequence(
            sequence(
                call("", self._test(event.precondition), self._factors(event.factors)) for event in events
            )
            for events in rounds
        )

    def _test(self, condition: Condition) -> Code:
        return Prefixed("lambda s: ", self._conditions.write(normal(self._task, condition), self._read))

    def world(self) -> list[str]:
        """The class ``SimulatedWorld``."""
        lines = [f"class SimulatedWorld({self.base}):", '    """Plays the robot."""']
        for leaf in self._interface.asked:
            answer = flat(call("self._number" if leaf.counts else "self._value", *fact_of(leaf)))
            lines += method(self._methods[leaf.symbol], leaf, condition_type(leaf), f"return {answer}")
        for leaf in self._interface.actions:
            answer = flat(call("self._act", *fact_of(leaf)))
            lines += method(self._methods[leaf.symbol], leaf, "Status", f"return {answer}")
        return lines

    def _initial(self) -> Code:
        digits = [digit for number in self._numbers for digit in number.digits]
        merged = initial_values(self._task, [*self._relevant, *digits])
        return sequence(
            call("", _probability(p), self._start(dict(zip([*self._relevant, *digits], values, strict=True))))
            for values, p in merged.items()
        )

    def _start(self, values: Mapping[int, Truth]) -> Code:
        """A state in which a run may start."""
        facts = [(self._fact(index), VALUES[values[index]]) for index in self._relevant]
        numbers = [
            (self._fact(number.digits[0]), str(number.low + number_in(number.digits, values)))
            for number in self._numbers
        ]
        return mapping([*facts, *numbers])

    def _state(self, assignment: Iterable[tuple[int, Truth]]) -> Code:
        digits = self._task.number_of_digit
        return mapping(
            (self._fact(index), VALUES[value]) for index, value in assignment if index not in digits
        )

    def _fact(self, index: int) -> str:
        return fact_tuple(self._task.variables[index])

    def _factors(self, factors: tuple[Factor, ...]) -> Code:
        return sequence(sequence(map(self._outcome, factor.outcomes)) for factor in factors)

    def _outcome(self, outcome: Outcome) -> Code:
        always, *conditional = changes_of(self._task, outcome)
        items: list[Code] = [_probability(outcome.probability), self._always(always.sets, outcome.changes)]
        for changes in conditional:
            if changes.sets and self._task.number_of_digit.keys() >= changes.sets.keys():
                continue  # of which the number's own changes tell
            condition = Prefixed("lambda s: ", self._conditions.write(changes.when, self._read))
            items.append(call("When", condition, self._state(changes.sets.items())))
        for change in outcome.changes:
            items += self._shifts(change)
        if outcome.factors:
            items.append(Prefixed("then=", self._factors(outcome.factors)))
        return call("Outcome", *items)

    def _always(self, sets: Mapping[int, Truth], changes: Iterable[NumberChange]) -> Code:
        """What is set whatever holds, numbers that get a value included."""
        facts = [
            (self._fact(index), VALUES[value])
            for index, value in sets.items()
            if index not in self._task.number_of_digit
        ]
        numbers = [
            (self._fact(change.digits[0]), str(self._assigned(change.digits, case.amount)))
            for change in changes
            for case in change.cases
            if case.when is None and case.kind == "assign"
        ]
        return mapping([*facts, *numbers])

    def _shifts(self, change: NumberChange) -> Iterator[Code]:
        """What else happens to a number."""
        number, fact = self._task.number_of_digit[change.digits[0]], self._fact(change.digits[0])
        for case in change.cases:
            when = []
            if case.when is not None:
                when.append(Prefixed("lambda s: ", self._conditions.write(case.when, self._read)))
            if case.kind == "add":
                yield call("Shift", fact, str(case.amount), str(number.low), str(number.high), *when)
            elif when:
                value = str(self._assigned(change.digits, case.amount))
                yield call("When", *when, mapping([(fact, value)]))

    def _assigned(self, digits: tuple[int, ...], amount: int) -> int:
        """A value that a number gets, within its range."""
        number = self._task.number_of_digit[digits[0]]
        return min(max(number.low + amount, number.low), number.high)

    def _read(self, index: int) -> Code:
        return f"s[{self._fact(index)}]"


def _probability(value: Fraction) -> str:
    return literal(str(value))
