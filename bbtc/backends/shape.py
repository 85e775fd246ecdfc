"""Trees and conditions in a shape that an execution engine can take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from typing_extensions import assert_never

from bbtc.diagnostics import BbtcError
from bbtc.ground.condition import (
    FALSE,
    TRUE,
    And,
    Condition,
    Constant,
    Is,
    Known,
    Not,
    Or,
    Within,
    leaves,
    replaced,
)
from bbtc.ground.describe import describe
from bbtc.ground.task import Task, Variable, ground_name
from bbtc.kleene import Truth
from bbtc.printable import printable
from bbtc.tree.nodes import COUNTING, ActionNode, ConditionNode, ControlNode, Node, tree_depth

DEEPEST_TREE = 250
"""Levels of nodes an exported tree may have: BehaviorTree.CPP reads 256 levels of XML, and py_trees
needs a Python frame or two a level."""

_LONGEST_LABEL = 60

DEEPEST_CONDITION = 100
"""Levels of ``and``, ``or`` and ``not`` an exported condition may have, as many as are read by default: each
is a level of XML, besides some 130 of the tree around it, or a parenthesis of Python, which takes 200."""


def fit(root: Node, engine: str) -> Node:
    """The tree itself, or, if it is too deep, an equivalent one in which no control node stands
    directly in another of its kind. Raises :class:`BbtcError` if that is too deep as well, or if
    a condition is."""
    if tree_depth(root) > DEEPEST_TREE:
        root = _merged(root)
        levels = tree_depth(root)
        if levels > DEEPEST_TREE:
            raise BbtcError.single(
                "BBT0705",
                f"the tree has {levels} levels; {engine} takes at most {DEEPEST_TREE}",
                hint="plan with a lower target or with templates of their own for parts of the task",
            )
    return root


def _merged(root: Node) -> Node:
    # Bottom-up and iterative. Memoryless control nodes are associative: the inner node of the same
    # kind goes on, stops and returns exactly where the outer one does.
    done: dict[int, Node] = {}
    stack = [(root, False)]
    while stack:
        node, ready = stack.pop()
        match node:
            case ControlNode() if not ready:
                stack.append((node, True))
                stack.extend((child, False) for child in node.children)
            case ControlNode():
                children: list[Node] = []
                for child in node.children:
                    new = done[id(child)]
                    same = isinstance(new, ControlNode) and new.kind == node.kind
                    if isinstance(new, ControlNode) and same and node.kind not in COUNTING:
                        children.extend(new.children)
                    else:
                        children.append(new)
                done[id(node)] = replace(node, children=tuple(children))
            case ConditionNode() | ActionNode():
                done[id(node)] = node
            case _:
                assert_never(node)
    return done[id(root)]


def normal(task: Task, condition: Condition) -> Condition:
    """The condition with ``not`` pushed into the leaves and without constants, repeats, and tests
    for unknown of variables that are always known. Raises :class:`BbtcError` if it is too deep."""
    _check_depth(condition)

    def asked(leaf: Is | Known) -> Condition:
        if task.variables[leaf.variable].three_valued:
            return leaf
        if isinstance(leaf, Known):
            return TRUE
        return FALSE if leaf.value is Truth.UNKNOWN else leaf

    return replaced(condition, asked, numbers=lambda number: number)


def written(task: Task, condition: Condition) -> Condition:
    """The condition as exports hold it: in normal form (:func:`normal`), and where at most one part
    of an ``and`` or ``or`` can be unknown, with that part last. Then the first part that decides is
    met before the unknown one. Raises :class:`BbtcError` if it is too deep."""
    return _ordered(task, normal(task, condition))


def _ordered(task: Task, condition: Condition) -> Condition:
    match condition:
        case And(parts) | Or(parts):
            inner = [_ordered(task, part) for part in parts]
            unknowable = [can_be_unknown(task, part) for part in inner]
            if sum(unknowable) == 1:
                inner.append(inner.pop(unknowable.index(True)))
            return replace(condition, parts=tuple(inner))
        case Is() | Known() | Within() | Not() | Constant():
            return condition
        case _:
            assert_never(condition)


@dataclass(frozen=True, slots=True)
class Words:
    """A condition in words, printable: in full, and cut to the length of a label."""

    full: str
    short: str


def words_of(task: Task, condition: Condition, binding: Mapping[str, str] = MappingProxyType({})) -> Words:
    """A condition in words. ``binding`` renames objects, to the parameters they stand for."""

    def named(variable: Variable) -> str:
        return ground_name(variable.predicate, tuple(binding.get(arg, arg) for arg in variable.args))

    full = printable(describe(task, condition, named if binding else None))
    return Words(full, full if len(full) <= _LONGEST_LABEL else full[: _LONGEST_LABEL - 1] + "…")


def can_be_unknown(task: Task, condition: Condition) -> bool:
    """Whether a condition in normal form can have the value unknown."""
    return any(
        isinstance(leaf, Is)
        and leaf.value is not Truth.UNKNOWN
        and task.variables[leaf.variable].three_valued
        for leaf in leaves(condition)
    )


def _check_depth(condition: Condition) -> None:
    stack = [(condition, 1)]
    while stack:
        part, level = stack.pop()
        if level > DEEPEST_CONDITION:
            raise BbtcError.single(
                "BBT0705", f"a condition has more than {DEEPEST_CONDITION} levels of 'and', 'or' and 'not'"
            )
        match part:
            case And(parts) | Or(parts):
                stack.extend((p, level + 1) for p in parts)
            case Not(inner):
                stack.append((inner, level + 1))
            case Is() | Known() | Within() | Constant():
                pass
            case _:
                assert_never(part)
