"""The simulated world of a generated py_trees module: the exact outcome distribution of the task,
as far as the tree can tell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from bbtc.backends.interface import Interface
from bbtc.backends.names import Symbol
from bbtc.backends.pytrees.monitor import VALUES, MonitorWriter
from bbtc.backends.pytrees.parts import (
    CONDITION_TYPE,
    ConditionCode,
    fact_of,
    fact_tuple,
    method,
    words_tuple,
)
from bbtc.backends.pytrees.pycode import Code, Prefixed, call, flat, layout, literal, mapping, sequence
from bbtc.backends.shape import normal
from bbtc.backends.world_model import actions_used, changes_of, initial_values, relevant_variables
from bbtc.ground.condition import Condition
from bbtc.ground.task import Factor, GroundEvent, Outcome, Task
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
        self._relevant = [index for index in relevant_variables(tree) if index not in elsewhere]

    def tables(self) -> list[list[str]]:
        """``INITIAL`` and ``ACTIONS``."""
        initial = layout(self._initial(), "INITIAL: list[tuple[str, State]] = ")
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
        return "MovingWorld" if self._task.events else "World"

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
            answer = flat(call("self._value", *fact_of(leaf)))
            lines += method(self._methods[leaf.symbol], leaf, CONDITION_TYPE, f"return {answer}")
        for leaf in self._interface.actions:
            answer = flat(call("self._act", *fact_of(leaf)))
            lines += method(self._methods[leaf.symbol], leaf, "Status", f"return {answer}")
        return lines

    def _initial(self) -> Code:
        merged = initial_values(self._task, self._relevant)
        return sequence(
            call("", _probability(p), self._state(zip(self._relevant, values, strict=True)))
            for values, p in merged.items()
        )

    def _state(self, assignment: Iterable[tuple[int, Truth]]) -> Code:
        return mapping((self._fact(index), VALUES[value]) for index, value in assignment)

    def _fact(self, index: int) -> str:
        return fact_tuple(self._task.variables[index])

    def _factors(self, factors: tuple[Factor, ...]) -> Code:
        return sequence(sequence(map(self._outcome, factor.outcomes)) for factor in factors)

    def _outcome(self, outcome: Outcome) -> Code:
        always, *conditional = changes_of(self._task, outcome)
        items: list[Code] = [_probability(outcome.probability), self._state(always.sets.items())]
        for changes in conditional:
            condition = Prefixed("lambda s: ", self._conditions.write(changes.when, self._read))
            items.append(call("When", condition, self._state(changes.sets.items())))
        if outcome.factors:
            items.append(Prefixed("then=", self._factors(outcome.factors)))
        return call("Outcome", *items)

    def _read(self, index: int) -> Code:
        return f"s[{self._fact(index)}]"


def _probability(value: Fraction) -> str:
    return literal(str(value))
