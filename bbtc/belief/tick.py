"""One tick of a tree in one physical state.

The paper's Algorithm 1 ticks a whole belief; since equal states are merged and a tick reads, but
never changes, the variables, ticking every state of the belief on its own is the same function,
and the status returned per state is the paper's ``r_i``.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from typing import TypeAlias

from typing_extensions import assert_never

from bbtc.ground.condition import TRUE, Condition, compile_condition
from bbtc.ground.task import Task
from bbtc.kleene import Truth
from bbtc.tree.nodes import ActionNode, ConditionNode, ControlNode, Node, actions_of


class Status(enum.IntEnum):
    """What a node returns. The numbers equal the truth values they stand for."""

    FAILURE = 0
    RUNNING = 1
    SUCCESS = 2

    @property
    def word(self) -> str:
        """``failure``, ``running`` or ``success``."""
        return self.name.lower()


STARTED = 3
"""A tick returns ``STARTED + i`` (running, to every control node) when it started action node i."""

Tick: TypeAlias = Callable[[Sequence[int], int], int]
Observer: TypeAlias = Callable[[Node, int], None]


def compile_tick(task: Task, root: Node, observe: Observer | None = None) -> Tick:
    """The tree as a function from values and finished latches to a status number, or
    ``STARTED + i``. ``observe`` is told every node ticked and what it returned, in the order in
    which the nodes return.
    """
    order = {node.id: index for index, node in enumerate(actions_of(root))}

    def build(node: Node) -> Tick:
        match node:
            case ConditionNode():
                test = compile_condition(node.condition)
                tick: Tick = lambda values, _: test(values)  # noqa: E731
            case ActionNode():
                guard = task.action_by_name[node.action].precondition if node.guarded else TRUE
                tick = _action(order[node.id], node.latched, guard)
            case ControlNode():
                tick = _control(node.kind, [build(child) for child in node.children])
            case _:
                assert_never(node)
        return tick if observe is None else _observed(node, tick, observe)

    return build(root)


def _action(index: int, latched: bool, guard: Condition) -> Tick:
    bit, started = (1 << index if latched else 0), STARTED + index
    if guard == TRUE:
        return lambda _, finished: Status.SUCCESS if finished & bit else started
    test = compile_condition(guard)

    def tick(values: Sequence[int], finished: int) -> int:
        if finished & bit:
            return Status.SUCCESS
        holds = test(values)
        return started if holds == Truth.TRUE else holds

    return tick


def _control(kind: str, children: list[Tick]) -> Tick:
    # Each kind goes on while the child returns one status (semantics page, table of nodes). A
    # started action is running, but no Skipper goes on after it: only its last child holds actions.
    go_on = int({"sequence": Status.SUCCESS, "fallback": Status.FAILURE, "skipper": Status.RUNNING}[kind])

    def tick(values: Sequence[int], finished: int) -> int:
        for child in children:
            status = child(values, finished)
            if status != go_on:
                return status
        return go_on

    return tick


def _observed(node: Node, tick: Tick, observe: Observer) -> Tick:
    def observed(values: Sequence[int], finished: int) -> int:
        status = tick(values, finished)
        observe(node, status)
        return status

    return observed
