"""The simulated world of a generated py_trees module: the exact outcome distribution of the task,
as far as the tree can tell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction

from bbtc.export.interface import Interface, guard_of
from bbtc.export.names import Symbol
from bbtc.export.pycode import Code, Prefixed, call, flat, layout, literal, mapping, sequence
from bbtc.export.pytrees_parts import ConditionCode, condition_type, fact_of, method
from bbtc.export.shape import normal
from bbtc.ground.condition import FALSE, TRUE, variables
from bbtc.ground.task import Factor, GroundAction, Outcome, Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, Tree, actions_of, walk

_VALUES = {Truth.TRUE: "True", Truth.FALSE: "False", Truth.UNKNOWN: "None"}


class WorldWriter:
    """Writes the tables of facts and actions, and the class that plays the robot."""

    def __init__(
        self, tree: Tree, interface: Interface, methods: Mapping[Symbol, str], conditions: ConditionCode
    ) -> None:
        self._task: Task = tree.task
        self._interface = interface
        self._methods = methods
        self._conditions = conditions
        names = dict.fromkeys(node.action for node in actions_of(tree.root))
        self._actions = [self._task.action_by_name[name] for name in sorted(names)]
        self._relevant = sorted(_relevant(tree, self._actions))

    def tables(self) -> list[list[str]]:
        """``INITIAL`` and ``ACTIONS``."""
        initial = layout(self._initial(), "INITIAL: list[tuple[str, State]] = ")
        actions = mapping(
            (_tuple((action.schema, *action.args)), self._factors(action.factors)) for action in self._actions
        )
        return [
            [*initial, '"""The states a run may start in, with their probabilities."""'],
            [
                *layout(actions, "ACTIONS: dict[Fact, list[Factor]] = "),
                '"""What each action does: independent choices between outcomes."""',
            ],
        ]

    def world(self) -> list[str]:
        """The class ``SimulatedWorld``."""
        lines = ["class SimulatedWorld(World):", '    """Plays the robot."""']
        for leaf in self._interface.conditions:
            value = flat(call("self._value", *fact_of(leaf)))
            answer = value if leaf.three_valued else f"{value} is True"
            lines += method(self._methods[leaf.symbol], leaf, condition_type(leaf), f"return {answer}")
        for leaf in self._interface.actions:
            answer = flat(call("self._act", *fact_of(leaf)))
            lines += method(self._methods[leaf.symbol], leaf, "Status", f"return {answer}")
        return lines

    def _initial(self) -> Code:
        merged: dict[tuple[Truth, ...], Fraction] = {}
        for state in self._task.initial:
            seen = tuple(state.values[index] for index in self._relevant)
            merged[seen] = merged.get(seen, Fraction(0)) + state.probability
        return sequence(
            call("", _probability(p), self._state(zip(self._relevant, values, strict=True)))
            for values, p in merged.items()
        )

    def _state(self, assignment: Iterable[tuple[int, Truth]]) -> Code:
        return mapping((self._fact(index), _VALUES[value]) for index, value in assignment)

    def _fact(self, index: int) -> str:
        variable = self._task.variables[index]
        return _tuple((variable.predicate, *variable.args))

    def _factors(self, factors: tuple[Factor, ...]) -> Code:
        return sequence(sequence(map(self._outcome, factor.outcomes)) for factor in factors)

    def _outcome(self, outcome: Outcome) -> Code:
        always: dict[int, Truth] = {}
        conditional: list[Code] = []
        for effect in outcome.effects:
            when = TRUE if effect.when is None else normal(self._task, effect.when)
            changes: dict[int, Truth] = always if when == TRUE else {}
            for index, value in effect.sets:  # the Kleene maximum wins
                changes[index] = max(value, changes.get(index, Truth.FALSE))
            if when not in (TRUE, FALSE) and changes:
                condition = Prefixed("lambda s: ", self._conditions.write(when, self._read))
                conditional.append(call("When", condition, self._state(changes.items())))
        items = [_probability(outcome.probability), self._state(always.items()), *conditional]
        if outcome.factors:
            items.append(Prefixed("then=", self._factors(outcome.factors)))
        return call("Outcome", *items)

    def _read(self, index: int) -> Code:
        return f"s[{self._fact(index)}]"


def _relevant(tree: Tree, actions: list[GroundAction]) -> set[int]:
    """What the tree or an effect reads, or an action of the tree sets."""
    task = tree.task
    found: set[int] = set()
    for node in walk(tree.root):
        if isinstance(node, ConditionNode):
            found.update(variables(normal(task, node.condition)))
        elif isinstance(node, ActionNode):
            found.update(variables(guard_of(task, node) or TRUE))
    stack = [factor for action in actions for factor in action.factors]
    while stack:
        for outcome in stack.pop().outcomes:
            stack.extend(outcome.factors)
            for effect in outcome.effects:
                found.update(index for index, _ in effect.sets)
                if effect.when is not None:
                    found.update(variables(normal(task, effect.when)))
    return found


def _probability(value: Fraction) -> str:
    return literal(str(value))


def _tuple(words: tuple[str, ...]) -> str:
    return f"({', '.join(map(literal, words))}{',' if len(words) == 1 else ''})"
