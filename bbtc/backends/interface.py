"""The leaves that a user of an exported tree implements: one per predicate and action schema.

Every executable back-end shows the same leaves with the same parameter names.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from bbtc.backends.names import Symbol, parameter_names
from bbtc.backends.shape import normal
from bbtc.ground.condition import TRUE, Condition, variables
from bbtc.ground.task import GroundAction, Task, Variable
from bbtc.tree.nodes import ActionNode, ConditionNode, Tree, actions_of, walk


@dataclass(frozen=True, slots=True)
class Leaf:
    """A condition, a number or an action to implement. ``three_valued`` conditions can be unknown."""

    symbol: Symbol
    parameters: tuple[str, ...]
    three_valued: bool = False

    @property
    def counts(self) -> bool:
        """Is it a number?"""
        return self.symbol.kind == "function"


@dataclass(frozen=True)
class Interface:
    """The leaves a tree uses, sorted by name, numbers among the conditions; ``reads`` are the variables that
    conditions and guards ask the robot for; the conditions of ``deduced`` ask the monitor alone."""

    conditions: tuple[Leaf, ...]
    actions: tuple[Leaf, ...]
    reads: tuple[int, ...] = ()
    deduced: frozenset[Symbol] = frozenset()

    @property
    def asked(self) -> tuple[Leaf, ...]:
        """The conditions that the robot answers."""
        return tuple(leaf for leaf in self.conditions if leaf.symbol not in self.deduced)

    @cached_property
    def leaves(self) -> dict[Symbol, Leaf]:
        """Every leaf by its symbol."""
        return {leaf.symbol: leaf for leaf in (*self.conditions, *self.actions)}


def variable_symbol(variable: Variable) -> Symbol:
    """The condition leaf that reads a variable: a fact, or the number that it is a digit of."""
    if variable.digit is not None:
        return Symbol("function", variable.digit.function, len(variable.args))
    return Symbol("predicate", variable.predicate, len(variable.args))


def action_symbol(action: GroundAction) -> Symbol:
    """The action leaf that runs a ground action."""
    return Symbol("action", action.schema, len(action.args))


def guard_of(task: Task, node: ActionNode) -> Condition | None:
    """What must be true for the node to start its action, in normal form; None if nothing."""
    if not node.guarded:
        return None
    guard = normal(task, task.action_by_name[node.action].precondition)
    return None if guard == TRUE else guard


def during_of(task: Task, node: ActionNode) -> Condition | None:
    """What must stay true while the action of a node goes on, in normal form; None if nothing."""
    during = task.action_by_name[node.action].during
    during = None if during is None else normal(task, during)
    return None if during == TRUE else during


def variables_read(tree: Tree) -> dict[int, None]:
    """The variables that conditions, guards and what actions go on while read, in the order of the tree."""
    task = tree.task
    read: dict[int, None] = {}
    for node in walk(tree.root):
        if isinstance(node, ConditionNode):
            read.update(dict.fromkeys(variables(normal(task, node.condition))))
        elif isinstance(node, ActionNode):
            for asked_too in (guard_of(task, node), during_of(task, node)):
                read.update(dict.fromkeys(variables(asked_too or TRUE)))
    return read


def interface_of(tree: Tree) -> Interface:
    """The interface of a tree: what its conditions, guards and actions refer to, and what its monitor asks
    for."""
    task, read = tree.task, variables_read(tree)
    actions = {action_symbol(task.action_by_name[node.action]) for node in actions_of(tree.root)}
    told = frozenset[int]() if tree.monitor is None else tree.monitor.known
    asked = [index for index in read if index not in told]
    asked += [] if tree.monitor is None else sorted(tree.monitor.seen.difference(asked))
    unknowable: dict[Symbol, bool] = {}
    for index in [*asked, *read]:
        variable = task.variables[index]
        symbol = variable_symbol(variable)
        unknowable[symbol] = unknowable.get(symbol, False) or variable.three_valued
    return Interface(
        tuple(Leaf(s, parameters_of(task, s), unknowable[s]) for s in sorted(unknowable)),
        tuple(Leaf(s, parameters_of(task, s)) for s in sorted(actions)),
        tuple(sorted(asked)),
        frozenset(variable_symbol(task.variables[index]) for index in read)
        - frozenset(variable_symbol(task.variables[index]) for index in asked),
    )


BOUNDS = ("at_least", "at_most")
"""What a node that reads a number is given besides its arguments: what it is to be compared with."""


def parameters_of(task: Task, symbol: Symbol) -> tuple[str, ...]:
    """The parameter names of a leaf: those that the domain declares, or else ``arg``, ``arg1``, …. None of a
    number is called as one of its :data:`BOUNDS`."""
    names = _parameters_of(task, symbol)
    return tuple(f"{name}_" if symbol.kind == "function" and name in BOUNDS else name for name in names)


def _parameters_of(task: Task, symbol: Symbol) -> tuple[str, ...]:
    for signature in task.signatures:
        if (signature.kind, signature.symbol, len(signature.parameters)) == (
            symbol.kind,
            symbol.name,
            symbol.arity,
        ):
            return parameter_names(signature.parameters)
    numbered = tuple(f"arg{i}" for i in range(1, symbol.arity + 1))
    return parameter_names(("arg",) if symbol.arity == 1 else numbered)
